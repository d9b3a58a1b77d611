// The steps of a guide, wherever its page is: says what comes next, and begins a step when the person says so. The page has the
// elements `steps`, `end` and `leave` and the template `step`. The texts of a guide are in host-sim/device-sim/src/page/guide.rs.

const byId = (id) => document.getElementById(id);
const GOING = { hand: "Do it now; the device watches until you are done.", motor: "The motor moves: hands off." };

export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export class GuideSteps {
  /** @param {(message: object) => void} send called with what the person decides */
  constructor(send) {
    this.send = send;
    this.ended = false;
  }

  /** Shows the state of the guide. */
  follow(message) {
    message.steps.forEach((step, i) => show(byId("steps").children[i] ?? this.add(i + 1), step));
    if (message.end && !this.ended) this.end(message.end);
  }

  /** Another guide begins. */
  clear() {
    this.ended = false;
    byId("steps").replaceChildren();
    byId("end").hidden = true;
    write(byId("leave"), "End");
  }

  add(number) {
    const item = byId("step").content.firstElementChild.cloneNode(true);
    item.querySelector("button").addEventListener("click", () => this.send({ do: "begin", step: number }));
    byId("steps").append(item);
    return item;
  }

  end({ well, lines }) {
    this.ended = true;
    const section = byId("end");
    section.hidden = false;
    section.toggleAttribute("data-well", well);
    write(section.querySelector("h2"), well ? "Done" : "Not done");
    section.querySelector("ul").replaceChildren(...lines.map((line) => Object.assign(document.createElement("li"), { textContent: line })));
    write(byId("leave"), "Close");
    byId("leave").scrollIntoView({ block: "nearest" });
  }
}

function show(item, { text, moves, stage, news }) {
  write(item.querySelector(".text"), text);
  write(item.querySelector(".going"), moves ? GOING.motor : GOING.hand);
  write(item.querySelector(".news"), news);
  item.toggleAttribute("data-moves", moves);
  if (item.dataset.stage === stage) return;
  item.dataset.stage = stage;
  if (stage !== "done") item.scrollIntoView({ block: "nearest" });
  if (stage === "asked") item.querySelector("button").focus({ preventScroll: true });
}
