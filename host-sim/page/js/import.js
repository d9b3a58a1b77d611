// The page to drop a log on: it asks for columns, units and the rig's values, and shows how far the diagnosis is. It computes nothing:
// each step is a question to the program, which answers with JSON or with a sentence of what is wrong.

const byId = (id) => document.getElementById(id);
const PROGRESS_MS = 300;
/** Units that a role usually has; the program knows more. */
const UNITS = {
  time: "s ms us", command: "Nm mNm N A mA V", position: "rad deg rev counts m mm", velocity: "rad/s deg/s rpm m/s mm/s",
  reference: "rad deg rev counts m mm", tilt: "rad deg", force: "N Nm", enabled: "",
};

/** Shows a sentence of the program, in which an option of the command line is what the page has for it. */
const say = (text) => {
  byId("banner").hidden = !text;
  byId("banner").textContent = text.replaceAll(/say it with --column \w+=.*?:UNIT, in/g, "choose it beside the column:")
    .replaceAll(/ with --column \S+/g, " beside the column").replaceAll("--rate", "rows a second");
};

/** Asks the program; null where it refuses, which is said. */
const ask = async (what, body = "") => {
  try {
    const answer = await fetch(`import/${what}`, { method: "POST", body });
    const text = await answer.text();
    say(answer.ok ? "" : text);
    return answer.ok ? JSON.parse(text) : null;
  } catch {
    say("The program does not answer; is it still running?");
    return null;
  }
};

const element = (name, attributes = {}, ...children) => {
  const made = Object.assign(document.createElement(name), attributes);
  made.append(...children);
  return made;
};

/** Draws the course of a column: its places, and gaps where it has no number. */
const draw = (canvas, course, rows) => {
  const scale = window.devicePixelRatio || 1;
  canvas.width = canvas.clientWidth * scale;
  canvas.height = canvas.clientHeight * scale;
  const g = canvas.getContext("2d");
  const values = course.map(([, value]) => value).filter((value) => value !== null);
  const low = Math.min(...values), span = Math.max(...values) - low || 1;
  g.strokeStyle = getComputedStyle(document.body).getPropertyValue("--depth");
  g.lineWidth = 1.5 * scale;
  g.beginPath();
  let isDown = false;
  for (const [row, value] of course) {
    const x = row / Math.max(1, rows - 1) * (canvas.width - 4) + 2;
    if (value === null) isDown = false;
    else {
      const y = canvas.height - 3 - (value - low) / span * (canvas.height - 6);
      if (isDown) g.lineTo(x, y);
      else g.moveTo(x, y);
      isDown = true;
    }
  }
  g.stroke();
};

/** A row of the table: the column with its course, its role and its unit. */
const rowOf = (column, roles) => {
  const canvas = element("canvas", { role: "img", ariaLabel: `the course of ${column.name}` });
  const role = element("select", { ariaLabel: `the role of ${column.name}` }, ...["–", ...roles].map((name) => new Option(name, name)));
  role.value = column.role ?? "–";
  const list = element("datalist", { id: `units-${Math.random().toString(36).slice(2)}` });
  const unit = element("input", { ariaLabel: `the unit of ${column.name}`, size: 8 });
  unit.setAttribute("list", list.id);
  const offer = () => list.replaceChildren(...(UNITS[role.value] ?? "").split(" ").filter(Boolean).map((name) => new Option(name, name)));
  role.addEventListener("change", offer);
  offer();
  if (column.unit) unit.placeholder = column.unit;
  const name = element("td", {}, column.name, element("small", {}, `${column.file}, ${column.rows} rows`));
  const row = element("tr", {}, name, element("td", {}, canvas), element("td", {}, role), element("td", {}, unit, list));
  row.choice = () => role.value === "–" ? [] : [[role.value, `${role.value}=${column.choice}${unit.value ? `:${unit.value}` : ""}`]];
  row.draw = () => draw(canvas, column.course, column.rows);
  return row;
};

