// The two plots: depth, force and torque against time, and force against depth. Both read a Trace and allocate nothing per frame.

import { surface } from "./canvas.js";
import { number, t } from "./language.js";

export const WINDOW_S = 10;
const GUTTER = { left: 52, right: 10, top: 8, bottom: 24 };
/** Room for the axis of torque. */
const TORQUE = 58;
/** A gap in the data longer than this is a gap in the line. */
const GAP_S = 0.03;
const FADE_STEPS = 8;

/** An axis that grows in whole steps and shrinks back slowly, so that it does not jump about. */
class Range {
  constructor(low, high, step) {
    this.least = { low, high };
    this.low = low;
    this.high = high;
    this.step = step;
  }

  /** Takes in the extremes of what is shown. */
  cover(low, high) {
    const slack = 0.05 * this.step;
    const down = Math.min(this.least.low, Math.floor((low - slack) / this.step) * this.step);
    const up = Math.max(this.least.high, Math.ceil((high + slack) / this.step) * this.step);
    if (Number.isFinite(down)) this.low = down;
    if (Number.isFinite(up)) this.high = up;
  }
}

const depthRange = () => new Range(-5, 10, 5);
const forceRange = () => new Range(-0.5, 1.5, 0.5);

/** Extremes of `trace` since entry `from`, into `out`. */
function extremes(trace, low, high, from, out) {
  out.low = Infinity;
  out.high = -Infinity;
  for (let i = from; i < trace.end; i++) {
    const at = i % low.length;
    if (low[at] < out.low) out.low = low[at];
    if (high[at] > out.high) out.high = high[at];
  }
}

/** Lines and numbers of an axis from `low` to `high` at `place(value)`. */
function ticks(range, most, draw) {
  let step = range.step;
  while ((range.high - range.low) / step > most) step *= 2;
  for (let value = Math.ceil(range.low / step) * step; value <= range.high + 1e-9; value += step) draw(value);
}

/** Free space around the name of a puncture, in points: half before it and half after. */
const NAME_GAP = 8;

const label = (value, step) => number(value, step < 1 ? 1 : 0);

/** A plot of depth and force on a canvas, with an axis for each. */
class Plot {
  constructor(canvas, colours) {
    this.surface = surface(canvas);
    this.colours = colours;
    this.depth = depthRange();
    this.force = forceRange();
    this.found = { low: 0, high: 0 };
  }

  /** Clears the canvas and fits the axis of depth; returns the trace's first entry within the window. */
  begin(trace, now) {
    const { context: g, width, height } = this.surface;
    g.fillStyle = this.colours.panel;
    g.fillRect(0, 0, width, height);
    const from = trace.firstSince(now - WINDOW_S);
    extremes(trace, trace.depthLow, trace.depthHigh, from, this.found);
    this.depth.cover(this.found.low, this.found.high);
    return from;
  }
}

export class TimePlot extends Plot {
  constructor(canvas, colours) {
    super(canvas, colours);
    this.marks = []; // punctures: { t, text }
    /** mN·m of the motor for each N at the needle; not a number until the motor has had a force. */
    this.torquePerForce = NaN;
  }

  mark(t, text) {
    this.marks.push({ t, text });
    if (this.marks.length > 40) this.marks.shift();
  }

  clear() {
    this.marks.length = 0;
  }

  /** Learns the scale of torque from a pose whose force is more than rounding. */
  learn(motorN, torqueMnm) {
    if (Math.abs(motorN) > 0.05) this.torquePerForce = torqueMnm / motorN;
  }

  draw(trace, now) {
    const { context: g, width, height } = this.surface;
    const from = this.begin(trace, now);
    extremes(trace, trace.motorLow, trace.motorHigh, from, this.found);
    const { low, high } = this.found;
    extremes(trace, trace.lawLow, trace.lawHigh, from, this.found);
    this.force.cover(Math.min(low, this.found.low), Math.max(high, this.found.high));
    const left = GUTTER.left;
    const wide = width - left - TORQUE;
    const each = (height - GUTTER.top - GUTTER.bottom - 14) / 2;
    const second = GUTTER.top + each + 14;
    this.axes(g, t("plot.depth"), this.depth, left, GUTTER.top, wide, each, this.colours.depth);
    this.axes(g, t("plot.force"), this.force, left, second, wide, each, this.colours.force);
    this.torque(g, left + wide, second, each);
    this.seconds(g, left, wide, height);
    this.drawMarks(g, now, left, wide, second - 7, height - GUTTER.bottom);
    g.save();
    g.beginPath();
    g.rect(left, 0, wide, height);
    g.clip();
    const line = (lows, highs, range, top, colour, thick) => {
      g.strokeStyle = colour;
      g.lineWidth = thick;
      columns(g, trace, lows, highs, from, now, left, wide, range, top, each);
    };
    line(trace.depthLow, trace.depthHigh, this.depth, GUTTER.top, this.colours.depth, 2);
    line(trace.motorLow, trace.motorHigh, this.force, second, this.colours.motor, 4);
    line(trace.lawLow, trace.lawHigh, this.force, second, this.colours.force, 1.75);
    g.restore();
  }

