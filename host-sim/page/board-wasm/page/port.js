// A board on a serial port of the browser: opens it, carries bytes both ways, and closes it. What is sent is decided in
// host-sim/page/board-wasm/src/session.rs; a port that is opened again begins with nothing of what was before.

import * as core from "./core.js";

/** A board that is silent still has to be greeted, and a heartbeat is due every 50 ms. */
const TICK_MS = 20;

export class Port {
  /**
   * @param {SerialPort} port
   * @param {(why: string) => void} onEnd called once, with the reason, or nothing where it was closed here
   */
  constructor(port, onEnd) {
    this.port = port;
    this.onEnd = onEnd;
    this.why = "";
  }

  async open() {
    // The rate means nothing on USB; some number has to be given.
    await this.port.open({ baudRate: 115200, bufferSize: 65536 });
    core.reset();
    this.openedAt = performance.now();
    this.writer = this.port.writable.getWriter();
    this.reader = this.port.readable.getReader();
    this.timer = setInterval(() => this.exchange(new Uint8Array()), TICK_MS);
    this.read();
  }

  get now() {
    return performance.now() - this.openedAt;
  }

  exchange(received) {
    const out = core.exchange(received, this.now);
    if (out.length > 0) this.writer.write(out).catch((error) => this.fail(error));
  }

  async read() {
    try {
      for (;;) {
        const { value, done } = await this.reader.read();
        if (done) break;
        this.exchange(value);
      }
    } catch (error) {
      this.fail(error);
    }
    await this.end();
  }

  fail(error) {
    this.why ||= `The board is gone (${error.message}). Plug it in and connect again.`;
    this.reader.cancel().catch(() => {});
  }

  /** Closes it: the board takes any torque away when its heartbeat ends. */
  close() {
    this.reader?.cancel().catch(() => {});
  }

  async end() {
    clearInterval(this.timer);
    core.reset();
    for (const side of [this.reader, this.writer]) side.releaseLock();
    await this.port.close().catch(() => {});
    this.onEnd(this.why);
  }
}
