// The WebAssembly behind this page: bytes and texts in and out. host-sim/page/board-wasm/src/lib.rs is the other side.

import { bytes } from "./bytes.js";

const encoder = new TextEncoder();
const decoder = new TextDecoder();
let core;

export async function load() {
  core = (await WebAssembly.instantiate(await bytes("board.wasm"), {})).instance.exports;
}

function give(data) {
  const utf8 = typeof data === "string" ? encoder.encode(data) : data;
  const at = core.board_input(utf8.length);
  new Uint8Array(core.memory.buffer, at, utf8.length).set(utf8);
  return utf8.length;
}

function said(count) {
  return new Uint8Array(core.memory.buffer, core.board_said(), count).slice();
}

const text = (count) => decoder.decode(said(count));

export const reset = () => core.board_reset();
/** @returns {Uint8Array} the bytes to send */
export const exchange = (data, now) => said(core.board_exchange(give(data), now));
/** @returns {object[]} the messages for the page */
export const tell = (now) => text(core.board_tell(now)).split("\n").map((line) => JSON.parse(line));
/** @returns {string} why it cannot be, or nothing */
export const begin = (task) => text(core.board_begin(give(JSON.stringify(task))));
export const answer = (message) => text(core.board_answer(give(JSON.stringify(message))));
/** The next bytes take the torque away; an open guide is left. */
export const stop = () => core.board_stop();
export const clear = () => core.board_clear();
export const file = () => text(core.board_file());

/** @returns {string} why it cannot be, or nothing */
export function beginUpdate(memory, image) {
  const name = encoder.encode(memory);
  const whole = new Uint8Array(name.length + 1 + image.length);
  whole.set(name);
  whole.set(image, name.length + 1);
  return text(core.dfu_begin(give(whole)));
}

export const nextTransfer = () => JSON.parse(text(core.dfu_next()));
export const transferred = (data) => core.dfu_answer(give(data));
export const transferFailed = (why) => core.dfu_failed(give(why));
