// Practice: records, shows the verdict after each withdrawal, the attempts with what was better or worse than the best so far, and the
// learning curve. The server judges; see host-sim/training/src/practice.rs.

import { LearningCurve } from "./learning_curve.js";
import { number, said, t } from "./language.js";
import { mistakes, Tasks } from "./tasks.js";

const byId = (id) => document.getElementById(id);
/** Columns of the list: the key of their heading, the name of the figure, its digits. */
const COLUMNS = [
  ["practice.time", "time_s", 1],
  ["practice.force", "peak_force_n", 2],
  ["practice.in_vein", "in_lumen_s", 1],
  ["practice.angle", "angle_rms_error_deg", 1],
  ["practice.hits", "spared_hits", 0],
];
/** Keys of the meanings of short headings. */
const TITLES = { spared_hits: "practice.hits_title", angle_rms_error_deg: "practice.angle_title" };
/** Columns that are only shown where the goal has a limit for them. */
const WITH_TARGET_ONLY = new Set(["in_lumen_s"]);
/** A figure that differs from the best one by less than this share is as good. */
const SAME = 0.05;

export class Practice {
  /**
   * @param {import("./link.js").Link} link where wishes go
   * @param {Record<string, string>} colours of style.css, by name
   */
  constructor(link, colours) {
    this.link = link;
    this.attempts = [];
    this.patient = null;
    this.touchedAt = NaN;
    this.tasks = new Tasks(link);
    this.curve = new LearningCurve(byId("curve"), colours);
    this.record = byId("record");
    this.name = byId("record-name");
    this.record.addEventListener("click", () => this.askForRecording());
    byId("view-events").addEventListener("click", () => this.show(false));
    byId("view-practice").addEventListener("click", () => this.show(true));
    /** The limits of the goal by the names of the figures: `{ at_least }` or `{ at_most }`. */
    this.targets = {};
    this.head();
  }

  get columns() {
    return COLUMNS.filter(([, key]) => this.targets[key] || !WITH_TARGET_ONLY.has(key));
  }

  /** The headings; below the name of a figure its limit. */
  head() {
    const cell = (name, key) => {
      const title = TITLES[key] ? t(TITLES[key]) : "";
      const head = Object.assign(document.createElement("th"), { textContent: name, scope: "col", title });
      const target = this.targets[key];
      if (target) head.append(document.createElement("br"), target.at_least === undefined ? `≤ ${limit(target.at_most)}` : `≥ ${limit(target.at_least)}`);
      return head;
    };
    byId("attempts-head").replaceChildren(cell(""), cell(t("practice.goal")), ...this.columns.map(([name, key]) => cell(t(name), key)));
  }

  /** Goes to the practice or back to the events. */
  show(open) {
    document.body.dataset.list = open ? "practice" : "events";
    byId("practice").hidden = !open;
    byId("events").hidden = open;
    byId("view-events").setAttribute("aria-pressed", String(!open));
    byId("view-practice").setAttribute("aria-pressed", String(open));
  }

  /** The server judges: what insertions are for. */
  goal(message) {
    byId("list-views").hidden = false;
    byId("events-title").hidden = true;
    this.patient = message.patient;
    byId("goal").textContent = `${said(message.goal)}.`;
    this.targets = message.targets ?? {};
    this.tasks.follow(message.tasks ?? []);
    this.head();
    this.list();
  }

  /** An insertion has ended. After a reconnection all are reported again. */
  ended(attempt) {
    if (attempt.number === 1) this.attempts.length = 0;
    this.attempts.push(attempt);
    this.tasks.forget();
    if (attempt.by_person) this.say(attempt);
    this.list();
    this.curve.draw(this.attempts.filter((one) => one.by_person));
  }

  say(attempt) {
    const verdict = byId("verdict");
    const { figures } = attempt;
    verdict.dataset.tone = attempt.reached ? "good" : "bad";
    const missing = attempt.missing.map(said).join("; ");
    const what = attempt.reached ? t("practice.goal_reached") : t("practice.not_reached", { missing });
    const others = mistakes(figures.tasks);
    const also = others ? t("practice.not_critical", { mistakes: others }) : "";
    const [time, force] = [number(figures.time_s, 1), number(figures.peak_force_n, 2)];
    verdict.textContent = t("practice.verdict", { number: attempt.number, what, time, force, also });
  }

