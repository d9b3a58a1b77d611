// The patient: chosen from those that come with the program, or edited figure by figure and sent to the device, which takes it whole or
// refuses it. The figures are those of the profile's file, whatever the force model; nothing here knows what they mean.

const UNITS = [
  ["_n_s_per_mm", "N·s/mm"], ["_n_per_mm", "N/mm"], ["_mm2_per_n", "mm²/N"], ["_mm_per_s", "mm/s"], ["_mm_s", "mm/s"], ["_mm", "mm"],
  ["_n", "N"], ["_deg", "°"], ["_ms", "ms"], ["_kg", "kg"], ["_cm", "cm"], ["_years", "years"], ["_s", "s"],
];
/** Not a person's to change here. */
const FIXED = new Set(["format"]);

/** "top_mm" as ["top", "mm"]. */
function words(key) {
  const [ending, unit] = UNITS.find(([end]) => key.endsWith(end)) ?? ["", ""];
  const plain = ending ? key.slice(0, -ending.length) : key;
  return [plain.replaceAll("_", " "), unit];
}

export class PatientEditor {
  /** @param {import("./link.js").Link} link where wishes go */
  constructor(link) {
    this.link = link;
    const byId = (id) => document.getElementById(id);
    this.open = byId("patient");
    this.dialog = byId("patient-editor");
    this.choice = byId("patient-choice");
    this.fields = byId("patient-fields");
    this.answer = byId("patient-answer");
    this.send = byId("patient-send");
    this.profile = null;
    this.asked = false;
    this.open.addEventListener("click", () => (this.dialog.open ? this.dialog.close() : this.show()));
    byId("patient-close").addEventListener("click", () => this.dialog.close());
    this.choice.addEventListener("change", () => this.ask({ do: "choose", patient: this.choice.value }));
    this.send.addEventListener("click", () => this.ask({ do: "edit", profile: this.profile }));
  }

  /** The server's word: the patient that counts, and what became of the last wish. */
  follow(message) {
    this.open.hidden = false;
    this.current = message.profile;
    if (this.choice.options.length === 0) this.choice.append(...message.names.map((name) => new Option(name)));
    const answer = message.answer;
    const refused = answer && !answer.taken;
    if (!refused) this.rebuild();
    if (!this.asked && !refused) return;
    this.asked = false;
    this.say(refused ? answer.reason : "The device has taken it.", refused ? "bad" : "good");
  }

  show() {
    this.rebuild();
    this.say("", "");
    this.dialog.show();
  }

  ask(message) {
    this.asked = this.link.send(message);
    this.say(this.asked ? "Sent to the device." : "The program is unreachable; nothing was sent.", this.asked ? "" : "bad");
  }

  say(text, tone) {
    this.answer.textContent = text;
    this.answer.dataset.tone = tone;
  }

  /** The form anew, from the patient that counts. */
  rebuild() {
    this.profile = structuredClone(this.current);
    const known = [...this.choice.options].some((option) => option.value === this.profile.name);
    this.choice.value = known ? this.profile.name : "";
    this.fields.replaceChildren(...this.group(this.profile));
  }

  /** Inputs for the numbers of `object`; a box for each table and each table of a list. */
  group(object) {
    const parts = [];
    for (const [key, value] of Object.entries(object)) {
      if (FIXED.has(key)) continue;
      if (typeof value === "number") parts.push(this.input(object, key));
      else if (Array.isArray(value)) {
        if (value.every((item) => typeof item === "number")) continue;
        for (const item of value) if (item && typeof item === "object" && !Array.isArray(item)) parts.push(this.box(item.tissue ?? key, item));
      } else if (value && typeof value === "object") parts.push(this.box(words(key)[0], value));
    }
    // Figures first, boxes after them.
    return parts.sort((a, b) => (a.tagName === "FIELDSET") - (b.tagName === "FIELDSET"));
  }

  box(name, object) {
    const box = document.createElement("fieldset");
    const legend = document.createElement("legend");
    legend.textContent = name;
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
      // An empty field is no number: the device is asked for what stands here, and says what is wrong with it.
      object[key] = input.value === "" ? null : Number(input.value);
      if (object[key] === null) delete object[key];
    });
    const said = document.createElement("span");
    said.textContent = unit ? `${name}, ${unit}` : name;
    label.append(said, input);
    return label;
  }
}
