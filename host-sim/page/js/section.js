// The needle in a section of the body. Millimetres with the entry point at 0, x along the skin, y perpendicular to it, down: layers and
// vessel stay where they are, and the needle turns about the point that tissue holds: its line has depth 0 at `axis.from`. The vessel runs along the section; the inset cuts across it.

import { surface } from "./canvas.js";
import { drawInset } from "./inset.js";
import { capital, number, t, tissueName } from "./language.js";
import { WAITING_MM, drawForce, drawGhost, drawNeedle, drawWish, halfHub, wholeLength } from "./needle.js";
import { NextStep } from "./next_step.js";
import { displace } from "./tissue.js";
import { middleOfVein } from "./vein.js";

/** On a phone the names are short and the inset is small. */
const NARROW = 560;
/** Free around what has to be seen, mm. */
const MARGIN_MM = 0.8;
/** At least so much of the tissue is shown beyond the entry point, mm. */
const AHEAD_MM = 6;
const LARGEST_SCALE = 46;
const COLUMNS = 120;
const FIBRES = 7;
const FIBRE_DASH = [38, 13, 64, 21, 17, 11];

export class Section {
  /** `small` is for a section among many others, with figures next to it: it has no ruler and no
   *  arrow. */
  constructor(canvas, colours, small = false) {
    this.small = small;
    this.surface = surface(canvas);
    this.colours = colours;
    this.next = new NextStep();
    this.axis = { x: 1, y: 0, angle: NaN, fromX: 0, fromY: 0 };
    this.scale = NaN;
    this.origin = { x: 0, y: 0 };
    this.point = { x: 0, y: 0 };
    this.size = { width: 0, height: 0 };
    /** While a person drags the needle: what a pixel means stays as it was when it was taken. */
    this.held = false;
    /** The values for tests: the drawn places of layers, tip and the hub's end and the needle's angle, in CSS pixels and rad. */
    this.drawn = { tops: [], entry: { x: NaN, y: NaN }, tip: { x: NaN, y: NaN }, hub: { x: NaN, y: NaN }, hubTop: { x: NaN, y: NaN }, scale: NaN, angle: NaN };
  }

  /** Millimetres along the needle for a movement of `dx`, `dy` CSS pixels. */
  along(dx, dy) {
    return (dx * this.axis.x + dy * this.axis.y) / (this.scale * this.surface.unit);
  }

  /** One picture. `view` is { depth, force, motor, angle, hand, person, ghost, seconds }, `tissue` a Tissue. */
  draw(view, tissue) {
    const { context: g, width, height } = this.surface;
    this.look(view, tissue, width, height);
    g.fillStyle = this.colours.sky;
    g.fillRect(0, 0, width, height);
    if (tissue.outlines) this.structures(g, tissue);
    else this.layers(g, tissue, width, height);
    tissue.vein.move(view.seconds, this.axis, view.depth, tissue);
    tissue.vein.drawBlood(g, this);
    this.vessel(g, tissue, width);
    this.beside(g, tissue);
    if (!this.small) this.ruler(g, tissue, width, height);
    this.needle(g, view, tissue);
    this.angle(g, view);
    this.names(g, tissue, width, height);
    this.scaleBar(g, width, height);
    if (tissue.vessel) this.inset(g, view, tissue, width);
    if (!this.small) this.next.draw(g, this, view, tissue);
    this.note(view, tissue);
  }

  /** Sets the view: tip and hub are in it, and the layers do not move while the needle goes in. */
  look(view, tissue, width, height) {
    const resized = width !== this.size.width || height !== this.size.height;
    Object.assign(this.size, { width, height });
    const ease = resized ? 1 : 1 - Math.exp(-view.seconds / 0.2);
    const come = (from, to) => (ease === 1 ? to : from + ease * (to - from));
    this.axis.angle = come(this.axis.angle, view.angle);
    this.axis.x = Math.cos(this.axis.angle);
    this.axis.y = Math.sin(this.axis.angle);
    this.axis.fromX = come(this.axis.fromX, view.originX ?? 0);
    this.axis.fromY = come(this.axis.fromY, view.originY ?? 0);
    if (!this.held || resized) {
      const wanted = this.wanted(view.depth, tissue, width, height);
      this.scale = come(this.scale, wanted.scale);
      this.origin.x = come(this.origin.x, wanted.x);
      this.origin.y = come(this.origin.y, wanted.y);
    }
    this.keepInSight(view.depth, tissue.needle, width, height);
  }

