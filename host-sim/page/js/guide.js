// The guide's page, which host-sim serves: the program does the work and waits for what is pressed here.

import { GuideSteps, write } from "./guide_steps.js";
import { Link } from "./link.js";

const byId = (id) => document.getElementById(id);
let left = false;

function follow(message) {
  if (message.type !== "guide") return;
  write(byId("title"), message.title);
  write(byId("subtitle"), message.device === "virtual" ? "virtual device" : message.device);
  document.title = message.title;
  if (message.reading) {
    write(byId("counts"), String(message.reading.counts));
    write(byId("tilt"), message.reading.tilt_deg.toFixed(1));
  }
  steps.follow(message);
}

const steps = new GuideSteps((message) => link.send(message));
const link = new Link(follow);
byId("leave").addEventListener("click", () => {
  if (link.send({ do: "leave" })) left = true;
});

setInterval(() => {
  const lost = link.condition === "lost";
  document.body.dataset.link = lost ? "lost" : "live";
  byId("leave").disabled = lost;
  const banner = byId("banner");
  banner.hidden = !lost;
  write(banner, left || steps.ended ? "The program has ended; you can close this page." : "Program unreachable. Reconnecting.");
}, 250);
