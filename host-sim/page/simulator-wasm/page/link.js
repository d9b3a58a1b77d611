// The device in the page itself, in the place of the WebSocket: the control core and the plant as WebAssembly, the same
// messages. host-sim/page/simulator-wasm/src/lib.rs is the other side.

import { bytes } from "./bytes.js";

/** Between two exchanges, as the server has it. */
const EVERY_MS = 8;
/** A page that was asleep does not make up for more than this. */
const MOST_MS = 60;
const TICKS_PER_MS = 10;
const STALE_MS = 1000;

export class Link {
  /** @param {(message: object) => void} onMessage called with every message of the device */
  constructor(onMessage) {
    this.onMessage = onMessage;
    this.core = null;
    this.failed = false;
    this.stopOwed = false;
    this.lastMessageAt = this.lastPoseAt = performance.now();
    this.start().catch((error) => {
      this.failed = true;
      console.error(error);
    });
  }

  async start() {
    const { instance } = await WebAssembly.instantiate(await bytes("device.wasm"), {});
    const core = instance.exports;
    const profile = new URLSearchParams(location.search).get("profile") ?? "adult";
    const refused = this.text(core, core.start(this.write(core, profile)));
    if (refused) throw new Error(refused);
    this.core = core;
    let last = performance.now();
    let owed = 0;
    setInterval(() => {
      const now = performance.now();
      owed += Math.min(MOST_MS, now - last) * TICKS_PER_MS;
      last = now;
      const ticks = Math.floor(owed / 10) * 10;
      owed -= ticks;
      if (ticks === 0) return;
      core.advance(ticks);
      this.hear(this.text(core, core.tell()));
    }, EVERY_MS);
  }

  hear(lines) {
    for (const line of lines.split("\n")) {
      if (!line) continue;
      const message = JSON.parse(line);
      this.lastMessageAt = performance.now();
      if (message.type === "frame" && message.pose) this.lastPoseAt = this.lastMessageAt;
      this.onMessage(message);
    }
  }

  write(core, text) {
    const utf8 = new TextEncoder().encode(text);
    const at = core.input();
    new Uint8Array(core.memory.buffer, at, utf8.length).set(utf8);
    return utf8.length;
  }

  text(core, count) {
    const at = core.said();
    return new TextDecoder().decode(new Uint8Array(core.memory.buffer, at, count));
  }

  /** @returns {boolean} whether it was taken */
  send(message) {
    if (!this.core) return false;
    return this.text(this.core, this.core.receive(this.write(this.core, JSON.stringify(message)))) === "";
  }

  /** Milliseconds since the last news of the needle. */
  get dataAge() {
    return performance.now() - this.lastPoseAt;
  }

  /** @returns {"live" | "stale" | "lost"} */
  get condition() {
    if (this.failed) return "lost";
    return this.dataAge > STALE_MS ? "stale" : "live";
  }
}