  /** Scale and entry point, in CSS pixels, that show needle, hub and every wall. */
  wanted(depth, tissue, width, height) {
    const { x, y } = this.axis;
    const { needle } = tissue;
    const deepest = Math.max(tissue.vessel?.far_mm ?? 0, tissue.layers.at(-1)?.depth_mm ?? 0, 5);
    const outside = wholeLength(needle) - Math.min(depth, WAITING_MM);
    const inside = Math.max(depth, Math.min(needle.length_mm, deepest / Math.max(y, 0.1)));
    const hub = halfHub(needle);
    const left = outside * x + hub * y + MARGIN_MM;
    const right = Math.max(inside * x + MARGIN_MM, AHEAD_MM);
    const up = outside * y + hub * x + MARGIN_MM;
    const down = Math.max(deepest + Math.max(1.5, 0.15 * deepest), depth * y + MARGIN_MM);
    const scale = Math.min(width / (left + right), height / (up + down), LARGEST_SCALE);
    return {
      scale,
      x: left * scale + 0.5 * (width - (left + right) * scale),
      y: up * scale + 0.4 * (height - (up + down) * scale),
    };
  }

  /** Held, or quicker than the picture follows: it shifts rather than lose the tip or a corner of the hub. */
  keepInSight(depth, needle, width, height) {
    const { x, y, fromX, fromY } = this.axis;
    const edge = MARGIN_MM * this.scale;
    const shift = (low, high, room) => Math.max(0, edge - low) - Math.max(0, high - (room - edge));
    const end = depth - wholeLength(needle);
    const hub = halfHub(needle);
    this.origin.x += shift(this.x(fromX + end * x - hub * y), this.x(fromX + depth * x), width);
    this.origin.y += shift(this.y(fromY + end * y - hub * x), this.y(fromY + depth * y), height);
  }

