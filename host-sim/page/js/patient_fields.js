// All figures of a patient as its file has them, whatever the force model; nothing here knows what they mean. A refusal is shown at the
// figure that it is about, in that figure's words.

import { capital, has, number, t, tissueName } from "./language.js";

const UNITS = [
  ["_n_s_per_mm", "N·s/mm"], ["_n_per_mm", "N/mm"], ["_mm2_per_n", "mm²/N"], ["_mm_per_s", "mm/s"], ["_mm_s", "mm/s"], ["_mm", "mm"],
  ["_n", "N"], ["_deg", "°"], ["_ms", "ms"], ["_kg", "kg"], ["_cm", "cm"], ["_years", "unit.years"], ["_s", "s"],
];
/** Not a person's to change here. */
const FIXED = new Set(["format"]);

/** "top_mm" as ["top", "mm"], both in the page's language. */
function words(key) {
  const [ending, unit] = UNITS.find(([end]) => key.endsWith(end)) ?? ["", ""];
  const plain = ending ? key.slice(0, -ending.length) : key;
  const name = has(`figure.${plain}`) ? t(`figure.${plain}`) : plain.replaceAll("_", " ");
  return [name, has(unit) ? t(unit) : unit];
}

export class PatientFields {
  /**
   * @param {HTMLElement} box where the figures are
   * @param {() => void} edited called when a figure has another value
   * @param {() => void} settled called when the person has left it
   */
  constructor(box, edited, settled) {
    this.box = box;
    this.edited = edited;
    box.addEventListener("change", settled);
  }

  /** Shows the figures of `profile`, which they change. */
  show(profile) {
    this.profile = profile;
    this.box.replaceChildren(...this.group(profile));
  }

  /** Inputs for the numbers of `object`; a box for each table and each table of a list. */
  group(object) {
    const parts = [];
    for (const [key, value] of Object.entries(object)) {
      if (FIXED.has(key)) continue;
      if (typeof value === "number") parts.push(this.input(object, key));
      else if (Array.isArray(value)) {
        if (value.every((item) => typeof item === "number")) continue;
        for (const item of value) if (item && typeof item === "object" && !Array.isArray(item)) parts.push(this.table(item.tissue ? tissueName(item.tissue) : words(key)[0], item));
      } else if (value && typeof value === "object") parts.push(this.table(words(key)[0], value));
    }
    // Figures first, boxes after them.
    return parts.sort((a, b) => (a.tagName === "FIELDSET") - (b.tagName === "FIELDSET"));
  }

  table(name, object) {
    const box = document.createElement("fieldset");
    const legend = document.createElement("legend");
    legend.textContent = capital(name);
    box.append(legend, ...this.group(object));
    return box;
  }

  input(object, key) {
    const [name, unit] = words(key);
    const label = document.createElement("label");
    const input = document.createElement("input");
    input.type = "number";
    input.step = "any";
    input.value = String(object[key]);
    input.dataset.key = key;
    input.addEventListener("input", () => {
      // An empty field is no number: the device is asked for the text here, and says what is wrong with it.
      object[key] = input.value === "" ? null : Number(input.value);
      if (object[key] === null) delete object[key];
      this.edited();
    });
    const said = document.createElement("span");
    said.textContent = capital(unit ? `${name}, ${unit}` : name);
    label.append(said, input);
    return label;
  }

  /** Shows `reason` at the figure that it names; the sentence, or null where it names none that is here. */
  refuse(reason) {
    const [, key, value, low, high] = /(\w+) is (-?[\d.]+); it must be from (-?[\d.]+) to (-?[\d.]+)/.exec(reason) ?? [];
    const [, missing] = /missing field `(\w+)`/.exec(reason) ?? [];
    const named = [...this.box.querySelectorAll(`[data-key="${key ?? missing}"]`)];
    const input = named.find((one) => (missing ? one.value === "" : Math.abs(Number(one.value) - Number(value)) < 1e-3));
    if (!input) return null;
    const [name, unit] = words(input.dataset.key);
    const figure = (text) => number(Number(text), Math.min(4, (text.split(".")[1] ?? "").replace(/0+$/, "").length));
    const values = { name: capital(name), unit: unit ? `\u00a0${unit}` : "", value: value && figure(value), low: low && figure(low), high: high && figure(high) };
    const sentence = t(missing ? "patient.missing" : "patient.range", values);
    showError(input, input.parentElement, sentence);
    return sentence;
  }
}

/** Marks a control as wrong, with the reason after `place`. */
export function showError(control, place, sentence) {
  const note = Object.assign(document.createElement("p"), { className: "wrong", id: "patient-wrong", textContent: sentence });
  control.setAttribute("aria-invalid", "true");
  control.setAttribute("aria-describedby", note.id);
  place.after(note);
  const advanced = control.closest("details");
  if (advanced) advanced.open = true;
  note.scrollIntoView({ block: "center" });
}

/** Takes the mark away again. */
export function clearErrors(box) {
  for (const note of box.querySelectorAll(".wrong")) note.remove();
  for (const control of box.querySelectorAll("[aria-invalid]")) {
    control.removeAttribute("aria-invalid");
    control.removeAttribute("aria-describedby");
  }
}
