// The learning curve as a cumulative sum (Kestin, Br J Anaesth 1995; 75:805–809): each attempt that misses raises it, each that reaches
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

/** The sum after each attempt, and after how many the pass mark was reached (0: not yet). */
export function cumulativeSum(reached) {
  let [sum, highest, passedAfter] = [0, 0, 0];
  const sums = reached.map((one, i) => {
    sum += one ? -STEP : 1 - STEP;
    highest = Math.max(highest, sum);
    if (!passedAfter && sum <= highest - PASS) passedAfter = i + 1;
    return sum;
  });
  return { sums, mark: highest - PASS, passedAfter };
}

export class LearningCurve {
  constructor(canvas, colours) {
    this.surface = surface(canvas);
    this.colours = colours;
    new ResizeObserver(() => this.draw(this.attempts)).observe(canvas);
    // After the colours have been read anew.
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw(this.attempts));
    this.attempts = [];
  }

  draw(attempts) {
    this.attempts = attempts;
    const { context: g, width, height, canvas } = this.surface;
    const { sums, mark, passedAfter } = cumulativeSum(attempts.map((one) => one.figures.verdict.passed));
    const words = passedAfter ? t("practice.passed", { count: passedAfter }) : t("practice.not_passed", { count: attempts.length });
    canvas.setAttribute("aria-label", t("practice.curve_label", { words }));
    const [low, high] = [Math.min(mark, ...sums) - 0.3, Math.max(0, ...sums) + 0.3];
    const [left, right, top, bottom] = [6, width - 6, 18, height - 6];
    const x = (i) => left + ((right - left) * i) / Math.max(sums.length, 10);
    const y = (sum) => top + ((bottom - top) * (high - sum)) / (high - low);
    g.fillStyle = this.colours.panel;
    g.fillRect(0, 0, width, height);
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
    g.font = `12px ${this.colours.font}`;
    g.fillStyle = this.colours.muted;
    g.textBaseline = "top";
    g.textAlign = "left";
    const title = t("practice.curve_title", { words });
    g.fillText(left + g.measureText(title).width < right ? title : words, left, 2, right - left);
    g.textAlign = "right";
    g.textBaseline = "bottom";
    g.fillStyle = this.colours.depth;
    g.fillText(t("practice.pass_mark"), right, y(mark) - 2);
  }
}
