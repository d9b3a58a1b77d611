// A recording's place in time: shown, dragged, and stepped with the arrow keys.

import { clock } from "./events.js";

/** What the server says of the place just after a drag is still the old one. */
const NEWS_MS = 400;
/** Between two wishes while the slider is dragged. */
const STEP_MS = 60;

export class Scrub {
  /**
   * @param {import("./link.js").Link} link where wishes go
   */
  constructor(link) {
    this.link = link;
    this.row = document.getElementById("scrub");
    this.place = document.getElementById("scrub-place");
    this.time = document.getElementById("scrub-time");
    this.length = document.getElementById("scrub-length");
    this.movedAt = -Infinity;
    this.sentAt = -Infinity;
    this.unsent = false;
    this.playing = true;
    this.place.addEventListener("input", () => {
      this.movedAt = performance.now();
      this.unsent = true;
      this.say(Number(this.place.value));
    });
  }

  /** Follows the server: `replay` is null where nothing is replayed. */
  follow(replay) {
    if (this.row.hidden !== !replay) this.row.hidden = !replay;
    this.playing = replay?.playing ?? true;
    if (!replay) return;
    if (this.place.max !== String(replay.length_s)) {
      this.place.max = String(replay.length_s);
      this.length.textContent = clock(replay.length_s);
    }
    if (performance.now() - this.movedAt < NEWS_MS) return;
    this.place.value = String(replay.at_s);
    this.say(replay.at_s);
  }

  say(seconds) {
    const text = clock(seconds);
    if (this.time.textContent !== text) this.time.textContent = text;
    this.place.setAttribute("aria-valuetext", text);
  }

  /** Called before each picture: many movements become one message. */
  tell() {
    const now = performance.now();
    if (!this.unsent || now - this.sentAt < STEP_MS) return;
    this.unsent = false;
    this.sentAt = now;
    this.link.send({ do: "seek", at_s: Number(this.place.value) });
  }
}
