// The slider of a device's compensation: how much of its own forces is taken away, while a hand feels it.

/** What the server says of the share just after a drag is still the old one. */
const NEWS_MS = 400;
/** Between two wishes while the slider is dragged. */
const STEP_MS = 60;

export class OwnForces {
  /** @param {import("./link.js").Link} link where wishes go */
  constructor(link) {
    this.link = link;
    this.box = document.getElementById("own-forces");
    this.slider = document.getElementById("own-share");
    this.value = document.getElementById("own-value");
    this.movedAt = -Infinity;
    this.sentAt = -Infinity;
    this.unsent = false;
    this.slider.addEventListener("input", () => {
      this.movedAt = performance.now();
      this.unsent = true;
      this.say(Number(this.slider.value));
    });
  }

  /** Follows the server: `share` from 0 to 1, null where the device compensates nothing. */
  follow(share) {
    const none = share === null || share === undefined;
    if (this.box.hidden !== none) this.box.hidden = none;
    if (none || performance.now() - this.movedAt < NEWS_MS) return;
    const percent = Math.round(share * 100);
    if (this.slider.value !== String(percent)) this.slider.value = String(percent);
    this.say(percent);
  }

  say(percent) {
    const text = percent === 0 ? "off" : `${percent} %`;
    if (this.value.textContent !== text) this.value.textContent = text;
    this.slider.setAttribute("aria-valuetext", text);
  }

  /** Called before each picture: many movements become one message. */
  tell() {
    const now = performance.now();
    if (!this.unsent || now - this.sentAt < STEP_MS) return;
    this.unsent = false;
    this.sentAt = now;
    this.link.send({ do: "compensate", share: Number(this.slider.value) / 100 });
  }
}
