// The needle in a section of the body. Millimetres with the entry point at 0, x along the skin, y perpendicular to it, down: layers and
// vessel stay where they are, and the needle turns about the entry point. The vessel runs along the section; the inset cuts across it.

import { surface } from "./canvas.js";
import { displace } from "./tissue.js";

const NEEDLE = { length: 32, radius: 0.41, bevel: 2.1 }; // 21 gauge
/** The grip that a person drags, mm behind the tip. */
const GRIP_MM = 10;
/** How much of the skin is shown, and where on it the needle enters. */
const WIDE_MM = 33;
const ENTRY_SHARE = 0.42;
/** How much of the height lies above the skin. */
const AIR_SHARE = 0.38;
/** On a phone less is shown, larger. */
const NARROW = { width: 560, mm: 23 };
/** What the layers' names take of it, in CSS pixels. */
const NAMES_WIDE = 84;
const COLUMNS = 120;
const FIBRES = 7;
const FIBRE_DASH = [38, 13, 64, 21, 17, 11];
const MM_PER_N = 4;
const PLACES = {
  outside: "Outside the vessel", touching: "Touching the vessel", in_lumen: "In the lumen", through: "Through the far wall",
  beside: "Beside the vessel",
};

export class Section {
  /** `small`: among many others, with figures beside it: no ruler and no arrow. */
  constructor(canvas, colours, small = false) {
    this.small = small;
    this.surface = surface(canvas);
    this.colours = colours;
    this.axis = { x: 1, y: 0, angle: NaN };
    this.scale = NaN;
    this.origin = { x: 0, y: 0 };
    this.point = { x: 0, y: 0 };
    /** What a test reads: where the layers are drawn and how steep the needle, in CSS pixels and rad. */
    this.drawn = { tops: [], entry: this.origin, scale: NaN, angle: NaN };
  }

  /** Millimetres along the needle for a movement of `dx`, `dy` CSS pixels. */
  along(dx, dy) {
    return (dx * this.axis.x + dy * this.axis.y) / this.scale;
  }

  /** One picture. `view` is { depth, force, motor, angle, hand, person, canDrag, seconds }, `tissue` a Tissue. */
  draw(view, tissue) {
    const { context: g, width, height } = this.surface;
    this.look(view, tissue, width, height);
    g.fillStyle = this.colours.sky;
    g.fillRect(0, 0, width, height);
    this.layers(g, tissue, width, height);
    this.vessel(g, tissue, width);
    if (!this.small) this.ruler(g, view, tissue);
    this.needle(g, view, tissue);
    this.angle(g, view);
    if (!this.small) this.forceArrow(g, view);
    this.names(g, tissue, width, height);
    this.scaleBar(g, height);
    this.across(g, view, tissue, width);
    this.drawn.scale = this.scale;
    this.drawn.angle = this.axis.angle;
    this.drawn.tops = tissue.layers.map((layer) => this.y(layer.depth_mm));
  }

  /** Where the picture looks: the same place whatever the needle's angle, but that a tip far away makes it step back. */
  look(view, tissue, width, height) {
    const ease = Number.isNaN(this.axis.angle) ? 1 : 1 - Math.exp(-view.seconds / 0.2);
    this.axis.angle = ease === 1 ? view.angle : this.axis.angle + ease * (view.angle - this.axis.angle);
    this.axis.x = Math.cos(this.axis.angle);
    this.axis.y = Math.sin(this.axis.angle);
    const vessel = tissue.vessel?.far_mm ?? 0;
    const deepest = Math.max(vessel, tissue.layers.at(-1)?.depth_mm ?? 0, 5);
    const below = Math.max(deepest + Math.max(1.5, 0.15 * deepest), view.depth * this.axis.y + 1.5);
    const beyond = Math.max(0, view.depth * this.axis.x + 1.5);
    const wanted = Math.min(
      width / (width < NARROW.width ? NARROW.mm : WIDE_MM), ((1 - AIR_SHARE) * height) / below, ((1 - ENTRY_SHARE) * width) / beyond, 46);
    this.scale = ease === 1 ? wanted : this.scale + ease * (wanted - this.scale);
    this.origin.x = ENTRY_SHARE * width;
    this.origin.y = AIR_SHARE * height;
  }

  x(mm) { return this.origin.x + mm * this.scale; }
  y(mm) { return this.origin.y + mm * this.scale; }

  /** A line of tissue that is level at rest, from left to right. */
  level(g, tissue, y, width) {
    const left = -this.origin.x / this.scale - 3;
    const right = left + width / this.scale + 6;
    for (let i = 0; i <= COLUMNS; i++) {
      displace(tissue, this.axis, left + ((right - left) * i) / COLUMNS, y, this.point);
      if (i === 0) g.moveTo(this.x(this.point.x), this.y(this.point.y));
      else g.lineTo(this.x(this.point.x), this.y(this.point.y));
    }
  }

