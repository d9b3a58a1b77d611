// The vessel cut across, at the top right of the section: an ellipse with its wall, the needle's
// tip in it or next to it, and the same in words.

import { t } from "./language.js";

const WORDS = {
  outside: "inset.outside", touching: "inset.touching", in_lumen: "inset.in_lumen", through: "inset.through", beside: "inset.beside",
};
const SHORT = { ...WORDS, outside: "inset.short_outside", touching: "inset.short_touching", through: "inset.short_through" };
const WORDS_HIGH = 22;

/** Draws it `wide` CSS pixels wide and at most `high` tall, with its right edge at `right`. */
export function drawInset(g, colours, { right, wide, high }, tissue, tipDepth, narrow) {
  const { vessel, needle } = tissue;
  const left = right - wide;
  const top = 8;
  const s = Math.min((0.5 * wide) / vessel.width_mm, (0.42 * high) / vessel.height_mm);
  const centre = { x: left + wide / 2, y: top + 0.44 * high };
  const tip = { x: centre.x - vessel.offset_mm * s, y: centre.y + (tipDepth - vessel.axis_mm) * s };
  g.save();
  g.beginPath();
  g.roundRect(left, top, wide, high, 8);
  g.clip();
  g.fillStyle = colours[tissue.around] ?? colours.other;
  g.fillRect(left, top, wide, high);
  g.beginPath();
  g.ellipse(centre.x, centre.y, (vessel.width_mm / 2) * s, ((tissue.vein.height * vessel.height_mm) / 2) * s, 0, 0, 2 * Math.PI);
  g.fillStyle = colours.lumen;
  g.fill();
  g.strokeStyle = colours["vessel-wall"];
  g.lineWidth = 3;
  g.stroke();
  g.beginPath();
  g.moveTo(tip.x, top);
  g.lineTo(tip.x, tip.y);
  g.strokeStyle = colours["steel-light"];
  g.lineWidth = needle.diameter_mm * s;
  if (tip.y > top) g.stroke();
  g.beginPath();
  g.arc(tip.x, tip.y, 4, 0, 2 * Math.PI);
  g.fillStyle = colours.grip;
  g.fill();
  g.fillStyle = colours.panel;
  g.fillRect(left, top + high - WORDS_HIGH, wide, WORDS_HIGH);
  g.fillStyle = colours.text;
  g.font = `600 12px ${colours.font}`;
  g.textAlign = "center";
  g.textBaseline = "middle";
  const words = (narrow ? SHORT : WORDS)[tissue.place];
  if (words) g.fillText(t(words), left + wide / 2, top + high - 10, wide - 6);
  g.restore();
  g.strokeStyle = colours.line;
  g.lineWidth = 1;
  g.beginPath();
  g.roundRect(left, top, wide, high, 8);
  g.stroke();
}
