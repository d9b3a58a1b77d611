// The language of the page: its texts by their keys and its numbers. The person's own choice counts, then the languages of the browser,
// then English. A page without a choice of languages (the guide) is in English.

import de from "./strings/de.js";
import en from "./strings/en.js";
import fr from "./strings/fr.js";

const TEXTS = { en, de, fr };
/** English numbers have a point and commas; "en" alone would be American. */
const NUMBERS = { en: "en-GB", de: "de", fr: "fr" };
const KEPT = "language";
/** Attributes of an element and what its text becomes: `data-text="KEY"`, `data-tip` and so on. */
const ATTRIBUTES = { tip: "title", label: "aria-label", value: "value", hint: "placeholder" };

const choice = document.getElementById("language");
export const language = chosen();
const texts = TEXTS[language];
const formats = new Map();

function chosen() {
  if (!choice) return "en";
  const wanted = [kept(), ...navigator.languages].map((tag) => tag?.toLowerCase().split("-")[0]);
  return wanted.find((tag) => Object.hasOwn(TEXTS, tag)) ?? "en";
}

/** A page opened from a folder may have no storage. */
function kept() {
  try {
    return localStorage.getItem(KEPT);
  } catch {
    return null;
  }
}

/** Returns true if there is a text for `key`. */
export function has(key) {
  return Object.hasOwn(texts, key);
}

/** The text for `key`, with `{name}` replaced by `values.name`. */
export function t(key, values = {}) {
  if (!has(key)) {
    console.error(`no text for ${key}`);
    return key;
  }
  return texts[key].replace(/\{(\w+)\}/g, (_, name) => values[name]);
}

/** The name of a tissue or structure in this language; one that is not known as the program says it. */
export function tissueName(name) {
  const key = `tissue.${name.replaceAll(/[ -]/g, "_")}`;
  return has(key) ? t(key) : name;
}

/** The name of a task of a procedure within a sentence: `tourniquet_on` is "tourniquet on". */
export function taskName(name) {
  const key = `task.${name.replaceAll(" ", "_")}`;
  return has(key) ? t(key) : name.replaceAll("_", " ");
}

export const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** English sentences of the program as patterns, each with its key. */
const SAID = Object.entries(en).filter(([key]) => key.startsWith("said.")).map(([key, text]) => {
  const escaped = text.replace(/[.*+?^$()|[\]\\]/g, "\\$&");
  return [key, new RegExp(`^${escaped.replace(/\{(\w+)\}/g, "(?<$1>.+)")}$`)];
});

/** A sentence of the program in this language; one that is not known stays English. */
export function said(sentence) {
  if (language === "en") return sentence;
  for (const [key, pattern] of SAID) {
    const values = pattern.exec(sentence)?.groups ?? (pattern.test(sentence) ? {} : null);
    if (values) return t(key, localised(values));
  }
  return sentence;
}

function localised({ tissue, task, cause, ...others }) {
  const values = Object.entries(others).map(([name, value]) => [name, value.replace(".", decimalPoint)]);
  return { ...Object.fromEntries(values), tissue: tissue && tissueName(tissue), task: task && taskName(task), cause: cause && said(cause) };
}

function format(digits, useGrouping) {
  const name = `${digits} ${useGrouping}`;
  if (!formats.has(name)) {
    const options = { minimumFractionDigits: digits, maximumFractionDigits: digits, useGrouping, signDisplay: "negative" };
    formats.set(name, new Intl.NumberFormat(NUMBERS[language], options));
  }
  return formats.get(name);
}

const decimalPoint = format(1, false).format(0.5).charAt(1);

/** A number with a fixed number of digits after its decimal point, and a minus sign; no "−0.00". */
export function number(value, digits) {
  return Number.isFinite(value) ? format(digits, false).format(value).replace("-", "−") : "–";
}

/** A count, with its thousands apart. */
export function count(value) {
  return format(0, true).format(value);
}

/** Fills in the texts of the elements below `root` that have keys. */
export function translate(root = document) {
  for (const element of root.querySelectorAll("[data-text]")) element.prepend(t(element.dataset.text));
  for (const [data, attribute] of Object.entries(ATTRIBUTES)) {
    for (const element of root.querySelectorAll(`[data-${data}]`)) element.setAttribute(attribute, t(element.dataset[data]));
  }
}

/** Makes the page's language the chosen one, and lets a person choose another: the page is then loaded again. */
export function begin() {
  document.documentElement.lang = language;
  translate();
  choice.value = language;
  choice.addEventListener("change", () => {
    localStorage.setItem(KEPT, choice.value);
    location.reload();
  });
}