  layers(g, tissue, width, height) {
    const bottom = (height - this.origin.y) / this.scale + 3;
    const bands = tissue.layers.filter((layer) => !layer.of_vessel);
    for (let i = 0; i < bands.length; i++) {
      const top = bands[i].depth_mm;
      const end = i + 1 < bands.length ? bands[i + 1].depth_mm : bottom;
      g.beginPath();
      this.level(g, tissue, top, width);
      g.lineTo(width + 99, height + 99);
      g.lineTo(-99, height + 99);
      g.closePath();
      g.fillStyle = this.colours[bands[i].name] ?? this.colours.other;
      g.fill();
      if (i === 0) {
        g.beginPath();
        this.level(g, tissue, top, width);
        g.strokeStyle = this.colours["skin-edge"];
        g.lineWidth = 3;
        g.stroke();
      }
      g.beginPath();
      const lines = end === bottom ? FIBRES * 2 : Math.max(1, Math.floor((end - top) / 0.45));
      for (let k = 1; k < lines; k++) this.level(g, tissue, top + ((end - top) * k) / lines, width);
      g.strokeStyle = this.colours.fibre;
      g.lineWidth = 1.5;
      g.setLineDash(FIBRE_DASH);
      g.stroke();
      g.setLineDash([]);
    }
  }

  /** The vessel, cut along: near wall, lumen, far wall. One that the needle passes beside is only hinted at. */
  vessel(g, tissue, width) {
    const vessel = tissue.vessel;
    if (!vessel) return;
    const beside = tissue.place === "beside" || Math.abs(vessel.offset_mm) >= vessel.width_mm / 2;
    g.save();
    if (beside) g.globalAlpha = 0.35;
    const far = vessel.far_mm;
    // Down to the near wall and back along the far one: one closed line.
    g.beginPath();
    this.level(g, tissue, vessel.near_mm, width);
    const left = -this.origin.x / this.scale - 3;
    const right = left + width / this.scale + 6;
    for (let i = COLUMNS; i >= 0; i--) {
      displace(tissue, this.axis, left + ((right - left) * i) / COLUMNS, far, this.point);
      g.lineTo(this.x(this.point.x), this.y(this.point.y));
    }
    g.closePath();
    g.fillStyle = this.colours.lumen;
    g.fill();
    for (const wall of [vessel.near_mm, far]) {
      g.beginPath();
      this.level(g, tissue, wall, width);
      g.strokeStyle = this.colours["vessel-edge"];
      g.lineWidth = Math.max(5, 0.5 * this.scale);
      g.stroke();
      g.strokeStyle = this.colours["vessel-wall"];
      g.lineWidth = Math.max(2.5, 0.22 * this.scale);
      g.stroke();
    }
    g.restore();
  }

  /** Depth along the needle, where it will go: a tick each mm, a number each five. */
  ruler(g, view, tissue) {
    const far = tissue.vessel?.far_mm ?? tissue.layers.at(-1)?.depth_mm ?? 5;
    const reach = Math.min(Math.ceil(far / Math.max(this.axis.y, 0.1) + 3), 60);
    g.save();
    this.alongNeedle(g, 0);
    g.strokeStyle = this.colours.ruler;
    g.fillStyle = this.colours.ruler;
    g.globalAlpha = 0.9;
    g.lineWidth = 1;
    g.setLineDash([5, 4]);
    g.beginPath();
    g.moveTo(0, 0);
    g.lineTo(reach * this.scale, 0);
    g.stroke();
    g.setLineDash([]);
    g.beginPath();
    for (let mm = 1; mm <= reach; mm++) {
      g.moveTo(mm * this.scale, 0);
      g.lineTo(mm * this.scale, mm % 5 ? 4 : 8);
    }
    g.stroke();
    g.font = `12px ${this.colours.font}`;
    g.textAlign = "center";
    g.textBaseline = "top";
    const { width } = this.surface;
    // On a phone the layers' names need the right edge.
    const end = width < NARROW.width ? width - NAMES_WIDE : width;
    // Where five millimetres are narrower than their label, every second one has it.
    const labelled = 5 * this.scale < 48 ? 10 : 5;
    for (let mm = labelled; mm <= reach; mm += labelled) {
      if (this.x(mm * this.axis.x) < end) this.onTissue(g, `${mm} mm`, mm * this.scale, 10);
    }
    g.restore();
  }

  /** Words that can be read on fat as on blood: light with a dark edge. */
  onTissue(g, text, x, y) {
    g.strokeStyle = this.colours["ruler-edge"];
    g.fillStyle = this.colours.ruler;
    g.lineWidth = 3;
    g.lineJoin = "round";
    g.strokeText(text, x, y);
    g.fillText(text, x, y);
  }

