// What a person does: takes the needle by mouse, finger or arrow keys, starts, stops, gives it back to the demo, sets its zero, turns it.

/** Arrow keys move the hand so far, with Shift ten times. */
const KEY_STEP_MM = 0.2;
/** How far the hand may be moved from the entry point. */
const REACH_MM = { low: -30, high: 60 };
/** A phone has none. */
const KEYS = matchMedia("(any-pointer: fine)").matches ? ", or arrow keys" : "";
/** The server hears of a new hand a little later; until then what it says of the old one does not count. */
const NEWS_MS = 500;

export class Hand {
  /**
   * @param {HTMLCanvasElement} canvas the section
   * @param {import("./section.js").Section} section what pixels mean
   * @param {import("./link.js").Link} link where wishes go
   */
  constructor(canvas, section, link) {
    this.canvas = canvas;
    this.section = section;
    this.link = link;
    this.person = false;
    this.movable = false;
    this.depth = 0; // where the hand wants the tip, mm
    this.actual = 0; // where the tip is, mm
    this.pointer = null;
    this.unsent = false;
    this.takenAt = -Infinity;
    this.skinTilt = 0; // what the tilt reads with the needle laid on the skin, rad
    canvas.addEventListener("pointerdown", (event) => this.take(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => this.letGo(event));
    document.addEventListener("keydown", (event) => this.key(event));
    document.getElementById("stop").addEventListener("click", () => this.stop());
    document.getElementById("start").addEventListener("click", () => link.send({ do: "start" }));
    this.zero = document.getElementById("zero");
    this.zero.addEventListener("click", () => this.setZero());
    this.angle = document.getElementById("angle");
    this.angle.addEventListener("input", () => this.turn());
    this.turnedAt = -Infinity;
    this.demo = document.getElementById("demo");
    this.demo.addEventListener("click", () => link.send({ do: "demo" }));
    this.note = document.getElementById("hand-note");
  }

  /** Whether there is a simulated hand at all, and a device that has a zero. */
  allow(movable, isDevice, travel, skinTilt) {
    this.movable = movable;
    this.skinTilt = skinTilt;
    document.getElementById("turn").hidden = !movable;
    this.zero.hidden = !isDevice;
    this.canvas.dataset.fixed = String(!movable);
    this.canvas.setAttribute("aria-valuemax", travel.toFixed(0));
    this.demo.hidden = !movable;
    this.say();
  }

  /** What the server says of who moves the needle, and where it is. */
  follow(hand, depth, tilt) {
    this.actual = depth;
    const degrees = (((tilt - this.skinTilt) * 180) / Math.PI).toFixed(0);
    if (this.angle.value !== degrees && performance.now() - this.turnedAt > NEWS_MS) this.angle.value = degrees;
    const person = this.movable && hand === "person";
    if (person === this.person || this.pointer !== null) return;
    if (this.person && performance.now() - this.takenAt < NEWS_MS) return;
    this.person = person;
    if (person) this.depth = depth;
    this.say();
  }

  say() {
    this.demo.disabled = !this.person;
    let text = "Moved by hand, on the device";
    if (this.movable) text = this.person ? `You hold the needle: drag${KEYS}` : "Demo hand: drag to take the needle";
    if (this.note.textContent !== text) this.note.textContent = text;
  }

  /** Called before each picture: many pointer events become one message. */
  tell() {
    if (!this.unsent) return;
    this.unsent = false;
    this.link.send({ do: "drag", depth_mm: Math.round(this.depth * 1000) / 1000 });
    this.canvas.setAttribute("aria-valuenow", this.depth.toFixed(1));
    this.canvas.setAttribute("aria-valuetext", `${this.depth.toFixed(1)} mm`);
  }

  want(depth) {
    this.depth = Math.min(REACH_MM.high, Math.max(REACH_MM.low, depth));
    this.unsent = true;
    if (!this.person) {
      this.person = true;
      this.takenAt = performance.now();
      this.say();
    }
  }

  take(event) {
    if (!this.movable || this.pointer !== null || event.button !== 0) return;
    this.pointer = event.pointerId;
    this.canvas.setPointerCapture(event.pointerId);
    this.canvas.dataset.held = "true";
    // A hand that already holds the needle goes on from where it is; a new one takes it where the tip is.
    this.grabbed = { depth: this.person ? this.depth : this.actual, x: event.clientX, y: event.clientY };
    this.want(this.grabbed.depth);
  }

  move(event) {
    if (event.pointerId !== this.pointer) return;
    const { depth, x, y } = this.grabbed;
    this.want(depth + this.section.along(event.clientX - x, event.clientY - y));
  }

  /** The needle stays with the person, where the hand was last. */
  letGo(event) {
    if (event.pointerId !== this.pointer) return;
    this.tell();
    this.pointer = null;
    this.canvas.dataset.held = "false";
    this.link.send({ do: "release" });
  }

  /** The tip is at depth 0 from now on; the hand stays where it is. */
  setZero() {
    if (this.link.send({ do: "zero" })) this.depth -= this.actual;
  }

  turn() {
    this.turnedAt = performance.now();
    const tilt = (Number(this.angle.value) * Math.PI) / 180 + this.skinTilt;
    this.link.send({ do: "tilt", rad: Math.max(0, Math.min(Math.PI / 2, tilt)) });
  }

  stop() {
    this.link.send({ do: "stop" });
  }

  /** Space and Escape stop wherever the focus is, and nothing else. */
  key(event) {
    if (event.key === " " || event.key === "Escape") {
      event.preventDefault();
      if (!event.repeat) this.stop();
      return;
    }
    const direction = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (direction && this.movable && document.activeElement === this.canvas) {
      event.preventDefault();
      const from = this.person ? this.depth : this.actual;
      this.want(from + direction * KEY_STEP_MM * (event.shiftKey ? 10 : 1));
    }
  }
}
