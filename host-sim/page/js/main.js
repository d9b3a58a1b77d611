// Puts the parts together: messages in, one picture per screen refresh out.

import { BodyView } from "./body.js";
import { colours } from "./canvas.js";
import { EventList } from "./events.js";
import { Hand } from "./hand.js";
import { begin, said, t, tissueName } from "./language.js";
import { Link } from "./link.js";
import { Panel } from "./panel.js";
import { PatientEditor } from "./patient.js";
import { PhasePlot, TimePlot, WINDOW_S } from "./plots.js";
import { PlaceEditor } from "./place.js";
import { Practice } from "./practice.js";
import { CompensationSlider } from "./compensation_slider.js";
import { Scrub } from "./scrub.js";
import { Section } from "./section.js";
import { Tissue } from "./tissue.js";
import { Clock, Trace } from "./trace.js";

const PANEL_MS = 100;
const byId = (id) => document.getElementById(id);

begin();

const palette = colours();
const trace = new Trace();
const clock = new Clock();
const section = new Section(byId("section"), palette);
const timePlot = new TimePlot(byId("time-plot"), palette);
const phasePlot = new PhasePlot(byId("phase-plot"), palette);
const events = new EventList(byId("events"));
const panel = new Panel();
const body = new BodyView(palette);

/** The server says it first. */
let scene = null;
let tissue = null;
let linkStatus = null;
/** The newest state, which is drawn. */
const view = {
  known: false, depth: -5, force: 0, motor: 0, speed: 0, torque: 0, peak: NaN, tilt: 0.5, angle: 0.5, skinAngle: 0.5, lateral: 0, vessel: "outside", state: "idle",
  hand: 0, person: false, seconds: 0, ghost: NaN, originX: 0, originY: 0, underSkin: 0, next: null,
};
/** The number of jumps of the played recording when this was drawn. */
let jumps = 0;

const receive = {
  scene(message) {
    scene = message;
    view.known = false;
    view.tilt = scene.tilt_rad;
    view.angle = scene.tilt_rad - scene.skin_tilt_rad;
    forget();
    hand.followScene(scene);
    panel.scene(scene);
    body.setScene(scene);
    place.setScene(scene);
    patient.setScene(scene);
  },
  device(message) {
    panel.device(message);
  },
  patient(message) {
    patient.follow(message);
    place.follow(message);
  },
  practice(message) {
    practice.goal(message);
    tissue?.vein.follow(message.steps);
  },
  task(message) {
    events.add({ ...message, kind: "task" }, scene.layers);
  },
  attempt(message) {
    practice.ended(message);
  },
  frame(message) {
    linkStatus = message.link;
    scrub.follow(linkStatus.replay);
    compensationSlider.follow(linkStatus.compensation);
    hand.followFault(linkStatus.fault);
    practice.follow(linkStatus);
    const jumped = linkStatus.replay && linkStatus.replay.jumps !== jumps;
    if (jumped) {
      jumps = linkStatus.replay.jumps;
      forget();
    }
    for (const event of message.events) happen(event);
    for (const bucket of message.trace) trace.push(bucket);
    if (message.timing) panel.timing(message.timing);
    if (message.needle) [view.originX, view.originY] = message.needle;
    const pose = message.pose;
    if (!pose) return;
    clock.hear(pose.t_s, performance.now(), jumped);
    view.known = true;
    view.depth = pose.depth_mm;
    view.force = pose.force_n;
    view.motor = pose.motor_n;
    view.speed = pose.speed_mm_s;
    view.torque = pose.torque_mnm;
    timePlot.learn(pose.motor_n, pose.torque_mnm);
    view.tilt = pose.tilt_rad;
    view.angle = pose.angle_rad;
    view.skinAngle = angleToSkin(scene.body, pose.angle_rad);
    view.underSkin = underSkin(scene.body, view);
    view.lateral = pose.lateral_n;
    view.vessel = pose.vessel;
    view.state = pose.state;
    panel.limits(pose.limits, performance.now());
    hand.follow(message.hand, pose.depth_mm, pose.tilt_rad);
  },
};

/** The angle between the skin at entry and a needle at `angle` to the horizontal, rad: the same where the skin is level. */
function angleToSkin(body, angle) {
  if (!body) return angle;
  const [ahead, , down] = body.inwards;
  return Math.asin(Math.min(1, Math.max(-1, ahead * Math.cos(angle) + down * Math.sin(angle))));
}

/** The distance of the tip from the skin at entry, perpendicular to it, mm. */
function underSkin(body, { depth, angle, originX, originY }) {
  const [ahead, , down] = body?.inwards ?? [0, 0, 1];
  return ahead * (originX + depth * Math.cos(angle)) + down * (originY + depth * Math.sin(angle));
}

