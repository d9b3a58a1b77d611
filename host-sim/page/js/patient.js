// The patient: chosen from those that come with the program or were saved, shaped by four sliders with a picture, or figure by figure, and
// sent to the device, which takes it whole or refuses it.

import { number, t, tissueName, capital } from "./language.js";
import { clearErrors, PatientFields, showError } from "./patient_fields.js";
import { PatientPicture } from "./patient_picture.js";
import { FIGURES, hasVein } from "./patient_sliders.js";

const byId = (id) => document.getElementById(id);
/** Steps that can be undone. */
const MOST_STEPS = 100;
/** Refusals that name a layer: what they look like, the key of what is said, the slider that is to be moved. */
const REFUSALS = [
  [/layer (\d+) reaches ([\d.]+) N\/mm, .*lower it to ([\d.]+)/, "patient.too_stiff", "firm"],
  [/layer (\d+) demands ([\d.]+) N, .*gives only ([\d.]+) N/, "patient.too_strong", "firm"],
  [/layer (\d+) does not begin below/, "patient.overlap", "depth"],
  [/layer (\d+) is deeper than the travel/, "patient.beyond", "depth"],
];

export class PatientEditor {
  /**
   * @param {import("./link.js").Link} link where wishes go
   * @param {Record<string, string>} colours of style.css, by name
   */
  constructor(link, colours) {
    this.link = link;
    this.open = byId("patient");
    this.dialog = byId("patient-editor");
    this.choice = byId("patient-choice");
    this.answer = byId("patient-answer");
    this.undo = byId("patient-undo");
    this.name = byId("patient-name");
    this.picture = new PatientPicture(byId("patient-picture"), byId("patient-force"), colours);
    this.fields = new PatientFields(byId("patient-fields"), () => this.edited(), () => this.settled());
    this.profile = null;
    this.needle = null;
    this.past = [];
    this.before = "";
    this.asked = false;
    this.open.addEventListener("click", () => (this.dialog.open ? this.dialog.close() : this.show()));
    byId("patient-close").addEventListener("click", () => this.dialog.close());
    this.choice.addEventListener("change", () => this.ask({ do: "choose", patient: this.choice.value }));
    byId("patient-send").addEventListener("click", () => this.ask({ do: "edit", profile: this.profile }));
    byId("patient-save").addEventListener("click", () => this.save());
    this.undo.addEventListener("click", () => this.stepBack());
    this.dialog.addEventListener("keydown", (event) => this.key(event));
    this.sliders = Object.entries(FIGURES).map(([name, figure]) => this.slider(name, figure));
  }

  slider(name, figure) {
    const input = byId(`patient-${name}`);
    input.addEventListener("input", () => {
      figure.write(this.profile, Number(input.value));
      this.fields.show(this.profile);
      this.edited();
    });
    input.addEventListener("change", () => this.settled());
    return { name, figure, input, value: byId(`patient-${name}-value`) };
  }

  /** Another scene: the needle that is drawn. */
  setScene(scene) {
    this.needle = scene.needle;
    if (this.dialog.open) this.draw();
  }

  /** The server's word: the patient that counts, and what became of the last wish. */
  follow(message) {
    this.open.hidden = false;
    this.current = message.profile;
    byId("patient-save-row").hidden = !message.can_save;
    this.list(message.names);
    const answer = message.answer;
    const refused = answer && !answer.taken;
    if (!refused) this.rebuild();
    if (!this.asked && !refused) return;
    this.asked = false;
    if (refused) this.say(this.refuse(answer.reason), "bad");
    else if (answer?.reason) this.say(answer.reason, "bad");
    else this.say(answer?.saved ? t("patient.saved", { file: answer.saved }) : t("patient.taken"), "good");
  }

  list(names) {
    const known = [...this.choice.options].map((option) => option.value).join();
    if (known === names.join()) return;
    this.choice.replaceChildren(...names.map((name) => new Option(name)));
  }

  show() {
    if (!this.current) return;
    this.rebuild();
    this.say("", "");
    this.dialog.show();
  }

