// The instructor's page: a card for each device, from the messages of the server. It sends nothing: nobody's torque is started here.
//
// What arrives was said by other computers: it is written as text and drawn as numbers, and a card that cannot be drawn says so.

import { colours } from "./canvas.js";
import { number } from "./language.js";
import { Link } from "./link.js";
import { Section } from "./section.js";
import { Tissue } from "./tissue.js";

const byId = (id) => document.getElementById(id);
const palette = colours();
const cards = new Map();

function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

class Card {
  constructor(name) {
    this.element = byId("card").content.firstElementChild.cloneNode(true);
    this.element.dataset.name = name;
    const find = (selector) => this.element.querySelector(selector);
    write(find("h2"), name);
    this.chip = find(".chip");
    this.reason = find(".reason");
    this.canvas = find("canvas");
    this.figures = Object.fromEntries([...this.element.querySelectorAll("[data-figure]")].map((part) => [part.dataset.figure, part]));
    this.section = null;
    this.scene = null;
    this.tissue = null;
    this.pose = null;
    this.told = -Infinity; // time of the last event drawn, s
  }

  /** The server's word. */
  follow(member) {
    if (member.scene) this.begin(member.scene);
    this.tell(member);
    // Of one who is gone the last is shown, and nothing of it is news.
    if (!member.pose || (member.gone && this.pose)) return;
    if (this.pose && member.pose.t_s < this.pose.t_s && this.scene) this.begin(this.scene);
    this.pose = member.pose;
    for (const event of member.events) {
      if (event.t_s > this.told) this.tissue?.happen(event);
    }
    this.told = Math.max(this.told, ...member.events.map((event) => event.t_s));
  }

  begin(scene) {
    this.scene = scene;
    this.tissue = new Tissue(scene);
    this.told = -Infinity;
  }

  tell(member) {
    const [state, words, tone] = condition(member);
    this.element.dataset.state = state;
    this.chip.dataset.tone = tone;
    write(this.chip.lastElementChild, words);
    write(this.reason, member.gone ? "" : member.stuck ?? "");
    const { score, pose } = member;
    const last = score.last;
    const figures = {
      depth: pose ? `${number(pose.depth_mm, 1)} mm` : "–",
      force: pose ? `${number(pose.motor_n, 2)} N` : "–",
      insertions: String(score.insertions),
      passed: String(score.passed),
      goal: last?.verdict.goal ?? "–",
      reasons: last?.verdict.reasons.map((reason) => reason.words).join("; ") || "–",
      last: last ? `${number(last.time_s, 1)} s, ${number(last.peak_force_n, 2)} N` : "–",
      patient: this.scene ? `Patient ${this.scene.profile}` : "",
      recording: member.recording ? "Recording" : "Not recording",
    };
    for (const [name, text] of Object.entries(figures)) write(this.figures[name], text);
    this.canvas.setAttribute("aria-label", `Needle of ${member.name}, ${figures.depth} deep`);
  }

  /** The same section as the trainee's own page, smaller. */
  draw(seconds) {
    if (!this.pose || !this.tissue) return;
    const { depth_mm: depth, angle_rad: angle, force_n: force, motor_n: motor, vessel } = this.pose;
    this.section ??= new Section(this.canvas, palette, true);
    this.tissue.move(depth, angle, force, vessel, seconds);
    this.section.draw({ depth, angle, force, motor, seconds, hand: 0, person: false, ghost: NaN }, this.tissue);
  }
}

/** Returns a card's title, in words, and its tone. */
function condition(member) {
  if (member.gone) return ["gone", `Gone for ${Math.floor(member.silent_s)} s`, "off"];
  if (!member.connected) return ["stuck", "Device silent", "warn"];
  if (member.stuck?.startsWith("fault")) return ["fault", "Fault", "bad"];
  if (member.stuck) return ["stuck", "Stuck", "warn"];
  return ["here", "Here", "good"];
}

function receive(message) {
  if (message.type !== "class") return;
  write(byId("class-name"), `Class ${message.name}`);
  document.title = `Class ${message.name}`;
  write(byId("subtitle"), `Devices join with run --class ${message.name} --class-at ${message.address}`);
  const count = { here: 0, stuck: 0, gone: 0 };
  for (const member of message.members) {
    let card = cards.get(member.name);
    if (!card) {
      card = new Card(member.name);
      cards.set(member.name, card);
      byId("cards").append(card.element);
    }
    attempt(card, () => card.follow(member));
    const [state] = condition(member);
    count[state === "fault" ? "stuck" : state] += 1;
  }
  byId("nobody").hidden = message.members.length > 0;
  write(byId("here"), `${count.here + count.stuck} here`);
  write(byId("stuck"), `${count.stuck} stuck`);
  write(byId("gone"), `${count.gone} gone`);
  byId("stuck-chip").dataset.tone = count.stuck ? "warn" : "off";
  byId("gone-chip").dataset.tone = count.gone ? "warn" : "off";
}

/** One device that says nonsense must not cost the others their cards. */
function attempt(card, what) {
  try {
    what();
  } catch {
    write(card.reason, "The page does not understand this device's messages: it may run another version.");
  }
}

const link = new Link(receive);
let lastDrawn = performance.now();

function draw(nowMs) {
  const seconds = Math.min(0.1, (nowMs - lastDrawn) / 1000);
  lastDrawn = nowMs;
  for (const card of cards.values()) attempt(card, () => card.draw(seconds));
  const here = link.open;
  document.body.dataset.link = here ? "live" : "lost";
  byId("banner").hidden = here;
  write(byId("banner"), here ? "" : "Program unreachable. Reconnecting.");
  requestAnimationFrame(draw);
}

requestAnimationFrame(draw);