/** Nothing has happened yet: another scene, or another place in a recording. */
function forget() {
  tissue = new Tissue(scene);
  tissue.vein.follow(practice.steps);
  trace.clear();
  timePlot.clear();
  events.clear();
}

function happen(event) {
  tissue.happen(event);
  body.happen(event);
  practice.happen(event);
  events.add(event, scene.layers);
  if (event.kind === "heat_unknown") panel.cool(event.ends_in_s, performance.now());
  if (event.limits) panel.limits(event.limits, performance.now());
  if (event.kind === "puncture") {
    timePlot.mark(event.t_s, tissueName(scene.layers[event.layer]?.name ?? "layer"));
  }
}

const link = new Link((message) => receive[message.type]?.(message));
const hand = new Hand(byId("section"), section, link);
body.setHand(hand);
const scrub = new Scrub(link);
const compensationSlider = new CompensationSlider(link);
const patient = new PatientEditor(link, palette);
const place = new PlaceEditor(link, hand);
body.entered = (found) => place.enter(found);
const practice = new Practice(link, palette);

/** The values for tests and curious people: pictures per second, age of the last message, what is drawn, when first. */
const stats = {
  fps: 0, frames: 0, lastMessageAgeMs: Infinity, depthMm: NaN, handMm: NaN, forceN: NaN, motorN: NaN, firstFrameMs: NaN,
  drawn: section.drawn, vessel: "outside", flashback: false, vein: null,
};
window.__stats = stats;
const counting = { since: performance.now(), frames: 0 };

let lastDrawn = performance.now();
let lastPanel = -Infinity;

function draw(nowMs) {
  hand.tell();
  scrub.tell();
  compensationSlider.tell();
  view.seconds = Math.min(0.25, (nowMs - lastDrawn) / 1000);
  lastDrawn = nowMs;
  view.hand = hand.depth;
  view.person = hand.person;
  place.tell(view);
  const condition = link.open && !scrub.playing ? "paused" : link.condition;
  const now = clock.now(performance.now());
  if (tissue) {
    tissue.move(view.depth, view.angle, view.force, view.vessel, view.seconds, view.originY);
    view.next = practice.next;
    view.ghost = practice.ghost(now);
    if (!body.open) section.draw(view, tissue);
    body.draw(view);
  }
  timePlot.draw(trace, now);
  phasePlot.draw(trace, now);
  if (nowMs - lastPanel >= PANEL_MS) {
    lastPanel = nowMs;
    tellCondition(condition);
    view.peak = largestForce(now);
    panel.show(view, linkStatus, condition, nowMs);
  }
  count(nowMs);
  requestAnimationFrame(draw);
}

/** Largest force in the hand of the time shown, in N. */
function largestForce(now) {
  let peak = -Infinity;
  for (let i = trace.firstSince(now - WINDOW_S); i < trace.end; i++) {
    const force = trace.motorHigh[trace.slot(i)];
    if (force > peak) peak = force;
  }
  return peak;
}

/** Says what is missing and for how long. */
function tellCondition(condition) {
  document.body.dataset.link = condition;
  const seconds = Math.floor(link.dataAge / 1000);
  const since = t("banner.since", { seconds });
  const notice = linkStatus?.notice ?? "";
  const owed = link.stopOwed ? ` ${t("banner.owed")}` : "";
  if (condition === "connecting") panel.banner("");
  else if (condition === "lost") {
    panel.banner((seconds < 2 ? t("banner.lost") : t("banner.unreachable", { since })) + owed);
  } else if (condition === "stale") panel.banner(t("banner.silent", { since }) + (notice ? ` ${notice}.` : ""));
  else panel.banner(notice || (linkStatus?.fault ? t("banner.fault", { cause: said(linkStatus.fault) }) : ""));
}

function count(nowMs) {
  stats.frames++;
  counting.frames++;
  if (nowMs - counting.since >= 1000) {
    stats.fps = (1000 * counting.frames) / (nowMs - counting.since);
    counting.since = nowMs;
    counting.frames = 0;
  }
  stats.lastMessageAgeMs = performance.now() - link.lastMessageAt;
  if (!view.known) return;
  stats.depthMm = view.depth;
  stats.handMm = view.hand;
  stats.forceN = view.force;
  stats.motorN = view.motor;
  stats.ghostMm = view.ghost;
  stats.vessel = tissue.place;
  stats.flashback = tissue.flashback;
  stats.vein = tissue.vein;
  if (Number.isNaN(stats.firstFrameMs)) stats.firstFrameMs = performance.now();
}

requestAnimationFrame(draw);