  /** The best insertion into this patient: reached, and the quickest; a person's where there is one, else the scripted hand's. */
  get best() {
    const reached = this.attempts.filter((one) => one.reached && one.patient === this.patient);
    const own = reached.filter((one) => one.by_person);
    return (own.length ? own : reached).reduce((best, one) => (best && best.figures.time_s <= one.figures.time_s ? best : one), null);
  }

  /** Newest first; figures are marked as better or worse than those of the best. */
  list() {
    const { best } = this;
    const rows = this.attempts.slice(-100).reverse().map((attempt) => {
      const row = document.createElement("tr");
      row.dataset.best = String(attempt === best);
      const cell = (text, tone = "") => {
        const cell = row.insertCell();
        cell.textContent = text;
        if (tone) cell.dataset.tone = tone;
      };
      cell(`${attempt.number}${attempt.by_person ? "" : t("practice.demo")}${attempt === best ? " ★" : ""}`);
      cell(t(attempt.reached ? "practice.reached" : "practice.missed"), attempt.reached ? "good" : "bad");
      for (const [, key, digits] of this.columns) {
        const wanted = best && best !== attempt && best.patient === attempt.patient ? best.figures[key] : null;
        cell(...compared(attempt.figures[key], wanted, digits, this.targets[key]));
      }
      return row;
    });
    byId("attempts").replaceChildren(...rows);
  }

  /** Follows the events of the device: when the needle has touched the skin. */
  happen(event) {
    if (event.kind === "contact" && event.layer === 0) this.touchedAt = event.t_s;
    if (event.kind === "exit" && event.layer === 0) this.touchedAt = NaN;
  }

  /** Returns the tip's place of the best insertion at this time after its first touch, mm; NaN if
   *  no place is to be shown. */
  ghost(now) {
    const path = this.best?.path;
    const since = now - this.touchedAt;
    if (!path?.length || !(since >= 0) || since > path.at(-1)[0]) return NaN;
    const after = path.findIndex(([t]) => t >= since);
    const [[t0, d0], [t1, d1]] = [path[Math.max(0, after - 1)], path[after]];
    return t1 > t0 ? d0 + ((d1 - d0) * (since - t0)) / (t1 - t0) : d1;
  }

  /** Follows the server: the recording in progress, or null, and the file of the last one that was ended. */
  follow({ recording, recorded }) {
    const debrief = byId("debrief");
    if (debrief.hidden !== !recorded) debrief.hidden = !recorded;
    const text = t(recording ? "practice.end" : "practice.record");
    if (this.record.textContent !== text) this.record.textContent = text;
    // The name, which may have got a number, is at the top of the page meanwhile.
    if (this.name.hidden !== Boolean(recording)) this.name.hidden = Boolean(recording);
    this.recording = recording;
  }

  askForRecording() {
    if (this.recording) this.link.send({ do: "end_recording" });
    else if (this.name.reportValidity()) this.link.send({ do: "record", name: this.name.value.trim() });
  }
}

/** The limit of a figure, with as many digits as it has. */
const limit = (value) => number(value, Number.isInteger(value) ? 0 : 1);

/** A figure, and whether it is beyond its limit, or better or worse than the wanted one: less is, unless the limit is a least one. */
function compared(value, wanted, digits, target) {
  if (value === null || value === undefined) return ["–"];
  const text = number(value, digits);
  if (target && (value < target.at_least || value > target.at_most)) return [`${text} ✗`, "bad"];
  if (wanted === null || wanted === undefined || Math.abs(value - wanted) <= SAME * Math.abs(wanted)) return [text];
  const better = target?.at_least === undefined ? value < wanted : value > wanted;
  return better ? [t("practice.better", { value: text }), "good"] : [t("practice.worse", { value: text }), "bad"];
}
