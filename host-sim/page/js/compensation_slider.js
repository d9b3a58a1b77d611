// The slider of a device's compensation: how much of its own forces is taken away, while a hand feels it.

import { t } from "./language.js";
import { Slider } from "./slider.js";

export class CompensationSlider {
  /** @param {import("./link.js").Link} link where wishes go */
  constructor(link) {
    this.box = document.getElementById("own-forces");
    this.slider = document.getElementById("own-share");
    this.value = document.getElementById("own-value");
    this.drag = new Slider(
      this.slider,
      (percent) => this.say(percent),
      (percent) => link.send({ do: "compensate", share: percent / 100 }),
    );
  }

  /** Follows the server: `share` from 0 to 1, null where the device compensates nothing. */
  follow(share) {
    const none = share === null || share === undefined;
    if (this.box.hidden !== none) this.box.hidden = none;
    if (none || this.drag.isHeld) return;
    const percent = Math.round(share * 100);
    if (this.slider.value !== String(percent)) this.slider.value = String(percent);
    this.say(percent);
  }

  say(percent) {
    const text = percent === 0 ? t("reading.off") : `${percent} %`;
    if (this.value.textContent !== text) this.value.textContent = text;
    this.slider.setAttribute("aria-valuetext", text);
  }

  /** Called before each picture: many movements become one message. */
  tell() {
    this.drag.tell();
  }
}
