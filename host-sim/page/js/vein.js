// What a trainee's steps do to the vein in the picture: it fills behind a tourniquet, takes up a catheter, and bleeds into the tissue
// through a hole in its far wall. Lengths are mm in the section; the force knows nothing of it.

/** Height of a vein without the tourniquet that it is to have, as a share of the patient's; the time in which it fills. Both are
 *  assumptions: veins widen by a fifth to a half. */
const FLAT = 0.7;
const FILLS_S = 0.6;
/** A catheter's wall, its end behind the needle's tip, and the time in which it is slid in: an assumption. */
const CATHETER_WALL_MM = 0.1;
const BEHIND_TIP_MM = 1;
const SLIDES_S = 0.6;
/** A haematoma grows to this radius with this time constant: assumptions. */
const HAEMATOMA_MM = 4;
const BLEEDS_S = 6;
/** So much of a catheter is drawn above the skin. */
const OUTSIDE_MM = 0.5;
const STEP_MM = 0.5;

export class Vein {
  constructor() {
    /** Height of the vein as a share of the patient's. */
    this.height = 1;
    this.wanted = 1;
    /** The points of a catheter that has been slid in, from the skin inwards, and how much of it is in, mm. */
    this.catheter = null;
    this.inserted = 0;
    this.hasCatheter = false;
    this.wasIn = false;
    /** The place and the radius of each haematoma. */
    this.bleeding = [];
  }

  /** Follows the goal's steps, `{ step, state }`: those of a vein that is to have a tourniquet or a catheter. */
  follow(steps) {
    const state = Object.fromEntries(steps.map(({ step, state }) => [step, state]));
    const on = state.tourniquet_on === "done" && state.tourniquet_off !== "done";
    this.wanted = "tourniquet_on" in state && !on ? FLAT : 1;
    this.hasCatheter = "catheter" in state;
    this.isIn = state.catheter === "done";
    // The next one begins.
    if (on && !this.isIn) this.catheter = null;
  }

  /** Follows an event of the device, with the tissue as it is then. */
  happen(event, tissue) {
    const layer = tissue.layers[event.layer];
    if (event.kind === "contact" && event.layer === 0) {
      this.catheter = null;
      this.bleeding.length = 0;
    }
    const isHole = event.kind === "far_wall" || (event.kind === "puncture" && layer?.structure === "artery");
    if (isHole && layer) this.bleeding.push({ along: layer.along, place: null, radius: 0 });
  }

  /** Moves time on; `axis` is the needle's, `depth` its tip's. */
  move(seconds, axis, depth, tissue) {
    this.height += (1 - Math.exp(-seconds / FILLS_S)) * (this.wanted - this.height);
    for (const one of this.bleeding) {
      one.place ??= [axis.fromX + one.along * axis.x, axis.fromY + one.along * axis.y];
      one.radius += (1 - Math.exp(-seconds / BLEEDS_S)) * (HAEMATOMA_MM - one.radius);
    }
    const whole = tissue.needle.length_mm;
    if (this.isIn && !this.wasIn) {
      const hub = -axis.fromY / Math.max(axis.y, 0.1) - OUTSIDE_MM;
      this.inserted = depth - hub - tissue.needle.bevel_mm - BEHIND_TIP_MM;
      this.catheter = way(axis, hub, depth, tissue);
    }
    this.wasIn = this.isIn;
    if (this.catheter) this.inserted = Math.min(whole, this.inserted + (whole * seconds) / SLIDES_S);
  }

  /** Draws what has bled into the tissue below the hole. */
  drawBlood(g, section) {
    for (const { place, radius } of this.bleeding) {
      if (!place) continue;
      g.beginPath();
      g.ellipse(section.x(place[0]), section.y(place[1]), radius * section.scale, 0.7 * radius * section.scale, 0, 0, Math.PI);
      g.fillStyle = section.colours.haematoma;
      g.fill();
    }
  }

  /** Draws the catheter: on its needle, behind the tip, until it is slid in; then along the vein. */
  drawCatheter(g, section, depth, { needle }) {
    if (!this.hasCatheter && !this.catheter) return;
    const { x, y, fromX, fromY } = section.axis;
    const middle = -needle.diameter_mm / 2;
    const point = (mm) => [fromX + mm * x - middle * y, fromY + mm * y + middle * x];
    const points = this.catheter ? beginning(this.catheter, this.inserted) : [point(depth - needle.length_mm), point(depth - needle.bevel_mm - BEHIND_TIP_MM)];
    g.beginPath();
    for (const [i, [px, py]] of points.entries()) g[i ? "lineTo" : "moveTo"](section.x(px), section.y(py));
    g.lineCap = "butt";
    g.lineJoin = "round";
    g.strokeStyle = section.colours.catheter;
    g.lineWidth = (needle.diameter_mm + 2 * CATHETER_WALL_MM) * section.scale;
    g.stroke();
  }
}

/** The way of a catheter, as long as its needle, from its `hub`: along the needle to the tip at `depth`, then bent to the middle of the
 *  vein; both mm along the needle. */
function way(axis, hub, depth, tissue) {
  // In the middle of the cannula, whose lower edge is the needle's line.
  const half = tissue.needle.diameter_mm / 2;
  const point = (mm) => [axis.fromX + mm * axis.x + half * axis.y, axis.fromY + mm * axis.y - half * axis.x];
  const points = [point(hub), point(depth)];
  const slope = axis.y / Math.max(axis.x, 0.1);
  for (let mm = depth + STEP_MM; mm <= hub + tissue.needle.length_mm; mm += STEP_MM) {
    const [x, y] = points.at(-1);
    const wanted = middleOfVein(tissue, x + STEP_MM, y) ?? y + slope * STEP_MM;
    points.push([x + STEP_MM, y + Math.min(slope * STEP_MM, Math.max(-slope * STEP_MM, wanted - y))]);
  }
  return points;
}

/** The part of a line of points that is not longer than `length`. */
function beginning(points, length) {
  const part = [points[0]];
  let left = length;
  for (let i = 1; i < points.length && left > 0; i++) {
    const [[x0, y0], [x1, y1]] = [points[i - 1], points[i]];
    const step = Math.hypot(x1 - x0, y1 - y0);
    const share = Math.min(1, left / step);
    part.push([x0 + share * (x1 - x0), y0 + share * (y1 - y0)]);
    left -= step;
  }
  return part;
}

/** The middle of the vein at `x` along the skin, the one that is nearest to the depth `near`; null where there is none. */
export function middleOfVein(tissue, x, near) {
  if (tissue.vessel) return tissue.vessel.axis_mm;
  const middles = [];
  for (const { tissue: kind, points_mm: points } of tissue.outlines ?? []) {
    if (kind !== "vessel") continue;
    const crossed = [];
    for (const [i, [x1, y1]] of points.entries()) {
      const [x0, y0] = points.at(i - 1);
      if (x0 <= x !== x1 <= x) crossed.push(y0 + ((x - x0) / (x1 - x0)) * (y1 - y0));
    }
    crossed.sort((a, b) => a - b);
    for (let i = 1; i < crossed.length; i += 2) middles.push((crossed[i - 1] + crossed[i]) / 2);
  }
  const distance = (y) => Math.abs(y - near);
  return middles.length ? middles.reduce((best, y) => (distance(y) < distance(best) ? y : best)) : null;
}
