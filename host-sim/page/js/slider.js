// A slider that the server moves as well: what a hand sets goes out a few times a second, and what the server says of it is left alone
// while it is being dragged.

/** The time after a drag for which the server's value is still the old one. */
const NEWS_MS = 400;
/** Between two wishes while the slider is dragged. */
const STEP_MS = 60;

export class Slider {
  /**
   * @param {HTMLInputElement} input its element
   * @param {(value: number) => void} say shows a value that a hand has set
   * @param {(value: number) => void} wish asks the server for it
   */
  constructor(input, say, wish) {
    this.input = input;
    this.wish = wish;
    this.movedAt = -Infinity;
    this.sentAt = -Infinity;
    this.unsent = false;
    input.addEventListener("input", () => {
      this.movedAt = performance.now();
      this.unsent = true;
      say(Number(input.value));
    });
  }

  /** True if a hand has just moved it. */
  get isHeld() {
    return performance.now() - this.movedAt < NEWS_MS;
  }

  /** Called before each picture: many movements become one message. */
  tell() {
    const now = performance.now();
    if (!this.unsent || now - this.sentAt < STEP_MS) return;
    this.unsent = false;
    this.sentAt = now;
    this.wish(Number(this.input.value));
  }
}
