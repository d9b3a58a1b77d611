// Practice: the steps of the goal, the verdict after each withdrawal, the attempts with what was better or worse than the best so far,
// recording and the learning curve. The server judges; see host-sim/training/src/verdict.rs.

import { LearningCurve } from "./learning_curve.js";
import { language, number, said, t } from "./language.js";
import { SessionSheet } from "./session_sheet.js";
import { Tasks } from "./tasks.js";

const byId = (id) => document.getElementById(id);
/** Columns of the list: the key of their heading, the name of the figure, its digits. */
const COLUMNS = [
  ["practice.time", "time_s", 1],
  ["practice.force", "peak_force_n", 2],
  ["practice.in_vein", "in_lumen_s", 1],
];
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
    this.sheet = new SessionSheet((message) => link.send(message), () => ({ attempts: this.own(), goal: byId("goal").textContent, words: byId("curve").dataset.words ?? "", curve: byId("curve") }));
    byId("debrief").search = `language=${language}`;
    this.record = byId("record");
    this.name = byId("record-name");
    this.record.addEventListener("click", () => this.askForRecording());
    byId("view-events").addEventListener("click", () => this.show(false));
    byId("view-practice").addEventListener("click", () => this.show(true));
    /** The goal's steps, and the next of them; none where all are done. */
    this.steps = [];
    this.next = null;
    this.head();
  }

  head() {
    const cell = (textContent) => Object.assign(document.createElement("th"), { textContent, scope: "col" });
    byId("attempts-head").replaceChildren(cell(""), cell(t("practice.goal")), ...COLUMNS.map(([name]) => cell(t(name))));
  }

  /** Goes to the practice or back to the events. */
  show(open) {
    this.isShown = true;
    document.body.dataset.list = open ? "practice" : "events";
    byId("practice").hidden = !open;
    byId("events").hidden = open;
    byId("view-events").setAttribute("aria-pressed", String(!open));
    byId("view-practice").setAttribute("aria-pressed", String(open));
  }

  /** The server judges: what an insertion is for, and how the present one goes. */
  goal({ goal, patient, purpose, steps, next }) {
    byId("list-views").hidden = false;
    byId("events-title").hidden = true;
    const isNew = this.patient !== patient || this.purpose !== purpose;
    Object.assign(this, { patient, purpose, steps, goalWords: goal, next: next === null ? null : steps[next] });
    write(byId("goal"), `${said(goal)}.`);
    this.tasks.follow(steps, next);
    // A stranger finds what is to be done, step by step.
    if (isNew && purpose === "cannulation" && !this.isShown) this.show(true);
    if (isNew) this.list();
    if (isNew) this.drawCurve();
  }

  /** One for each goal: what was learnt in another procedure says little about this one. */
  drawCurve() {
    this.curve.draw(this.own());
  }

  /** A person's attempts at the present goal. */
  own() {
    return this.attempts.filter((one) => one.by_person && one.figures.verdict.goal === this.goalWords);
  }

  /** An insertion has ended. After a reconnection all are reported again. */
  ended(attempt) {
    if (attempt.number === 1) this.attempts.length = 0;
    this.attempts.push(attempt);
    if (attempt.by_person) this.say(attempt);
    this.list();
    this.drawCurve();
  }

  say({ number: which, figures }) {
    const { passed, reasons } = figures.verdict;
    const verdict = byId("verdict");
    verdict.dataset.tone = passed ? "good" : "bad";
    const missing = reasons.map(({ words }) => said(words)).join("; ");
    const what = passed ? t("practice.goal_reached") : missing ? t("practice.not_reached", { missing }) : t("practice.not_finished");
    const [time, force] = [number(figures.time_s, 1), number(figures.peak_force_n, 2)];
    verdict.textContent = t("practice.verdict", { number: which, what, time, force });
  }

  /** A person's best insertion into this patient: passed, and the quickest. */
  get best() {
    const own = this.attempts.filter((one) => one.by_person && one.figures.verdict.passed && one.patient === this.patient);
    return own.reduce((best, one) => (best && best.figures.time_s <= one.figures.time_s ? best : one), null);
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
      const { passed } = attempt.figures.verdict;
      cell(t(passed ? "practice.reached" : "practice.missed"), passed ? "good" : "bad");
      for (const [, key, digits] of COLUMNS) {
        // A demonstration is no attempt to be better or worse.
        const isComparable = attempt.by_person && best && best !== attempt && best.patient === attempt.patient && key !== "in_lumen_s";
        cell(...compared(attempt.figures[key], isComparable ? best.figures[key] : null, digits));
      }
      return row;
    });
    byId("attempts").replaceChildren(...rows);
  }

  /** Follows the events of the device: when the needle has touched the skin. */
  happen(event) {
    if (event.kind === "contact" && event.layer === 0) {
      this.touchedAt = event.t_s;
      byId("verdict").textContent = "";
    }
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
  follow({ recording, recorded, trainee }) {
    if (this.patient !== null) this.sheet.follow({ trainee });
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

function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** A figure, and whether it is better or worse than the wanted one: less is. */
function compared(value, wanted, digits) {
  if (value === null || value === undefined) return ["–"];
  const text = number(value, digits);
  if (wanted === null || wanted === undefined || Math.abs(value - wanted) <= SAME * Math.abs(wanted)) return [text];
  return value < wanted ? [t("practice.better", { value: text }), "good"] : [t("practice.worse", { value: text }), "bad"];
}
