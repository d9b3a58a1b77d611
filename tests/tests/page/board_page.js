// A serial port and a bootloader in the place of the browser's: what the page sends is kept until the test takes it, what the test gives comes
// out of the port. Each request of the page for a port or a device is granted at once.

/** A port that says in `state` whether it is open, what was sent, and where the page reads. */
const mockPort = (state) => ({
  async open() {
    state.opened += 1;
    state.out = [];
    this.readable = new ReadableStream({ start: (controller) => { state.input = controller; } });
    this.writable = new WritableStream({ write: (chunk) => { state.out.push(...chunk); } });
  },
  async close() { state.input = null; },
});

/** A bootloader that keeps each transfer in `state` until it is answered. */
const mockBootloader = (state) => {
  const ask = (transfer) => new Promise((resolve, reject) => {
    state.asked = transfer;
    state.answer = ({ failed, data }) => (failed ? reject(new Error(failed)) : resolve({ status: "ok", data: new DataView(Uint8Array.from(data).buffer) }));
  });
  return {
    configuration: { interfaces: [{ interfaceNumber: 0, alternates: [
      { alternateSetting: 0, interfaceClass: 0xfe, interfaceSubclass: 1, interfaceName: window.mockMemory },
      { alternateSetting: 1, interfaceClass: 0xfe, interfaceSubclass: 1, interfaceName: "@Option Bytes  /0x1FFFC000/01*016 e" },
    ] }] },
    opened: false,
    async open() { this.opened = true; },
    async close() { this.opened = false; },
    async claimInterface() {},
    async selectAlternateInterface(number, alternate) { state.alternate = [number, alternate]; },
    controlTransferOut: ({ request, value }, data) => ask({ do: "out", request, value, data: [...data] }),
    controlTransferIn: ({ request, value }, length) => ask({ do: "in", request, value, length }),
  };
};

/** The other end of both, for the test. */
const mockEnd = (state) => ({
  state,
  /** Gives bytes to the page. @returns {number[]} those that it has sent */
  exchange(bytes) {
    if (bytes.length && state.input) state.input.enqueue(Uint8Array.from(bytes));
    return state.out.splice(0);
  },
  /** The cable is pulled. */
  pull() { state.input?.error(new Error("The device has been lost.")); },
  /** Answers the last transfer. @returns {object} the next one, or null */
  async transfer(answer) {
    if (answer) {
      const give = state.answer;
      state.answer = state.asked = null;
      give(answer);
    }
    for (let looks = 0; looks < 200 && !state.asked && document.getElementById("banner").hidden; looks += 1) {
      await new Promise((done) => setTimeout(done, 1));
    }
    return state.asked;
  },
  choose(bytes) {
    const files = new DataTransfer();
    files.items.add(new File([Uint8Array.from(bytes)], "needle.dfu"));
    const input = document.getElementById("image");
    input.files = files.files;
    input.dispatchEvent(new Event("change"));
  },
});

(() => {
  const state = { opened: 0, out: [], asked: null, answer: null, input: null };
  const device = mockBootloader(state);
  window.mock = mockEnd(state);
  Object.defineProperty(navigator, "serial", { value: { requestPort: async () => mockPort(state) } });
  Object.defineProperty(navigator, "usb", { value: { requestDevice: async () => device } });
})();
