// What has happened, in words, newest first.

import { number } from "./panel.js";
import { taskWords } from "./tasks.js";

const LONGEST_LIST = 80;

const article = (name) => `the ${name}`;
const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** " at 3.0 mm, 1.0 N", as much of it as is known. */
function where(event, withForce) {
  const parts = [];
  if (event.depth_mm !== null) parts.push(`${number(event.depth_mm, 1)}\u00a0mm`);
  if (withForce && event.force_n !== null) parts.push(`${number(event.force_n, 2)}\u00a0N`);
  return parts.length ? ` at ${parts.join(", ")}` : "";
}

/** An event as a person would say it; null for one that is shown elsewhere. */
export function words(event, layers) {
  const name = layers[event.layer]?.name ?? "layer";
  switch (event.kind) {
    case "contact": return `Tip touches ${article(name)}${where(event, false)}`;
    case "puncture": return `${capital(name)} punctured${where(event, true)}`;
    case "flashback": return "Flashback: blood shows in the hub";
    case "far_wall": return "Through the far wall of the vessel";
    case "in_track": return `Through ${article(name)} in the needle's own track`;
    case "barrier": return "Turned further than the tissue allows";
    case "vessel": return `Needle in ${article(name)}`; // comes with its puncture
    case "task": return taskWords(event.name);
    case "exit": return `Needle out of ${article(name)}`;
    case "fault": return `Fault, torque off: ${event.cause}`;
    case "not_saved": return capital(event.cause);
    case "started": return "Started, torque fades in";
    case "stopped": return "Stopped, torque off";
    default: return null; // limits have lamps
  }
}

/** Seconds of the device's clock as minutes and seconds. */
export function clock(t) {
  const minutes = Math.floor(t / 60);
  return `${minutes}:${(t - 60 * minutes).toFixed(1).padStart(4, "0")}`;
}

export class EventList {
  constructor(list) {
    this.list = list;
  }

  clear() {
    this.list.replaceChildren();
  }

  add(event, layers) {
    const text = words(event, layers);
    if (text === null) return;
    const item = document.createElement("li");
    item.dataset.kind = event.kind;
    const time = document.createElement("time");
    time.textContent = clock(event.t_s);
    const what = document.createElement("span");
    what.textContent = text;
    item.append(time, what);
    this.list.prepend(item);
    if (this.list.childElementCount > LONGEST_LIST) this.list.lastElementChild.remove();
  }
}