  axes(g, name, range, left, top, wide, high, colour) {
    g.font = `12px ${this.colours.font}`;
    g.lineWidth = 1;
    g.textAlign = "right";
    g.textBaseline = "middle";
    ticks(range, high / 26, (value) => {
      const y = Math.round(top + (high * (range.high - value)) / (range.high - range.low)) + 0.5;
      g.strokeStyle = value === 0 ? this.colours.muted : this.colours.grid;
      g.beginPath();
      g.moveTo(left, y);
      g.lineTo(left + wide, y);
      g.stroke();
      g.fillStyle = this.colours.muted;
      g.fillText(label(value, range.step), left - 6, y);
    });
    g.save();
    g.translate(12, top + high / 2);
    g.rotate(-Math.PI / 2);
    g.textAlign = "center";
    g.fillStyle = colour;
    g.font = `600 12px ${this.colours.font}`;
    g.fillText(name, 0, 0);
    g.restore();
  }

  /** The axis of the motor's torque, at the right of the strip of forces: one is the other times the roller's radius. */
  torque(g, right, top, high) {
    if (Number.isNaN(this.torquePerForce)) return;
    const { force, torquePerForce } = this;
    g.textAlign = "left";
    g.textBaseline = "middle";
    g.fillStyle = this.colours.muted;
    ticks(force, high / 26, (value) => {
      const y = Math.round(top + (high * (force.high - value)) / (force.high - force.low)) + 0.5;
      g.fillText(label(value * torquePerForce, force.step * Math.abs(torquePerForce)), right + 6, y);
    });
    g.save();
    g.translate(right + TORQUE - 8, top + high / 2);
    g.rotate(Math.PI / 2);
    g.textAlign = "center";
    g.fillStyle = this.colours.motor;
    g.font = `600 12px ${this.colours.font}`;
    g.fillText(t("plot.torque"), 0, 0);
    g.restore();
  }

  seconds(g, left, wide, height) {
    g.font = `12px ${this.colours.font}`;
    g.textBaseline = "bottom";
    g.fillStyle = this.colours.muted;
    // Labels are about 40 points wide.
    for (let ago = 0; ago <= WINDOW_S; ago += wide < 280 ? 5 : 2) {
      g.textAlign = ago === 0 ? "right" : ago === WINDOW_S ? "left" : "center";
      g.fillText(ago === 0 ? t("plot.now") : `−${ago} s`, left + wide * (1 - ago / WINDOW_S), height - 2);
    }
  }

  /** Punctures: a line through both strips, its name between them. */
  drawMarks(g, now, left, wide, between, bottom) {
    g.font = `12px ${this.colours.font}`;
    g.textAlign = "left";
    g.textBaseline = "middle";
    g.lineWidth = 1;
    const place = (mark) => Math.round(left + wide * (1 - (now - mark.t) / WINDOW_S)) + 0.5;
    let free = left;
    for (let i = 0; i < this.marks.length; i++) {
      const { text } = this.marks[i];
      const x = place(this.marks[i]);
      if (x < left || x > left + wide) continue;
      g.strokeStyle = this.colours.muted;
      g.setLineDash([3, 3]);
      g.beginPath();
      g.moveTo(x, GUTTER.top);
      g.lineTo(x, bottom);
      g.stroke();
      g.setLineDash([]);
      // A name is to the right of its line, or to the left where the next line is too close; without room it is left out.
      const long = g.measureText(text).width + NAME_GAP;
      const next = i + 1 < this.marks.length ? place(this.marks[i + 1]) : left + wide;
      g.fillStyle = this.colours.muted;
      if (x + long <= next) g.fillText(text, x + 4, between);
      else if (x - long >= free) g.fillText(text, x - long + NAME_GAP - 4, between);
      free = x + long <= next ? x + long : x;
    }
  }
}

/**
 * Draws a quantity with its extremes, one column of pixels after the other. Columns are fixed in time and scroll as a
 * whole, so that the line does not shimmer.
 */