  /** From here on x runs along the needle from `mm` past the entry point, in CSS pixels. */
  alongNeedle(g, mm) {
    g.translate(this.x(mm * this.axis.x), this.y(mm * this.axis.y));
    g.rotate(this.axis.angle);
  }

  /** Tip at the origin, bevel up. */
  needle(g, view, tissue) {
    const s = this.scale;
    const radius = NEEDLE.radius * s;
    const bevel = NEEDLE.bevel * s;
    const back = -NEEDLE.length * s;
    g.save();
    this.alongNeedle(g, view.depth);
    g.beginPath();
    g.moveTo(back, -2 * radius);
    g.lineTo(-bevel, -2 * radius);
    g.lineTo(0, 0);
    g.lineTo(back, 0);
    g.closePath();
    const steel = g.createLinearGradient(0, -2 * radius, 0, 0);
    steel.addColorStop(0, this.colours.steel);
    steel.addColorStop(0.35, this.colours["steel-light"]);
    steel.addColorStop(1, this.colours["steel-dark"]);
    g.fillStyle = steel;
    g.fill();
    g.strokeStyle = this.colours["steel-dark"];
    g.lineWidth = 1;
    g.stroke();
    // The ground face and its opening; blood shows in it once the vessel is entered.
    g.beginPath();
    g.ellipse(-0.55 * bevel, -1.12 * radius, 0.34 * bevel, 0.34 * radius, Math.atan2(2 * radius, bevel), 0, 2 * Math.PI);
    g.fillStyle = tissue.inLumen ? this.colours.lumen : this.colours["steel-dark"];
    g.fill();
    this.hub(g, tissue, radius);
    if (view.person || view.canDrag) this.grip(g, view, radius);
    g.restore();
  }

  /** The window behind the grip in which blood shows once the lumen was reached. */
  hub(g, tissue, radius) {
    const s = this.scale;
    g.beginPath();
    g.roundRect(-(GRIP_MM + 6.2) * s, -radius - 0.95 * s, 3.9 * s, 1.9 * s, 0.5 * s);
    g.fillStyle = tissue.flashback ? this.colours.lumen : this.colours.sky;
    g.fill();
    g.strokeStyle = this.colours["steel-dark"];
    g.lineWidth = 1.5;
    g.stroke();
  }

  /** What a person takes hold of, and where the hand wants it to be. */
  grip(g, view, radius) {
    const at = -GRIP_MM * this.scale;
    const half = 1.5 * this.scale;
    const wide = 2 * radius + 12;
    if (view.person) {
      const wish = at + (view.hand - view.depth) * this.scale;
      g.strokeStyle = this.colours.grip;
      g.lineWidth = 2;
      g.setLineDash([4, 3]);
      g.beginPath();
      g.roundRect(wish - half, -radius - wide / 2, 2 * half, wide, 6);
      g.stroke();
      g.setLineDash([]);
    }
    g.beginPath();
    g.roundRect(at - half, -radius - wide / 2, 2 * half, wide, 6);
    g.fillStyle = this.colours.grip;
    g.fill();
    g.strokeStyle = this.colours.panel;
    g.lineWidth = 2;
    g.beginPath();
    for (let i = -2; i <= 2; i++) {
      g.moveTo(at + i * 0.4 * half, -radius - 0.28 * wide);
      g.lineTo(at + i * 0.4 * half, -radius + 0.28 * wide);
    }
    g.stroke();
  }

  angle(g, view) {
    const from = Math.PI;
    g.beginPath();
    g.arc(this.x(0), this.y(0), 3.6 * this.scale, from, from + this.axis.angle);
    g.strokeStyle = this.colours.muted;
    g.lineWidth = 1;
    g.stroke();
    const middle = from + this.axis.angle / 2;
    g.fillStyle = this.colours.muted;
    g.font = `13px ${this.colours.font}`;
    g.textAlign = "right";
    g.textBaseline = "middle";
    const far = 3.9 * this.scale;
    g.fillText(`${((view.angle * 180) / Math.PI).toFixed(0)}°`, this.x(0) + far * Math.cos(middle), this.y(0) + far * Math.sin(middle));
  }