  ask(message) {
    clearErrors(this.dialog);
    this.asked = this.link.send(message);
    this.say(this.asked ? t("patient.sent") : t("patient.unreachable"), this.asked ? "" : "bad");
  }

  save() {
    if (this.name.reportValidity()) this.ask({ do: "save_patient", name: this.name.value.trim(), profile: this.profile });
  }

  say(text, tone) {
    this.answer.textContent = text;
    this.answer.dataset.tone = tone;
  }

  /** Shows a refusal where it belongs; what to say of it. */
  refuse(reason) {
    const atFigure = this.fields.refuse(reason);
    if (atFigure) return atFigure;
    for (const [pattern, key, kind] of REFUSALS) {
      const [, layer, value, limit] = pattern.exec(reason) ?? [];
      const tissue = this.profile.layer?.[layer]?.tissue;
      if (!tissue) continue;
      const words = t(key, { tissue: capital(tissueName(tissue)), value: number(Number(value), 2), limit: number(Number(limit), 2) });
      const input = byId(`patient-${kind === "depth" ? "depth" : tissue === "skin" ? "skin" : "wall"}`);
      if (hasVein(this.profile)) showError(input, input.parentElement, words);
      return words;
    }
    return reason;
  }

  /** The editor anew, from the patient that counts. Another patient's steps cannot be undone in it. */
  rebuild() {
    const isSame = this.profile && canonical({ ...this.profile, name: "" }) === canonical({ ...this.current, name: "" });
    if (!isSame) this.past.length = 0;
    this.profile = structuredClone(this.current);
    this.before = JSON.stringify(this.profile);
    const known = [...this.choice.options].some((option) => option.value === this.profile.name);
    this.choice.value = known ? this.profile.name : "";
    this.fields.show(this.profile);
    this.edited();
  }

  /** A figure has another value: sliders and picture follow. */
  edited() {
    clearErrors(this.dialog);
    const vein = hasVein(this.profile);
    byId("patient-shape").hidden = !vein;
    byId("patient-none").hidden = vein;
    this.undo.disabled = this.past.length === 0 && JSON.stringify(this.profile) === this.before;
    if (!vein) return;
    for (const { name, figure, input, value } of this.sliders) {
      const now = figure.read(this.profile);
      input.min = Math.min(figure.low(this.profile), now);
      input.max = Math.max(figure.high(this.profile), now);
      if (Number(input.value) !== now) input.value = now;
      const text = t(name === "depth" || name === "size" ? "patient.mm" : "patient.gives_way", { value: number(now, name === "depth" || name === "size" ? 1 : 2) });
      if (value.textContent !== text) value.textContent = text;
      input.setAttribute("aria-valuetext", text);
    }
    this.draw();
  }

  draw() {
    if (this.needle && hasVein(this.profile)) this.picture.show(this.profile, this.needle);
  }

  /** The person has let go: one step that can be undone. */
  settled() {
    const now = JSON.stringify(this.profile);
    if (now === this.before) return;
    this.past.push(this.before);
    if (this.past.length > MOST_STEPS) this.past.shift();
    this.before = now;
    this.edited();
  }

  stepBack() {
    this.settled();
    const before = this.past.pop();
    if (before === undefined) return;
    this.before = before;
    this.profile = JSON.parse(before);
    this.fields.show(this.profile);
    this.edited();
  }

  /** Ctrl+Z undoes a step, but in a text what was typed. */
  key(event) {
    const isTyping = event.target.matches("input:not([type=range])");
    if ((event.ctrlKey || event.metaKey) && event.key === "z" && !isTyping) {
      event.preventDefault();
      this.stepBack();
    }
  }
}

/** JSON with the keys of every table in order. */
function canonical(value) {
  return JSON.stringify(value, (_, part) => {
    const isTable = part && typeof part === "object" && !Array.isArray(part);
    return isTable ? Object.fromEntries(Object.entries(part).sort(([a], [b]) => (a < b ? -1 : 1))) : part;
  });
}