function columns(g, trace, lows, highs, from, now, left, wide, range, top, high) {
  const perSecond = wide / WINDOW_S;
  const y = (value) => top + (high * (range.high - value)) / (range.high - range.low);
  const x = (column) => left + wide - (now * perSecond - column);
  let column = NaN;
  let low = 0;
  let peak = 0;
  let last = -Infinity;
  let rising = true;
  let drawing = false;
  const flush = () => {
    if (Number.isNaN(column)) return;
    const at = x(column);
    const first = rising ? low : peak;
    const second = rising ? peak : low;
    if (drawing) g.lineTo(at, y(first));
    else g.moveTo(at, y(first));
    if (second !== first) g.lineTo(at, y(second));
    drawing = true;
  };
  g.beginPath();
  g.lineJoin = "round";
  for (let i = from; i < trace.end; i++) {
    const slot = i % lows.length;
    const bottom = lows[slot];
    if (Number.isNaN(bottom)) continue;
    const t = trace.t[slot];
    const here = Math.floor(t * perSecond);
    if (here !== column) {
      flush();
      if (t - last > GAP_S) drawing = false;
      rising = Number.isNaN(column) || bottom >= low;
      column = here;
      low = bottom;
      peak = highs[slot];
    } else {
      low = Math.min(low, bottom);
      peak = Math.max(peak, highs[slot]);
    }
    last = t;
  }
  flush();
  g.stroke();
}

export class PhasePlot extends Plot {
  draw(trace, now) {
    const { context: g, width, height } = this.surface;
    const from = this.begin(trace, now);
    extremes(trace, trace.lawLow, trace.lawHigh, from, this.found);
    this.force.cover(this.found.low, this.found.high);
    const box = { left: GUTTER.left, top: GUTTER.top, wide: width - GUTTER.left - 14, high: height - GUTTER.top - 40 };
    const x = (mm) => box.left + (box.wide * (mm - this.depth.low)) / (this.depth.high - this.depth.low);
    const y = (n) => box.top + (box.high * (this.force.high - n)) / (this.force.high - this.force.low);
    this.axes(g, box, x, y, height);
    g.lineWidth = 2;
    g.lineJoin = "round";
    g.strokeStyle = this.colours.force;
    g.beginPath();
    for (let step = 0; step < FADE_STEPS; step++) {
      const begin = trace.firstSince(now - WINDOW_S * (1 - step / FADE_STEPS));
      const end = step + 1 < FADE_STEPS ? trace.firstSince(now - WINDOW_S * (1 - (step + 1) / FADE_STEPS)) + 1 : trace.end;
      g.globalAlpha = 0.12 + (0.88 * (step + 1)) / FADE_STEPS;
      this.path(g, trace, begin, Math.min(end, trace.end), x, y);
    }
    g.globalAlpha = 1;
    if (trace.end > trace.begin) {
      const newest = (trace.end - 1) % trace.t.length;
      g.beginPath();
      g.arc(x(trace.depthHigh[newest]), y(trace.lawHigh[newest]), 5, 0, 2 * Math.PI);
      g.fillStyle = this.colours.force;
      g.fill();
    }
  }

  path(g, trace, begin, end, x, y) {
    g.beginPath();
    let last = -Infinity;
    for (let i = begin; i < end; i++) {
      const at = i % trace.t.length;
      const force = (trace.lawLow[at] + trace.lawHigh[at]) / 2;
      if (Number.isNaN(force)) continue;
      const depth = (trace.depthLow[at] + trace.depthHigh[at]) / 2;
      if (trace.t[at] - last > GAP_S) g.moveTo(x(depth), y(force));
      else g.lineTo(x(depth), y(force));
      last = trace.t[at];
    }
    g.stroke();
  }

  axes(g, box, x, y, height) {
    g.font = `12px ${this.colours.font}`;
    g.lineWidth = 1;
    const rule = (value, x1, y1, x2, y2) => {
      g.strokeStyle = value === 0 ? this.colours.muted : this.colours.grid;
      g.beginPath();
      g.moveTo(x1, y1);
      g.lineTo(x2, y2);
      g.stroke();
      g.fillStyle = this.colours.muted;
    };
    g.textAlign = "right";
    g.textBaseline = "middle";
    ticks(this.force, box.high / 26, (n) => {
      const at = Math.round(y(n)) + 0.5;
      rule(n, box.left, at, box.left + box.wide, at);
      g.fillText(label(n, this.force.step), box.left - 6, at);
    });
    g.textAlign = "center";
    g.textBaseline = "top";
    ticks(this.depth, box.wide / 40, (mm) => {
      const at = Math.round(x(mm)) + 0.5;
      rule(mm, at, box.top, at, box.top + box.high);
      g.fillText(label(mm, this.depth.step), at, box.top + box.high + 5);
    });
    g.font = `600 12px ${this.colours.font}`;
    g.fillStyle = this.colours.depth;
    g.textBaseline = "bottom";
    g.fillText(t("plot.depth"), box.left + box.wide / 2, height - 1);
    g.save();
    g.translate(12, box.top + box.high / 2);
    g.rotate(-Math.PI / 2);
    g.textBaseline = "middle";
    g.fillStyle = this.colours.force;
    g.fillText(t("plot.force"), 0, 0);
    g.restore();
  }
}
