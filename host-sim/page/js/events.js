// What has happened, in words, newest first.

import { capital, count, number, said, t, taskName, tissueName } from "./language.js";

const LONGEST_LIST = 80;

/** " at 3.0 mm, 1.0 N", as much of it as is known. */
function where(event, withForce) {
  const parts = [];
  if (event.depth_mm !== null) parts.push(`${number(event.depth_mm, 1)}\u00a0mm`);
  if (withForce && event.force_n !== null) parts.push(`${number(event.force_n, 2)}\u00a0N`);
  return parts.length ? t("event.at", { what: parts.join(t("event.and")) }) : "";
}

/** An event as a person would say it; null for one that is shown elsewhere. */
export function words(event, layers) {
  const layer = layers[event.layer];
  const name = tissueName(layer?.structure ?? layer?.name ?? "layer");
  switch (event.kind) {
    case "contact": return capital(t("event.contact", { name, where: where(event, false) }));
    case "puncture": if (layer?.structure === "artery") return t("event.artery", { where: where(event, true) });
      return capital(t("event.puncture", { name, where: where(event, true) }));
    case "flashback": return t("event.flashback");
    case "far_wall": return t("event.far_wall");
    case "in_track": return capital(t("event.in_track", { name }));
    case "barrier": return t("event.barrier");
    case "vessel": return t("event.vessel", { name }); // comes with its puncture
    case "task": return capital(taskName(event.name));
    case "exit": return capital(t("event.exit", { name }));
    case "fault": return t("event.fault", { cause: said(event.cause) });
    case "not_saved": return capital(said(event.cause));
    case "cleared": return t("event.cleared");
    case "heat_unknown": return t("event.heat_unknown", { seconds: count(event.ends_in_s) });
    case "started": return t("event.started");
    case "stopped": return t("event.stopped");
    default: return null; // limits have lamps
  }
}

/** Seconds of the device's clock as minutes and seconds. */
export function clock(seconds) {
  const minutes = Math.floor(seconds / 60);
  return `${minutes}:${number(seconds - 60 * minutes, 1).padStart(4, "0")}`;
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
