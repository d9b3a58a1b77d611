// The attempts as marks, and behind a click the learning curve as a cumulative sum (Kestin, Br J Anaesth 1995; 75:805–809): each attempt that misses raises it, each that reaches
// its goal lowers it. At the pass mark the rate of failure is the acceptable one and not the unacceptable one, at these rates of error.
// 20 % was found acceptable there for arterial cannulation; as there, twice as much is not.

import { surface } from "./canvas.js";
import { t } from "./language.js";

const ACCEPTABLE = 0.2;
const UNACCEPTABLE = 0.4;
const ERROR = 0.1;

const P = Math.log(UNACCEPTABLE / ACCEPTABLE);
const Q = Math.log((1 - ACCEPTABLE) / (1 - UNACCEPTABLE));
/** The amount by which a successful attempt lowers the sum; a failed one raises it by 1 less this. */
export const STEP = Q / (P + Q);
/** The distance below its highest value that the sum has to reach. */
export const PASS = Math.log((1 - ERROR) / ERROR) / (P + Q);

/** The sum after each attempt, after how many the pass mark was reached (0: not yet), and how many were reached in a row of how many
 *  that are wanted in a row to pass. */
export function cumulativeSum(reached) {
  let [sum, highest, passedAfter] = [0, 0, 0];
  const sums = reached.map((one, i) => {
    sum += one ? -STEP : 1 - STEP;
    highest = Math.max(highest, sum);
    if (!passedAfter && sum <= highest - PASS) passedAfter = i + 1;
    return sum;
  });
  const inARow = reached.length - 1 - reached.lastIndexOf(false);
  const missing = Math.max(0, Math.ceil((sum - (highest - PASS)) / STEP - 1e-9));
  return { sums, mark: highest - PASS, passedAfter, inARow, wanted: inARow + missing };
}

export class LearningCurve {
  constructor(canvas, colours) {
    this.surface = surface(canvas);
    this.colours = colours;
    new ResizeObserver(() => this.draw(this.attempts)).observe(canvas);
    // After the colours have been read anew.
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw(this.attempts));
    this.attempts = [];
    this.showsSum = false;
    canvas.addEventListener("click", () => this.toggle());
    canvas.addEventListener("keydown", (event) => ["Enter", " "].includes(event.key) && this.toggle(event));
  }

  toggle(event) {
    event?.preventDefault();
    event?.stopPropagation();
    this.showsSum = !this.showsSum;
    this.draw(this.attempts);
  }

  /** Attempts as marks, newest at the right, and in words how many in a row are still wanted; a click shows the sum. */
  draw(attempts) {
    this.attempts = attempts;
    const { context: g, width, height, canvas } = this.surface;
    const reached = attempts.map((one) => one.figures.verdict.passed);
    const sum = cumulativeSum(reached);
    const { inARow, wanted, passedAfter } = sum;
    const words = passedAfter ? t("practice.passed", { count: passedAfter }) : t("practice.in_a_row", { count: inARow, wanted });
    canvas.setAttribute("aria-label", t("practice.curve_label", { words }));
    canvas.dataset.words = words;
    g.fillStyle = this.colours.panel;
    g.fillRect(0, 0, width, height);
    g.font = `12px ${this.colours.font}`;
    g.fillStyle = this.colours.muted;
    g.textBaseline = "top";
    g.textAlign = "left";
    g.fillText(words, 6, 2, width - 12);
    // Where there is one line only, the marks follow the words.
    const [left, top] = height < 44 ? [14 + g.measureText(words).width, 0] : [6, 18];
    if (this.showsSum) this.sum(g, width, height, sum);
    else this.marks(g, width - 6 - left, (top + height) / 2, left, reached);
  }

  marks(g, width, y, left, reached) {
    const step = 18;
    const fit = Math.max(1, Math.floor(width / step));
    for (const [i, one] of reached.slice(-fit).entries()) {
      g.beginPath();
      g.arc(left + step * (i + 0.5), y, 6, 0, 2 * Math.PI);
      g.fillStyle = g.strokeStyle = one ? this.colours.good : this.colours.bad;
      g.lineWidth = 2;
      g.stroke();
      if (one) g.fill();
    }
  }

  sum(g, width, height, { sums, mark }) {
    const [low, high] = [Math.min(mark, ...sums) - 0.3, Math.max(0, ...sums) + 0.3];
    const [left, right, top, bottom] = [6, width - 6, 18, height - 6];
    const x = (i) => left + ((right - left) * i) / Math.max(sums.length, 10);
    const y = (sum) => top + ((bottom - top) * (high - sum)) / (high - low);
    const rule = (at, colour, dash) => {
      g.strokeStyle = colour;
      g.lineWidth = 1;
      g.setLineDash(dash);
      g.beginPath();
      g.moveTo(left, y(at));
      g.lineTo(right, y(at));
      g.stroke();
      g.setLineDash([]);
    };
    rule(0, this.colours.grid, []);
    rule(mark, this.colours.depth, [5, 4]);
    g.strokeStyle = this.colours.force;
    g.lineWidth = 2;
    g.beginPath();
    g.moveTo(x(0), y(0));
    sums.forEach((sum, i) => g.lineTo(x(i + 1), y(sum)));
    g.stroke();
    g.fillStyle = this.colours.muted;
    g.textAlign = "right";
    g.fillText(t("practice.sum"), right, 2, width / 2);
    g.textBaseline = "bottom";
    g.fillStyle = this.colours.depth;
    g.fillText(t("practice.pass_mark"), right, y(mark) - 2);
  }
}
