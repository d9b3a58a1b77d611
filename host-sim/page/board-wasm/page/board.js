// The page of a real board: connects, shows what it says, and offers the guides and the update. It begins nothing by itself, and Stop is always there.

import * as core from "./core.js";
import { GuideSteps, write } from "./guide_steps.js";
import { Port } from "./port.js";
import { update } from "./update.js";

const byId = (id) => document.getElementById(id);
const SHOW_MS = 100;
let port = null;
let updating = false;

const steps = new GuideSteps((message) => core.answer(message));

function say(text, tone = "bad") {
  const banner = byId("banner");
  banner.hidden = !text;
  banner.dataset.tone = tone;
  write(banner, text);
}

async function connect() {
  try {
    const chosen = new Port(await navigator.serial.requestPort(), ended);
    await chosen.open();
    port = chosen;
    say("");
  } catch (error) {
    // A person who closes the browser's list has chosen nothing.
    if (error.name !== "NotFoundError") say(`The port cannot be opened (${error.message}). Close other programs that use it and connect again.`);
  }
  show();
}

function ended(why) {
  port = null;
  steps.clear();
  say(why);
  show();
}

function value(id, text) {
  write(byId(id), text ?? "–");
}

function show() {
  document.body.dataset.port = port ? "open" : "closed";
  byId("connect").disabled = updating || !("serial" in navigator);
  write(byId("connect"), port ? "Disconnect" : "Connect");
  byId("update").disabled = updating || port !== null || !("usb" in navigator) || !byId("image").files.length;
  document.body.toggleAttribute("data-guide", false);
  byId("clear").hidden = true;
  if (!port) {
    document.body.toggleAttribute("data-live", false);
    return value("state", "Not connected");
  }
  for (const message of core.tell(port.now)) {
    if (message.type === "board") showBoard(message);
    if (message.type === "refused") say(`${message.why[0].toUpperCase()}${message.why.slice(1)}.`);
    if (message.type === "guide") {
      document.body.toggleAttribute("data-guide", true);
      write(byId("guide-title"), message.title);
      steps.follow(message);
    }
  }
  byId("download").hidden = core.file() === "";
  // An open guide deals with the faults of its own.
  const isOpen = document.body.hasAttribute("data-guide") && !steps.ended;
  byId("clear").hidden = !byId("fault").hasAttribute("data-bad") || isOpen;
}

function showBoard({ live, board, needle, reading, fault, crash, timing, frames, lost_frames, lost_samples, events }) {
  document.body.toggleAttribute("data-live", live);
  value("state", live ? needle?.state ?? "live" : "silent");
  value("depth", needle && needle.depth_mm.toFixed(2));
  value("force", needle && needle.force_n.toFixed(3));
  value("angle", needle && needle.angle_deg.toFixed(1));
  value("speed", needle && needle.speed_mm_s.toFixed(1));
  value("tilt", reading && reading.tilt_deg.toFixed(1));
  value("counts", reading && String(reading.counts));
  value("limits", needle?.limits.join(", ") || "none");
  value("fault", fault ?? "none");
  byId("fault").toggleAttribute("data-bad", fault !== null);
  value("crash", crash ?? "none");
  byId("crash").toggleAttribute("data-bad", crash !== null);
  value("firmware", board && `${board.firmware}, ${board.build}`);
  value("identity", board?.identity);
  value("scale", board && `roller ${board.roller_radius_mm.toFixed(2)} mm, full scale ${board.full_scale_torque_mnm.toFixed(1)} mN·m`);
  value("late", timing && `${timing.late_codes} late codes, ${timing.missed_ticks} missed ticks`);
  value("tick", timing?.tick_us && `${timing.tick_us.toFixed(1)} µs`);
  value("lost", `${frames} frames, ${lost_frames} lost; ${lost_samples} samples lost`);
  const lines = events.map(({ t_s, text }) => `${t_s.toFixed(2)} s  ${text}`);
  if (byId("happened").dataset.shown === lines.join("\n")) return;
  byId("happened").dataset.shown = lines.join("\n");
  byId("happened").replaceChildren(...lines.map((line) => Object.assign(document.createElement("li"), { textContent: line })));
}

function begin(task) {
  const refused = core.begin(task);
  say(refused && `${refused[0].toUpperCase()}${refused.slice(1)}.`);
  if (!refused) steps.clear();
  show();
}

function stop() {
  core.stop();
  port?.exchange(new Uint8Array());
}

const number = (id) => Number(byId(id).value);

function offer(name, text) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "application/toml" }));
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}

async function updateNow() {
  updating = true;
  say("");
  show();
  const progress = byId("progress");
  try {
    const image = new Uint8Array(await byId("image").files[0].arrayBuffer());
    await update(image, (doing, share) => {
      progress.value = share;
      write(byId("doing"), `${doing} ${Math.round(100 * share)} %`);
    });
    say("Updated. Plug the board in again, without its boot jumper, and connect.", "good");
  } catch (error) {
    if (error.name !== "NotFoundError") say(`Not updated: ${error.message}.`);
  }
  updating = false;
  show();
}

byId("connect").addEventListener("click", () => (port ? port.close() : connect()));
byId("stop").addEventListener("click", stop);
document.addEventListener("keydown", ({ key }) => key === "Escape" && stop());
byId("clear").addEventListener("click", () => core.clear());
byId("commission").addEventListener("click", () => begin({
  do: "commission", turns: number("turns"), pull_mm: number("pull"), counts_per_turn: byId("per-turn").value ? number("per-turn") : null,
}));
byId("weigh").addEventListener("click", () => begin({ do: "weigh", grams: number("grams"), correct: byId("correct").checked }));
byId("compensate").addEventListener("click", async () => {
  const [file] = byId("rig").files;
  if (!file) return say("Choose the patched-rig.toml that host-sim diagnose wrote.");
  begin({ do: "compensate", rig: await file.text(), share: number("share") / 100 });
});
byId("leave").addEventListener("click", () => {
  core.answer({ do: "leave" });
  if (steps.ended) steps.clear();
});
byId("download").addEventListener("click", () => offer("device.toml", core.file()));
byId("image").addEventListener("change", show);
byId("update").addEventListener("click", updateNow);

if (!("serial" in navigator)) say("This browser has no WebSerial: use Chrome, Edge or Chromium on a computer.");
await core.load();
document.body.dataset.ready = "";
setInterval(show, SHOW_MS);
show();