  /** What the hand feels, beside the grip: against insertion up the needle, against withdrawal down it. */
  forceArrow(g, view) {
    if (Math.abs(view.motor) < 0.005) return;
    const s = this.scale;
    g.save();
    this.alongNeedle(g, view.depth - GRIP_MM + 4);
    const length = view.motor * MM_PER_N * s;
    const y = -2.6 * s;
    g.strokeStyle = this.colours.force;
    g.fillStyle = this.colours.force;
    g.lineWidth = 4;
    g.beginPath();
    g.moveTo(0, y - 5);
    g.lineTo(0, y + 5);
    g.stroke();
    if (Math.abs(length) > 2) {
      const head = Math.sign(length) * Math.min(10, Math.abs(length));
      g.beginPath();
      g.moveTo(0, y);
      g.lineTo(-length + head, y);
      g.stroke();
      g.beginPath();
      g.moveTo(-length, y);
      g.lineTo(-length + head, y - 7);
      g.lineTo(-length + head, y + 7);
      g.fill();
    }
    g.font = `600 14px ${this.colours.font}`;
    g.textAlign = "left";
    g.textBaseline = "middle";
    g.fillText(`${view.motor.toFixed(2)} N`, (length < 0 ? -length : 0) + 10, y);
    g.restore();
  }

  /** Names of the layers: each in its own layer at the right. */
  names(g, tissue, width, height) {
    g.font = `13px ${this.colours.font}`;
    g.textAlign = "right";
    g.textBaseline = "middle";
    let free = 0;
    for (const [i, layer] of tissue.layers.entries()) {
      // In the lumen, which is dark by day and by night.
      g.fillStyle = layer.is_vessel ? this.colours.ruler : this.colours["on-tissue"];
      const name = layer.name.charAt(0).toUpperCase() + layer.name.slice(1);
      const label = width < NARROW.width ? name : `${name}, ${layer.depth_mm.toFixed(1)} mm deep`;
      const top = this.y(layer.depth_mm);
      const bottom = i + 1 < tissue.layers.length ? this.y(tissue.layers[i + 1].depth_mm) : height;
      const y = Math.max(Math.min((top + bottom) / 2, top + 16), free + 9);
      g.fillText(label, width - 12, y);
      free = y + 9;
    }
  }

  /** The vessel cut across, at the top right: an ellipse with its wall, the needle's tip in it or beside it, and that in words. */
  across(g, view, tissue, width) {
    const vessel = tissue.vessel;
    if (!vessel) return;
    const wide = width < NARROW.width ? 112 : 176;
    const high = Math.min(0.92 * this.origin.y, 0.62 * wide);
    const left = width - wide - 8;
    const top = 8;
    const s = Math.min((0.5 * wide) / vessel.width_mm, (0.42 * high) / vessel.height_mm);
    const centre = { x: left + wide / 2, y: top + 0.44 * high };
    const middle = vessel.axis_mm;
    g.save();
    g.beginPath();
    g.roundRect(left, top, wide, high, 8);
    g.clip();
    g.fillStyle = this.colours.muscle;
    g.fillRect(left, top, wide, high);
    const tip = { x: centre.x - vessel.offset_mm * s, y: centre.y + (view.depth * this.axis.y - middle) * s };
    g.beginPath();
    g.ellipse(centre.x, centre.y, (vessel.width_mm / 2) * s, (vessel.height_mm / 2) * s, 0, 0, 2 * Math.PI);
    g.fillStyle = this.colours.lumen;
    g.fill();
    g.strokeStyle = this.colours["vessel-wall"];
    g.lineWidth = 3;
    g.stroke();
    g.beginPath();
    g.moveTo(tip.x, top);
    g.lineTo(tip.x, tip.y);
    g.strokeStyle = this.colours["steel-light"];
    g.lineWidth = 2 * NEEDLE.radius * s;
    if (tip.y > top) g.stroke();
    g.beginPath();
    g.arc(tip.x, tip.y, 4, 0, 2 * Math.PI);
    g.fillStyle = this.colours.grip;
    g.fill();
    g.fillStyle = this.colours.panel;
    g.fillRect(left, top + high - 22, wide, 22);
    g.fillStyle = this.colours.text;
    g.font = `600 12px ${this.colours.font}`;
    g.textAlign = "center";
    g.textBaseline = "middle";
    const words = PLACES[tissue.place] ?? "";
    g.fillText(width < NARROW.width ? words.replace(" the vessel", "").replace("Through the far wall", "Through") : words, left + wide / 2, top + high - 10);
    g.restore();
    g.strokeStyle = this.colours.line;
    g.lineWidth = 1;
    g.beginPath();
    g.roundRect(left, top, wide, high, 8);
    g.stroke();
  }

  scaleBar(g, height) {
    const x = 12;
    const y = height - 16;
    g.beginPath();
    g.moveTo(x, y - 4);
    g.lineTo(x, y);
    g.lineTo(x + 5 * this.scale, y);
    g.lineTo(x + 5 * this.scale, y - 4);
    for (const [colour, wide] of [["ruler-edge", 4], ["ruler", 2]]) {
      g.strokeStyle = this.colours[colour];
      g.lineWidth = wide;
      g.stroke();
    }
    g.font = `12px ${this.colours.font}`;
    g.textAlign = "left";
    g.textBaseline = "bottom";
    this.onTissue(g, "5 mm", x + 6, y - 4);
  }
}
