// The next step of the goal, in words and as a mark where it is to happen: the angles that it allows, the place that is to be reached,
// the way that is left. What a person does with a button is marked on the button.

import { said, t } from "./language.js";

/** A turn by more than this is the lowering, rad: as the verdict has it. */
const TURNED = Math.PI / 180;
const RING_MM = 1.4;
const FAN_MM = [7, 10];

export class NextStep {
  constructor() {
    this.forget();
  }

  forget() {
    /** Angle and depth of the needle when blood showed, and the depth when it began to turn. */
    this.entered = null;
    this.turnedAt = NaN;
  }

  /** Follows the needle. */
  follow({ angle, depth }, flashback) {
    if (!flashback) this.forget();
    else this.entered ??= { angle, depth };
    if (this.entered && Number.isNaN(this.turnedAt) && this.entered.angle - angle > TURNED) this.turnedAt = depth;
  }

  draw(g, section, view, tissue) {
    this.follow(view, tissue.flashback);
    const next = view.next;
    if (!next) return;
    g.font = `600 15px ${section.colours.font}`;
    g.textAlign = "left";
    g.textBaseline = "top";
    const words = t("section.next", { step: said(next.words) });
    g.globalAlpha = 0.85;
    g.fillStyle = section.colours.sky;
    g.fillRect(6, 8, g.measureText(words).width + 12, 24);
    g.globalAlpha = 1;
    g.fillStyle = section.colours.text;
    g.fillText(words, 12, 12);
    g.strokeStyle = g.fillStyle = section.colours.depth;
    g.lineWidth = 3;
    const radians = next.range?.map((degrees) => (degrees * Math.PI) / 180);
    if (next.step === "angle" && radians) fan(g, section, radians[0], radians[1]);
    if (next.step === "lower" && radians && this.entered) fan(g, section, this.entered.angle - radians[1], this.entered.angle - radians[0]);
    if (next.step === "advance" && radians && this.entered) {
      const from = Number.isNaN(this.turnedAt) ? this.entered.depth : this.turnedAt;
      along(g, section, tissue, from + next.range[0], from + next.range[1]);
    }
    if (["anchor", "enter", "reach"].includes(next.step)) ring(g, section, tissue);
  }
}

/** The angles at which the needle may be held, behind the entry. */
function fan(g, section, low, high) {
  const [x, y] = [section.x(section.axis.fromX), section.y(section.axis.fromY)];
  const [near, far] = FAN_MM.map((mm) => mm * section.scale);
  g.beginPath();
  g.arc(x, y, far, Math.PI + low, Math.PI + high);
  g.arc(x, y, near, Math.PI + high, Math.PI + low, true);
  g.closePath();
  g.globalAlpha = 0.25;
  g.fill();
  g.globalAlpha = 1;
  g.stroke();
}

/** The part of the needle's line in which the tip is to come to rest. */
function along(g, section, tissue, from, to) {
  g.save();
  section.alongNeedle(g, 0);
  const wide = 2 * tissue.needle.diameter_mm * section.scale;
  g.beginPath();
  g.roundRect(from * section.scale, -0.75 * wide, (to - from) * section.scale, wide, 4);
  g.globalAlpha = 0.25;
  g.fill();
  g.globalAlpha = 1;
  g.stroke();
  g.restore();
}

/** The place at which the needle's line meets the vessel or, without one, the deepest layer. */
function ring(g, section, tissue) {
  const layer = tissue.layers.find((one) => one.is_vessel) ?? tissue.layers.at(-1);
  if (!layer || !Number.isFinite(layer.along)) return;
  const { x, y, fromX, fromY } = section.axis;
  g.beginPath();
  g.arc(section.x(fromX + layer.along * x), section.y(fromY + layer.along * y), RING_MM * section.scale, 0, 2 * Math.PI);
  g.stroke();
}
