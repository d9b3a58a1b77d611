// A recording's place in time: shown, dragged, and stepped with the arrow keys.

import { clock } from "./events.js";
import { Slider } from "./slider.js";

export class Scrub {
  /**
   * @param {import("./link.js").Link} link where wishes go
   */
  constructor(link) {
    this.row = document.getElementById("scrub");
    this.place = document.getElementById("scrub-place");
    this.time = document.getElementById("scrub-time");
    this.length = document.getElementById("scrub-length");
    this.playing = true;
    this.drag = new Slider(
      this.place,
      (seconds) => this.say(seconds),
      (seconds) => link.send({ do: "seek", at_s: seconds }),
    );
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
    if (this.drag.isHeld) return;
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
    this.drag.tell();
  }
}
