// Runs the device's WebAssembly for a while and prints the hash of all that it sent: `node digest.mjs FILE PROFILE TICKS`.

import { readFileSync } from "node:fs";

const [file, profile, ticks] = process.argv.slice(2);
const { instance } = await WebAssembly.instantiate(readFileSync(file), {});
const core = instance.exports;
const name = new TextEncoder().encode(profile);
const at = core.input();
new Uint8Array(core.memory.buffer, at, name.length).set(name);
if (core.start(name.length) !== 0) throw new Error(`${profile} was refused`);
core.advance(Number(ticks));
console.log(BigInt.asUintN(64, core.digest()).toString(16).padStart(16, "0"));
