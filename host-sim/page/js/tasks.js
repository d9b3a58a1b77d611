// The steps of the goal: a list that the server ticks, the next one highlighted, and a button for each step that a person reports
// (tourniquet, catheter, plunger). The server says what was done, because the scripted hand does steps too.

import { said } from "./language.js";

const byId = (id) => document.getElementById(id);
const MARKS = { open: "○", done: "✓", wrong: "✗" };

export class Tasks {
  /** @param {import("./link.js").Link} link where wishes go */
  constructor(link) {
    this.link = link;
    this.list = byId("steps");
    this.box = byId("tasks");
    this.items = [];
    this.shown = "";
  }

  /** Shows the steps, in their order, and which of them is `next`, or null. */
  follow(steps, next) {
    const shown = steps.map(({ words }) => words).join("\n");
    if (shown !== this.shown) this.build(steps);
    this.shown = shown;
    for (const [i, { state }] of steps.entries()) {
      const { item, mark, button } = this.items[i];
      mark.textContent = MARKS[state] ?? "";
      for (const element of button ? [item, button] : [item]) {
        element.dataset.state = state;
        element.dataset.next = String(i === next);
      }
      if (i === next) item.setAttribute("aria-current", "step");
      else item.removeAttribute("aria-current");
    }
  }

  build(steps) {
    this.items = steps.map(({ words, task }) => {
      const item = document.createElement("li");
      const mark = Object.assign(document.createElement("span"), { className: "mark" });
      mark.ariaHidden = "true";
      item.append(mark, said(words));
      return { item, mark, button: task ? this.button(words, task) : null };
    });
    this.list.replaceChildren(...this.items.map(({ item }) => item));
    const buttons = this.items.map(({ button }) => button).filter(Boolean);
    this.box.replaceChildren(...buttons);
    this.box.hidden = buttons.length === 0;
  }

  button(words, task) {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: said(words) });
    button.dataset.task = task;
    button.addEventListener("click", () => this.link.send({ do: "task", name: task }));
    return button;
  }
}
