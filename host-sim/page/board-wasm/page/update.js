// The update over WebUSB: carries out the transfers that host-sim/page/board-wasm/src/dfu decides on, and shows how far it is.

import * as core from "./core.js";

/** The bootloader that the microcontroller has in ROM. */
const BOOTLOADER = { vendorId: 0x0483, productId: 0xdf11 };
/** DFU in USB's list of interfaces. */
const DFU = { interfaceClass: 0xfe, interfaceSubclass: 1 };

/**
 * Writes a file to a bootloader that the person chooses.
 * @param {Uint8Array} image
 * @param {(doing: string, share: number) => void} onProgress
 */
export async function update(image, onProgress) {
  const device = await navigator.usb.requestDevice({ filters: [BOOTLOADER] });
  await device.open();
  try {
    if (!device.configuration) await device.selectConfiguration(1);
    const { number, alternate, memory } = flashOf(device);
    const refused = core.beginUpdate(memory, image);
    if (refused) throw new Error(refused);
    await device.claimInterface(number);
    await device.selectAlternateInterface(number, alternate);
    await transfers(device, number, onProgress);
  } finally {
    await device.close().catch(() => {});
  }
}

/** The interface whose name describes the internal flash. */
function flashOf(device) {
  for (const { interfaceNumber: number, alternates } of device.configuration.interfaces) {
    for (const { alternateSetting: alternate, interfaceClass, interfaceSubclass, interfaceName } of alternates) {
      const isDfu = interfaceClass === DFU.interfaceClass && interfaceSubclass === DFU.interfaceSubclass;
      if (isDfu && interfaceName?.startsWith("@Internal Flash")) return { number, alternate, memory: interfaceName };
    }
  }
  throw new Error("This device has no internal flash to update. Choose \"STM32 BOOTLOADER\".");
}

async function transfers(device, index, onProgress) {
  for (;;) {
    const { next, doing, share } = core.nextTransfer();
    onProgress(doing, share);
    if (next.do === "done") return;
    if (next.do === "failed") throw new Error(next.why);
    try {
      core.transferred(await carryOut(device, index, next));
    } catch (error) {
      core.transferFailed(error.message);
    }
  }
}

async function carryOut(device, index, next) {
  const setup = { requestType: "class", recipient: "interface", request: next.request, value: next.value, index };
  if (next.do === "wait") {
    await new Promise((done) => setTimeout(done, next.ms));
    return new Uint8Array();
  }
  const { status, data } = next.do === "out"
    ? await device.controlTransferOut(setup, Uint8Array.from(next.data))
    : await device.controlTransferIn(setup, next.length);
  if (status !== "ok") throw new Error(`transfer: ${status}`);
  return data ? new Uint8Array(data.buffer, data.byteOffset, data.byteLength) : new Uint8Array();
}
