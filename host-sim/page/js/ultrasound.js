// The ultrasound image next to the limb, and the probe that a person moves over the skin.

import { IMAGE_WIDTH_MM, LINES, SAMPLES } from "./picture.js";
import { surface } from "./canvas.js";
import { number, t } from "./language.js";

/** The range of the probe, mm and rad. */
const REACH = { along: [4, 22], across: [-8, 8], azimuth: [-Math.PI / 2, Math.PI / 2], lean: [-0.6, 0.6] };
const ALONG_VIEW = { along: 13, across: 0, azimuth: 0, lean: 0 };
/** Between two images: 30 a second look smooth, and leave time for the rest. */
const EVERY_S = 1 / 31;
/** Between two reports of the probe to the program, and between two that say the same. */
const REPORT_MS = 100;
const AGAIN_MS = 1000;

export class Ultrasound {
  /** @param {HTMLCanvasElement} canvas
   *  @param {Record<string, string>} colours of style.css, by name */
  constructor(canvas, colours) {
    this.surface = surface(canvas);
    this.colours = colours;
    this.probe = { ...ALONG_VIEW, depth: 16 };
    this.since = Infinity;
    this.image = document.createElement("canvas");
    this.image.width = SAMPLES;
    this.image.height = LINES;
    this.context = this.image.getContext("2d");
    this.pixels = this.context.createImageData(SAMPLES, LINES);
    this.words = new Uint32Array(this.pixels.data.buffer);
    this.greys = Uint32Array.from({ length: 256 }, (_, grey) => 0xff000000 | (grey * 0x010101));
    this.seen = null;
    this.sliders = ["along", "across", "azimuth"].map((name) => document.getElementById(`probe-${name}`));
    this.movable(canvas);
    /** The last report of the probe, and its time. */
    this.said = { text: "", at: -Infinity };
  }

  movable(canvas) {
    let last = null;
    canvas.addEventListener("pointerdown", (event) => {
      last = event;
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (last?.pointerId !== event.pointerId) return;
      const mm = IMAGE_WIDTH_MM / (this.shown.width * this.surface.unit);
      const [dx, dy] = [event.clientX - last.clientX, event.clientY - last.clientY];
      if (event.shiftKey) this.move("azimuth", dx * 0.006);
      else {
        // The image follows the hand; up and down moves the probe out of its plane.
        const [s, c] = [Math.sin(this.probe.azimuth), Math.cos(this.probe.azimuth)];
        this.move("along", -dx * mm * c - dy * 0.03 * -s);
        this.move("across", -dx * mm * s - dy * 0.03 * c);
      }
      last = event;
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { last = null; });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.move("azimuth", event.deltaY * 0.0005);
    }, { passive: false });
    for (const slider of this.sliders) {
      const name = slider.id.slice("probe-".length);
      slider.addEventListener("input", () => {
        const value = Number(slider.value);
        this.probe[name] = name === "azimuth" ? (value * Math.PI) / 180 : value;
      });
    }
    document.getElementById("probe-home").addEventListener("click", () => {
      Object.assign(this.probe, ALONG_VIEW);
      this.tell();
    });
  }

  /** Goes to a place of the skin; with Shift it turns and leans where it is. */
  drag([along, across], event) {
    if (event.shiftKey) {
      this.move("azimuth", event.movementX * 0.01);
      this.move("lean", event.movementY * 0.01);
      return;
    }
    this.move("along", along - this.probe.along);
    this.move("across", across - this.probe.across);
  }

  /** Another anatomy: the image reaches as deep as that asks for. */
  build(picture) {
    this.probe.depth = picture.imageDepth;
  }

  move(name, by) {
    const [low, high] = REACH[name];
    this.probe[name] = Math.min(high, Math.max(low, this.probe[name] + by));
    this.tell();
  }

  tell() {
    for (const slider of this.sliders) {
      const name = slider.id.slice("probe-".length);
      slider.value = name === "azimuth" ? ((this.probe[name] * 180) / Math.PI).toFixed(0) : this.probe[name].toFixed(1);
    }
  }

  /** Tells the program, for its recording, where the probe is and whether it sees the tip: at most ten times a second, and again each second. */
  report(link, now) {
    if (!this.seen || now - this.said.at < REPORT_MS) return;
    const { along, across, azimuth, lean } = this.probe;
    const message = {
      do: "probe", along_mm: along, across_mm: across, azimuth_rad: azimuth, lean_rad: lean,
      share_in_plane: Math.min(1, Math.max(0, this.seen.share || 0)), tip_seen: this.seen.tip,
    };
    const text = JSON.stringify(message);
    if (text === this.said.text && now - this.said.at < AGAIN_MS) return;
    if (link.send(message)) this.said = { text, at: now };
  }

  /** One picture, `seconds` after the last, with the tip at `depth` mm along the needle. */
  draw(picture, seconds, depth) {
    this.since += seconds;
    if (this.since >= EVERY_S) {
      const grey = picture.image(this.probe, Math.min(this.since, 0.5), 0);
      for (let i = 0; i < grey.length; i++) this.words[i] = this.greys[grey[i]];
      this.context.putImageData(this.pixels, 0, 0);
      this.seen = picture.seen;
      this.since = 0;
    }
    const { context: g, width, height } = this.surface;
    g.fillStyle = "#000";
    g.fillRect(0, 0, width, height);
    const scale = Math.min((width - 44) / IMAGE_WIDTH_MM, (height - 34) / this.probe.depth);
    this.shown = { width: IMAGE_WIDTH_MM * scale, height: this.probe.depth * scale };
    const left = (width - this.shown.width + 30) / 2;
    const top = 10;
    g.save();
    // The image holds lines as rows; on the screen they run down.
    g.transform(0, this.shown.height / SAMPLES, this.shown.width / LINES, 0, left, top);
    g.drawImage(this.image, 0, 0);
    g.restore();
    this.ruler(g, left, top, scale);
    this.words_(g, left, top, depth);
  }

  ruler(g, left, top, scale) {
    g.strokeStyle = g.fillStyle = "#c8d4dc";
    g.lineWidth = 1;
    g.font = `11px ${this.colours.font}`;
    g.textAlign = "right";
    g.textBaseline = "middle";
    g.beginPath();
    for (let mm = 0; mm <= this.probe.depth; mm++) {
      g.moveTo(left - 4, top + mm * scale);
      g.lineTo(left - (mm % 5 ? 7 : 11), top + mm * scale);
    }
    g.stroke();
    for (let mm = 0; mm <= this.probe.depth; mm += 5) g.fillText(`${mm}`, left - 14, top + mm * scale);
  }

  words_(g, left, top, depth) {
    if (!this.seen) return;
    const { share, tip, beside, tipShare, inserted } = this.seen;
    const soFar = inserted > 0 ? t("probe.so_far", { percent: number(100 * tipShare, 0) }) : "";
    let now = t("probe.outside");
    if (depth > 0) {
      const away = Math.abs(beside) > 0.3 ? t("probe.tip_beside", { mm: number(Math.abs(beside), 1) }) : t("probe.no_tip");
      now = t("probe.in_plane", { percent: number(100 * share, 0), where: tip ? t("probe.tip") : away });
    }
    const text = [now, soFar].filter(Boolean).join("; ");
    g.fillStyle = "#e8eff4";
    g.font = `12px ${this.colours.font}`;
    g.textAlign = "left";
    g.textBaseline = "top";
    g.fillText(text, left, top + this.shown.height + 6, this.shown.width);
  }
}
