// The trainee's name and the session on one printable page: who, when, what was passed and why not, the figures, the curve and a line
// to sign. The name is kept in this browser only, until it is emptied; the program tells it to nobody but the class that its device is in.

import { number, said, t } from "./language.js";

const byId = (id) => document.getElementById(id);
const KEPT = "trainee";
/** A program that was told a name knows it after so long. */
const TOLD_MS = 2000;
/** The figures of an attempt: the key of their heading, the name of the figure, its digits. */
const FIGURES = [["practice.time", "time_s", 1], ["practice.force", "peak_force_n", 2], ["practice.in_vein", "in_lumen_s", 1]];

export class SessionSheet {
  /**
   * @param {(message: object) => void} send takes the name to the program
   * @param {() => { attempts: object[], goal: string, words: string, curve: HTMLCanvasElement }} session what is to be printed
   */
  constructor(send, session) {
    this.send = send;
    this.toldAt = -Infinity;
    this.session = session;
    this.name = byId("trainee");
    try {
      this.name.value = localStorage.getItem(KEPT) ?? "";
    } catch {
      // A browser that keeps nothing keeps no name either.
    }
    this.name.addEventListener("input", () => this.keep());
    byId("print-session").addEventListener("click", () => this.print());
  }

  /** Says who is at the device to a program that does not know anybody: it may have been started again. */
  follow({ trainee }) {
    const name = this.name.value.trim();
    if (trainee || !name || performance.now() - this.toldAt < TOLD_MS) return;
    this.toldAt = performance.now();
    this.send({ do: "trainee", name });
  }

  keep() {
    const name = this.name.value.trim();
    this.send({ do: "trainee", name });
    try {
      if (name) localStorage.setItem(KEPT, name);
      else localStorage.removeItem(KEPT);
    } catch {
      // See above.
    }
  }

  print() {
    this.fill();
    window.print();
  }

  fill() {
    const { attempts, goal, words, curve } = this.session();
    const make = (tag, text = "") => Object.assign(document.createElement(tag), { textContent: text });
    const table = make("table");
    const head = table.createTHead().insertRow();
    for (const text of ["", t("practice.goal"), ...FIGURES.map(([key]) => t(key)), t("sheet.reasons")]) head.append(make("th", text));
    for (const { number: which, figures } of attempts) {
      const { passed, reasons } = figures.verdict;
      const row = table.insertRow();
      const why = reasons.map((reason) => said(reason.words)).join("; ");
      const values = FIGURES.map(([, key, digits]) => (Number.isFinite(figures[key]) ? number(figures[key], digits) : "–"));
      for (const text of [which, t(passed ? "practice.reached" : "practice.missed"), ...values, why]) row.insertCell().textContent = text;
    }
    // A copy: the page allows no image that is not a file of its own.
    const picture = Object.assign(document.createElement("canvas"), { width: curve.width, height: curve.height, role: "img", ariaLabel: words });
    if (curve.width && curve.height) picture.getContext("2d").drawImage(curve, 0, 0);
    const date = new Date().toLocaleDateString(document.documentElement.lang, { dateStyle: "long" });
    byId("sheet").replaceChildren(
      make("h1", t("sheet.title")),
      make("p", `${t("sheet.trainee")}: ${this.name.value.trim() || "…………………………"}`),
      make("p", `${t("sheet.date")}: ${date}`),
      make("p", `${t("practice.goal")}: ${goal} (${words})`),
      table,
      picture,
      make("p", `${t("sheet.sign")}: …………………………………………………………`),
    );
  }
}