  /** Says what was drawn where. */
  note(view, tissue) {
    const { drawn } = this;
    const { unit } = this.surface;
    const { x, y, fromX, fromY } = this.axis;
    const place = (mm) => ({ x: unit * this.x(fromX + mm * x), y: unit * this.y(fromY + mm * y) });
    drawn.scale = unit * this.scale;
    drawn.angle = this.axis.angle;
    drawn.tops = tissue.layers.map((layer) => unit * this.y(layer.depth_mm));
    drawn.entry = place(0);
    drawn.tip = place(view.depth);
    drawn.hub = place(view.depth - wholeLength(tissue.needle));
    const corner = unit * this.scale * halfHub(tissue.needle);
    drawn.hubTop = { x: drawn.hub.x + corner * this.axis.y, y: drawn.hub.y - corner * this.axis.x };
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
      // One that ends has the layer above beside it.
      const reach = bands[i].reach_mm;
      g.save();
      if (reach) {
        g.beginPath();
        g.rect(this.x(reach[0]), -99, (reach[1] - reach[0]) * this.scale, height + 198);
        g.clip();
      }
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
      g.restore();
    }
  }

  /** The structures of a body, cut: each is painted over those before it. */
  structures(g, tissue) {
    for (const [number, { tissue: kind, points_mm: points }] of tissue.outlines.entries()) {
      g.beginPath();
      for (const [i, [x, y]] of points.entries()) {
        const middle = kind === "vessel" && tissue.vein.height < 1 ? (middleOfVein(tissue, x, y) ?? y) : y;
        displace(tissue, this.axis, x, middle + tissue.vein.height * (y - middle), this.point);
        if (i === 0) g.moveTo(this.x(this.point.x), this.y(this.point.y));
        else g.lineTo(this.x(this.point.x), this.y(this.point.y));
      }
      g.closePath();
      const isVessel = kind === "vessel" || kind === "other";
      g.fillStyle = this.colours[isVessel ? "lumen" : kind] ?? this.colours.other;
      g.fill();
      if (number > 0 && !isVessel) continue;
      g.strokeStyle = this.colours[isVessel ? "lumen" : "skin-edge"];
      g.lineWidth = isVessel ? 1 : 3;
      g.stroke();
    }
  }

  /** Draws the vessel, cut along: near wall, lumen, far wall. A vessel that the needle misses is
   *  only hinted at. */
  vessel(g, tissue, width) {
    const vessel = tissue.vessel;
    if (!vessel) return;
    const beside = tissue.place === "beside" || Math.abs(vessel.offset_mm) >= vessel.width_mm / 2;
    g.save();
    if (beside) g.globalAlpha = 0.35;
    const half = (tissue.vein.height * vessel.height_mm) / 2;
    const [near, far] = [vessel.axis_mm - half, vessel.axis_mm + half];
    // Down to the near wall and back along the far one: one closed line.
    g.beginPath();
    this.level(g, tissue, near, width);
    const left = -this.origin.x / this.scale - 3;
    const right = left + width / this.scale + 6;
    for (let i = COLUMNS; i >= 0; i--) {
      displace(tissue, this.axis, left + ((right - left) * i) / COLUMNS, far, this.point);
      g.lineTo(this.x(this.point.x), this.y(this.point.y));
    }
    g.closePath();
    g.fillStyle = this.colours.lumen;
    g.fill();
    for (const wall of [near, far]) {
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

  /** Structures that the needle is to spare: their place is the patient's, and they do not move. */
  beside(g, tissue) {
    for (const { name, along_mm, depth_mm, width_mm, height_mm } of tissue.beside) {
      const [x, y] = [this.x(along_mm), this.y(depth_mm)];
      g.beginPath();
      g.ellipse(x, y, (width_mm / 2) * this.scale, (height_mm / 2) * this.scale, 0, 0, 2 * Math.PI);
      g.fillStyle = this.colours.lumen;
      g.fill();
      g.strokeStyle = this.colours["vessel-wall"];
      g.lineWidth = 2.5;
      g.stroke();
      if (this.small) continue;
      g.font = `600 12px ${this.colours.font}`;
      g.textAlign = "left";
      g.textBaseline = "middle";
      this.onTissue(g, t("section.spare", { name: tissueName(name) }), x + (width_mm / 2) * this.scale + 6, y);
    }
  }

  /** Depth along the needle, where it will go: a tick each mm, a number where there is room for it. */
  ruler(g, tissue, width, height) {
    const far = tissue.vessel?.far_mm ?? tissue.layers.at(-1)?.depth_mm ?? 5;
    const reach = Math.min(Math.ceil(far / Math.max(this.axis.y, 0.1) + 3), tissue.needle.length_mm);
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
    g.font = `600 12px ${this.colours.font}`;
    g.textAlign = "center";
    g.textBaseline = "top";
    const labelled = [5, 10, 20].find((mm) => mm * this.scale >= 48) ?? 50;
    for (let mm = labelled; mm <= reach; mm += labelled) {
      const [x, y] = [this.x(this.axis.fromX + mm * this.axis.x), this.y(this.axis.fromY + mm * this.axis.y)];
      const onBar = x > width - 5 * this.scale - 48 && y > height - 64;
      if (!onBar) this.onTissue(g, `${mm} mm`, mm * this.scale, 10);
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
    const { x, y, fromX, fromY } = this.axis;
    g.translate(this.x(fromX + mm * x), this.y(fromY + mm * y));
    g.rotate(this.axis.angle);
  }

  needle(g, view, tissue) {
    if (tissue.vein.catheter) tissue.vein.drawCatheter(g, this, view.depth, tissue);
    g.save();
    this.alongNeedle(g, view.depth);
    if (Number.isFinite(view.ghost)) drawGhost(g, this.colours, this.scale, tissue.needle, view.ghost - view.depth, t("section.ghost"));
    if (view.person) drawWish(g, this.colours, this.scale, tissue.needle, view.hand - view.depth);
    drawNeedle(g, this.colours, this.scale, tissue.needle, tissue);
    g.restore();
    if (!tissue.vein.catheter) tissue.vein.drawCatheter(g, this, view.depth, tissue);
    g.save();
    this.alongNeedle(g, view.depth);
    if (!this.small) drawForce(g, this.colours, this.scale, tissue.needle, view.motor);
    g.restore();
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

  /** Names of the layers: each in its own layer at the left, where the needle never is, on a ground that it can be read on. */
  names(g, tissue, width, height) {
    g.font = `13px ${this.colours.font}`;
    g.textAlign = "left";
    g.textBaseline = "middle";
    let free = 0;
    for (const [i, layer] of tissue.layers.entries()) {
      const name = capital(tissueName(layer.structure ?? layer.name));
      // In a body the skin is not level: what counts is where the needle meets it.
      const [mm, key] = tissue.outlines ? [number(layer.along, 1), "section.along"] : [number(layer.depth_mm, 1), "section.under"];
      const deep = width < NARROW ? `${name} ${mm}` : t(key, { name, mm });
      const label = layer.depth_mm > 0 ? deep : name;
      const top = this.y(layer.depth_mm);
      const bottom = i + 1 < tissue.layers.length ? this.y(tissue.layers[i + 1].depth_mm) : height;
      const y = Math.max(Math.min((top + bottom) / 2, top + 16), free + 10);
      free = y + 10;
      g.globalAlpha = 0.85;
      g.fillStyle = this.colours.panel;
      g.beginPath();
      g.roundRect(8, y - 9, g.measureText(label).width + 12, 18, 4);
      g.fill();
      g.globalAlpha = 1;
      g.fillStyle = this.colours.text;
      g.fillText(label, 14, y + 0.5);
    }
  }

  inset(g, view, tissue, width) {
    const narrow = width < NARROW;
    const wide = narrow ? 112 : Math.min(240, 0.2 * width);
    const high = Math.min(0.92 * this.origin.y, 0.62 * wide);
    if (high > 40) drawInset(g, this.colours, { right: width - 8, wide, high }, tissue, this.axis.fromY + view.depth * this.axis.y, narrow);
  }

  scaleBar(g, width, height) {
    const x = width - 12 - 5 * this.scale;
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
    g.font = `600 12px ${this.colours.font}`;
    g.textAlign = "right";
    g.textBaseline = "bottom";
    this.onTissue(g, "5 mm", width - 12, y - 4);
  }
}
