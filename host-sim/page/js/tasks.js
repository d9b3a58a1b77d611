// The tasks of a procedure in addition to moving the needle (tourniquet, plunger, catheter): a
// button for each. The server reports what was done, because the scripted hand does them too.

import { capital, t, taskName } from "./language.js";

const byId = (id) => document.getElementById(id);

const PLACES = { target: "task.at_target", outside: "task.at_outside", any: "task.at_any" };
/** Mistakes that are not critical, as clauses. */
const MISTAKES = { missed: "practice.task_missed", wrong_place: "practice.task_place", wrong_order: "practice.task_order" };

export class Tasks {
  /** @param {import("./link.js").Link} link where wishes go */
  constructor(link) {
    this.link = link;
    this.box = byId("tasks");
    this.buttons = new Map();
  }

  /** Shows the buttons of the procedure's tasks, in their order. */
  follow(tasks) {
    this.buttons = new Map(tasks.map(({ name, tip }) => [name, this.button(name, tip)]));
    this.box.replaceChildren(...this.buttons.values());
    this.box.hidden = tasks.length === 0;
  }

  button(name, tip) {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: capital(taskName(name)), title: PLACES[tip] ? t(PLACES[tip]) : "" });
    button.dataset.task = name;
    button.addEventListener("click", () => this.link.send({ do: "task", name }));
    return button;
  }

  /** The task was done. */
  done(name) {
    const button = this.buttons.get(name);
    if (button) button.dataset.done = "true";
  }

  /** A new insertion: nothing has been done. */
  forget() {
    for (const button of this.buttons.values()) delete button.dataset.done;
  }
}

/** Returns the mistakes of an insertion that are not critical, as a clause; empty if there are no
 *  such mistakes. */
export function mistakes(tasks) {
  const wrong = (tasks?.list ?? []).filter((one) => one.mistake && !one.is_critical);
  return wrong.map((one) => t(MISTAKES[one.mistake], { task: taskName(one.name) })).join(", ");
}
