// The needle in the section: cannula, bevel and hub to scale, what a person takes hold of, and the force in the hand. Its measures are
// the scene's, the same that the three-dimensional view and the ultrasound draw.

import { number } from "./language.js";

/** Length of the arrow for a force, mm. */
const MM_PER_N = 4;
/** The tip waits so far outside before an insertion, mm along the needle; pictures have room for it. */
export const WAITING_MM = -5;
/** The distance behind its front at which the hub has its full width, mm. */
export const HUB_CONE_MM = 2;
/** The chamber in the hub in which blood shows, mm behind its front. */
const CHAMBER_MM = { from: 3, to: 6 };

/** Length from the tip to the end of the hub, mm. */
export function wholeLength(needle) {
  return needle.length_mm + needle.hub_length_mm;
}

/** Distance of the hub's farther corner from the line through the tip, mm: the cannula's axis is a
 *  radius away from that line. */
export function halfHub(needle) {
  return (needle.hub_diameter_mm + needle.diameter_mm) / 2;
}

/** Draws the needle with its tip at the origin, x along it in CSS pixels, `scale` of them a millimetre; bevel up. */
export function drawNeedle(g, colours, scale, needle, { flashback, inLumen }) {
  const radius = (needle.diameter_mm / 2) * scale;
  const bevel = needle.bevel_mm * scale;
  const front = -needle.length_mm * scale;
  g.beginPath();
  g.moveTo(front, -2 * radius);
  g.lineTo(-bevel, -2 * radius);
  g.lineTo(0, 0);
  g.lineTo(front, 0);
  g.closePath();
  const steel = g.createLinearGradient(0, -2 * radius, 0, 0);
  steel.addColorStop(0, colours.steel);
  steel.addColorStop(0.35, colours["steel-light"]);
  steel.addColorStop(1, colours["steel-dark"]);
  g.fillStyle = steel;
  g.fill();
  g.strokeStyle = colours["steel-dark"];
  g.lineWidth = 1;
  g.stroke();
  // The ground face and its opening; blood shows in it once the vessel is entered.
  g.beginPath();
  g.ellipse(-0.55 * bevel, -1.12 * radius, 0.34 * bevel, 0.34 * radius, Math.atan2(2 * radius, bevel), 0, 2 * Math.PI);
  g.fillStyle = inLumen ? colours.lumen : colours["steel-dark"];
  g.fill();
  hub(g, colours, scale, needle, -radius);
  g.fillStyle = colours.grip;
  g.fill();
  g.strokeStyle = colours.panel;
  g.lineWidth = 1.5;
  g.stroke();
  // The chamber: clear until blood has come into it.
  const high = 0.55 * needle.hub_diameter_mm * scale;
  g.beginPath();
  g.roundRect(front - CHAMBER_MM.to * scale, -radius - high / 2, (CHAMBER_MM.to - CHAMBER_MM.from) * scale, high, 0.3 * high);
  g.fillStyle = flashback ? colours.lumen : colours.sky;
  g.fill();
  g.stroke();
}

/** Draws the hub at its target position, `ahead` mm in front of its present one. */
export function drawWish(g, colours, scale, needle, ahead) {
  g.save();
  g.translate(ahead * scale, 0);
  hub(g, colours, scale, needle, (-needle.diameter_mm / 2) * scale);
  g.strokeStyle = colours.grip;
  g.lineWidth = 2;
  g.setLineDash([4, 3]);
  g.stroke();
  g.restore();
}

/** Draws the outline of another insertion's needle at this time, `ahead` mm in front of this one. */
export function drawGhost(g, colours, scale, needle, ahead, name) {
  g.save();
  g.translate(ahead * scale, 0);
  g.globalAlpha = 0.6;
  g.strokeStyle = colours.muted;
  g.lineWidth = 1.5;
  g.setLineDash([2, 3]);
  hub(g, colours, scale, needle, (-needle.diameter_mm / 2) * scale);
  g.moveTo(-needle.length_mm * scale, -needle.diameter_mm * scale);
  g.lineTo(-needle.bevel_mm * scale, -needle.diameter_mm * scale);
  g.lineTo(0, 0);
  g.lineTo(-needle.length_mm * scale, 0);
  g.stroke();
  g.fillStyle = colours.text;
  g.font = `12px ${colours.font}`;
  g.textAlign = "left";
  g.textBaseline = "top";
  g.fillText(name, -needle.length_mm * scale, (needle.hub_diameter_mm / 2) * scale);
  g.restore();
}

/** The outline of the hub, a cone and a barrel, about the cannula's axis at `y`. */
function hub(g, colours, scale, needle, y) {
  const front = -needle.length_mm * scale;
  const back = front - needle.hub_length_mm * scale;
  const full = front - HUB_CONE_MM * scale;
  const half = (needle.hub_diameter_mm / 2) * scale;
  const thin = (needle.diameter_mm / 2) * scale;
  g.beginPath();
  g.moveTo(front, y - thin);
  g.lineTo(full, y - half);
  g.lineTo(back, y - half);
  g.lineTo(back, y + half);
  g.lineTo(full, y + half);
  g.lineTo(front, y + thin);
  g.closePath();
}

/** The force in the hand, above the hub: against insertion up the needle, against withdrawal down it. */
export function drawForce(g, colours, scale, needle, force) {
  if (Math.abs(force) < 0.005) return;
  const length = force * MM_PER_N * scale;
  const y = -(needle.hub_diameter_mm / 2 + 1.2) * scale;
  const tail = -(needle.length_mm - 5) * scale;
  g.save();
  g.translate(tail, y);
  g.lineJoin = "round";
  g.lineCap = "round";
  // A small force has a small head, so that it still looks like an arrow.
  const head = Math.sign(length) * Math.min(10, 0.6 * Math.abs(length));
  const half = Math.max(2.5, 0.6 * Math.abs(head));
  const arrow = () => {
    g.beginPath();
    g.moveTo(0, -5);
    g.lineTo(0, 5);
    if (Math.abs(length) > 2) {
      g.moveTo(0, 0);
      g.lineTo(-length, 0);
      g.moveTo(head - length, -half);
      g.lineTo(-length, 0);
      g.lineTo(head - length, half);
    }
    g.stroke();
  };
  for (const [colour, width] of [[colours.panel, 6], [colours.force, 2.5]]) {
    g.strokeStyle = colour;
    g.lineWidth = width;
    arrow();
  }
  g.font = `600 14px ${colours.font}`;
  g.textAlign = "left";
  g.textBaseline = "middle";
  const at = (length < 0 ? -length : 0) + 10;
  g.strokeStyle = colours.panel;
  g.lineWidth = 5;
  const text = `${number(force, 2)} N`;
  g.strokeText(text, at, 0);
  g.fillStyle = colours.force;
  g.fillText(text, at, 0);
  g.restore();
}