const showColumns = async () => {
  const answer = await ask("columns");
  if (!answer) return;
  byId("ask").hidden = byId("forget").hidden = answer.columns.length === 0;
  byId("taken").textContent = [...new Set(answer.columns.map((column) => column.file))].join(", ");
  const rows = answer.columns.map((column) => rowOf(column, answer.roles));
  byId("columns").replaceChildren(...rows);
  rows.forEach((row) => row.draw());
};

const take = async (files) => {
  for (const file of files) if (!await ask(`file/${encodeURIComponent(file.name)}`, file)) return;
  await showColumns();
};

/** The choices of the columns; roles that no column has are left empty, but for what has to be there. */
const asked = () => {
  const chosen = [...byId("columns").rows].flatMap((row) => row.choice());
  const roles = new Set(chosen.map(([role]) => role));
  const none = ["velocity", "reference", "tilt", "force", "enabled"].filter((role) => !roles.has(role)).map((role) => `${role}=none`);
  const number = (id) => byId(id).value === "" ? null : Number(byId(id).value);
  return {
    columns: [...chosen.map(([, choice]) => choice), ...none],
    rate_hz: number("rate"), counts_per_turn: number("counts"), undriven: byId("undriven").checked, split: number("split") ?? 0.6,
  };
};

/** Fields for the values of a rig's file: those that are nan are needed, those commented out may stay empty. */
const showRig = (rig) => {
  let section = "";
  const fields = rig.split("\n").flatMap((line) => {
    section = /^\[(\w+)\]/.exec(line)?.[1] ?? section;
    const [, comment, key, value, note] = /^(# )?(\w+) = (nan|-?[\d.]\S*)\s*#?\s*(.*)$/.exec(line) ?? [];
    if (!key || !["model", "actuator", "encoder"].includes(section)) return [];
    const input = element("input", { inputMode: "decimal", required: value === "nan", value: comment || value === "nan" ? "" : value });
    input.dataset.key = `${section}.${key}`;
    return [element("label", {}, `${key.replaceAll("_", " ")}${value === "nan" ? " *" : ""}`, input, element("small", {}, note))];
  });
  byId("values").replaceChildren(...fields);
  byId("rig").hidden = false;
  byId("found").hidden = true;
};

const follow = async () => {
  const now = await ask("progress");
  if (!now) return;
  byId("part").hidden = !now.stage;
  byId("part").value = now.part ?? 0;
  byId("stage").textContent = now.stage ? `${now.stage}, ${Math.round(100 * now.part)} %` : now.failed ?? "";
  byId("diagnose").disabled = Boolean(now.stage);
  if (now.stage) setTimeout(follow, PROGRESS_MS);
  else if (now.done) {
    byId("found").hidden = false;
    byId("report").src = "import/report.html";
  }
};

const diagnose = async () => {
  const inputs = [...byId("values").querySelectorAll("input")];
  const missing = inputs.find((input) => input.required && input.value.trim() === "");
  const wrong = inputs.find((input) => input.value.trim() !== "" && !Number.isFinite(Number(input.value.replace(",", "."))));
  if (missing ?? wrong) {
    say(`${(missing ?? wrong).dataset.key} ${missing ? "is needed" : "is no number"}; give it`);
    (missing ?? wrong).focus();
    return;
  }
  const given = inputs.filter((input) => input.value.trim() !== "");
  const values = Object.fromEntries(given.map((input) => [input.dataset.key, Number(input.value.replace(",", "."))]));
  if (await ask("diagnose", JSON.stringify(values))) await follow();
};

const drop = byId("drop");
for (const [name, isOver] of [["dragover", true], ["dragleave", false], ["drop", false]]) {
  document.body.addEventListener(name, (event) => {
    event.preventDefault();
    drop.dataset.over = isOver;
    if (name === "drop") void take(event.dataTransfer.files);
  });
}
byId("files").addEventListener("change", (event) => void take(event.target.files));
byId("forget").addEventListener("click", async () => {
  await ask("forget");
  location.reload();
});
byId("read").addEventListener("click", async () => {
  const answer = await ask("read", JSON.stringify(asked()));
  if (!answer) return;
  byId("notes").replaceChildren(...answer.notes.map((note) => element("li", {}, note)));
  showRig(answer.rig);
});
byId("diagnose").addEventListener("click", () => void diagnose());
await showColumns();
