// The guide's page: says what comes next, and begins a step when the person says so. The program does the work and waits for it.
// What it says stands in host-sim/server/src/guide.rs.

import { Link } from "./link.js";

const byId = (id) => document.getElementById(id);
const GOING = { hand: "Do it now; the device watches until you are done.", motor: "The motor moves: hands off." };
let left = false;
let ended = false;

function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function follow(message) {
  if (message.type !== "guide") return;
  write(byId("title"), message.title);
  write(byId("subtitle"), message.device === "virtual" ? "virtual device" : message.device);
  document.title = message.title;
  if (message.reading) {
    write(byId("counts"), String(message.reading.counts));
    write(byId("tilt"), message.reading.tilt_deg.toFixed(1));
  }
  message.steps.forEach((step, i) => show(byId("steps").children[i] ?? add(i + 1), step));
  if (message.end && !ended) end(message.end);
}

function add(number) {
  const item = byId("step").content.firstElementChild.cloneNode(true);
  item.querySelector("button").addEventListener("click", () => link.send({ do: "begin", step: number }));
  byId("steps").append(item);
  return item;
}

function show(item, { text, moves, stage }) {
  write(item.querySelector(".text"), text);
  write(item.querySelector(".going"), moves ? GOING.motor : GOING.hand);
  item.toggleAttribute("data-moves", moves);
  if (item.dataset.stage === stage) return;
  item.dataset.stage = stage;
  if (stage !== "done") item.scrollIntoView({ block: "nearest" });
  if (stage === "asked") item.querySelector("button").focus({ preventScroll: true });
}

function end({ well, lines }) {
  ended = true;
  const section = byId("end");
  section.hidden = false;
  section.toggleAttribute("data-well", well);
  write(section.querySelector("h2"), well ? "Done" : "Not done");
  section.querySelector("ul").replaceChildren(...lines.map((line) => Object.assign(document.createElement("li"), { textContent: line })));
  write(byId("leave"), "Close");
  byId("leave").scrollIntoView({ block: "nearest" });
}

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
  write(banner, left || ended ? "The program has ended; you can close this page." : "Program unreachable. Reconnecting.");
}, 250);
