// The instructor's page: a card for each device, from the messages of the server. It sends nothing: nobody's torque is started here.
//
// What arrives was said by other computers: it is written as text and drawn as numbers, and a card that cannot be drawn says so.

import { colours } from "./canvas.js";
import { begin, count as whole, number, said, t, translate } from "./language.js";
import { Link } from "./link.js";
import { Section } from "./section.js";
import { Tissue } from "./tissue.js";

begin();

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
    translate(this.element);
    const find = (selector) => this.element.querySelector(selector);
    this.heading = find("h2");
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
    write(this.heading, member.trainee ? `${member.name} · ${member.trainee}` : member.name);
    this.chip.dataset.tone = tone;
    write(this.chip.lastElementChild, words);
    write(this.reason, member.gone ? "" : said(member.stuck ?? ""));
    const { score, pose } = member;
    const last = score.last;
    const figures = {
      depth: pose ? `${number(pose.depth_mm, 1)} mm` : "–",
      force: pose ? `${number(pose.motor_n, 2)} N` : "–",
      insertions: whole(score.insertions),
      passed: whole(score.passed),
      goal: last ? said(last.verdict.goal) : "–",
      reasons: last?.verdict.reasons.map((reason) => said(reason.words)).join("; ") || "–",
      last: last ? `${number(last.time_s, 1)} s, ${number(last.peak_force_n, 2)} N` : "–",
      patient: this.scene ? t("class.patient", { name: this.scene.profile }) : "",
      recording: t(member.recording ? "state.recording" : "recording.off"),
    };
    for (const [name, text] of Object.entries(figures)) write(this.figures[name], text);
    this.canvas.setAttribute("aria-label", t("class.needle", { name: member.name, depth: figures.depth }));
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
  if (member.gone) return ["gone", t("class.gone_for", { seconds: Math.floor(member.silent_s) }), "off"];
  if (!member.connected) return ["stuck", t("link.silent"), "warn"];
  if (member.stuck?.startsWith("fault")) return ["fault", t("class.fault"), "bad"];
  if (member.stuck) return ["stuck", t("class.stuck"), "warn"];
  return ["here", t("class.here"), "good"];
}

function receive(message) {
  if (message.type !== "class") return;
  const title = t("class.name", { name: message.name });
  write(byId("class-name"), title);
  document.title = title;
  write(byId("subtitle"), t("class.join", { command: `run --class ${message.name} --class-at ${message.address}` }));
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
  write(byId("here"), t("class.count_here", { count: count.here + count.stuck }));
  write(byId("stuck"), t("class.count_stuck", { count: count.stuck }));
  write(byId("gone"), t("class.count_gone", { count: count.gone }));
  byId("stuck-chip").dataset.tone = count.stuck ? "warn" : "off";
  byId("gone-chip").dataset.tone = count.gone ? "warn" : "off";
}

/** One device that says nonsense must not cost the others their cards. */
function attempt(card, what) {
  try {
    what();
  } catch {
    write(card.reason, t("class.other_version"));
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
  write(byId("banner"), here ? "" : t("banner.lost"));
  requestAnimationFrame(draw);
}

requestAnimationFrame(draw);
