// What a person does: takes the needle by mouse, finger or arrow keys, starts, stops, gives it back to the demo, sets its zero, turns it.

import { number, t } from "./language.js";

/** Arrow keys move the hand so far, with Shift ten times. */
const KEY_STEP_MM = 0.2;
/** The limit to which the hand may draw the tip back from the entry point; inwards the limit is the hub on the skin. */
const DRAWN_BACK_MM = -15;
/** The elements that use the space bar themselves. */
const CONTROLS = "button, input, select, textarea, summary, a";
/** A phone has no keys. */
const HELD = matchMedia("(any-pointer: fine)").matches ? "hand.held_keys" : "hand.held";
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
    this.deepest = 0; // where the hub meets the skin, mm
    this.skinTilt = 0; // what the tilt reads with the needle laid on the skin, rad
    canvas.addEventListener("pointerdown", (event) => this.take(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => this.letGo(event));
    document.addEventListener("keydown", (event) => this.key(event));
    // A button that was clicked, not pressed by a key, gives the focus back, so that Space stops again.
    document.addEventListener("click", (event) => event.detail > 0 && event.target.closest?.("button")?.blur());
    document.getElementById("stop").addEventListener("click", () => this.stop());
    this.faulted = false;
    document.getElementById("start").addEventListener("click", () => link.send({ do: this.faulted ? "clear" : "start" }));
    this.zero = document.getElementById("zero");
    this.zero.addEventListener("click", () => this.setZero());
    this.angle = document.getElementById("angle");
    this.angle.addEventListener("input", () => this.turn());
    this.turnedAt = -Infinity;
    this.demo = document.getElementById("demo");
    this.demo.addEventListener("click", () => link.send({ do: "demo" }));
    this.note = document.getElementById("hand-note");
  }

  /** Follows the scene: whether there is a simulated hand at all, a device that has a zero, or a recording. */
  followScene(scene) {
    this.movable = scene.hand;
    this.source = scene.source.kind;
    this.skinTilt = scene.skin_tilt_rad;
    // Between the barriers, if the device has any.
    [this.angle.min, this.angle.max] = scene.slope_deg ?? [0, 90];
    this.deepest = Math.min(scene.travel_mm, scene.needle.length_mm);
    document.getElementById("turn").hidden = !this.movable;
    this.zero.hidden = this.source === "recording";
    this.canvas.dataset.fixed = String(!this.movable);
    this.canvas.setAttribute("aria-valuemin", String(DRAWN_BACK_MM));
    this.canvas.setAttribute("aria-valuemax", this.deepest.toFixed(0));
    this.demo.hidden = !this.movable;
    this.nameButtons();
    this.say();
  }

  /** While a fault is latched, Start clears it first: the person has looked at the device. */
  followFault(fault) {
    if (this.faulted === Boolean(fault)) return;
    this.faulted = Boolean(fault);
    this.nameButtons();
  }

  /** A recording has no torque: the same two buttons play and pause it. */
  nameButtons() {
    const [start, stop] = [document.getElementById("start"), document.getElementById("stop")];
    const recording = this.source === "recording";
    if (recording) [start.textContent, start.title] = [t("start.play"), t("start.play_title")];
    else if (this.faulted) [start.textContent, start.title] = [t("start.clear"), t("start.clear_title")];
    else [start.textContent, start.title] = [t("start.start"), t("start.title")];
    stop.firstChild.data = t(recording ? "stop.pause" : "stop.stop");
    stop.title = t(recording ? "stop.pause_title" : "stop.title");
  }

  /** Takes the server's message of who moves the needle, and its position. */
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
    let text = t(this.source === "recording" ? "hand.recording" : "hand.device");
    if (this.movable) text = t(this.person ? HELD : "hand.demo");
    if (this.note.textContent !== text) this.note.textContent = text;
  }

  /** Called before each picture: many pointer events become one message. */
  tell() {
    if (!this.unsent) return;
    this.unsent = false;
    this.link.send({ do: "drag", depth_mm: Math.round(this.depth * 1000) / 1000 });
    this.canvas.setAttribute("aria-valuenow", this.depth.toFixed(1));
    this.canvas.setAttribute("aria-valuetext", t("hand.value", { mm: number(this.depth, 1) }));
  }

  want(depth) {
    this.depth = Math.min(this.deepest, Math.max(DRAWN_BACK_MM, depth));
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
    this.section.held = true;
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
    this.section.held = false;
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

  /** Escape stops wherever the focus is and closes what is over the page; Space stops if no control
   *  has the focus. */
  key(event) {
    if (event.key === "Escape" || (event.key === " " && !document.activeElement?.matches(CONTROLS))) {
      event.preventDefault();
      if (!event.repeat) this.stop();
      if (event.key === "Escape") for (const dialog of document.querySelectorAll("dialog[open]")) dialog.close();
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
