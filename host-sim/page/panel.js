// Numbers, lamps and words around the pictures. Written ten times a second: faster cannot be read.

const LIMITS = [
  [1, "Torque limit"],
  [2, "Slew limit"],
  [4, "Fading in"],
  [8, "Motor warm"],
  [16, "Added damping"],
  [32, "Force estimated"],
];
/** A limit in force for a millisecond stays lit so long, or the lamp would flicker. */
const LAMP_MS = 600;
/** The largest force is that of the last ten seconds. */
const STATES = {
  idle: ["Stopped, torque off", "off"],
  approach: ["Running: approaching", "good"],
  elastic: ["Running: pressing", "good"],
  puncture: ["Running: puncture", "good"],
  friction: ["Running: in tissue", "good"],
  withdrawal: ["Running: withdrawing", "good"],
  excitation: ["Running: test signal", "good"],
  fault: ["Fault, torque off", "bad"],
  unknown: ["State unknown", "warn"],
};

const byId = (id) => document.getElementById(id);

/** Writes only what has changed: layout costs, and screen readers repeat. */
function write(element, text, tone) {
  if (element.textContent !== text) element.textContent = text;
  if (tone !== undefined && element.dataset.tone !== tone) element.dataset.tone = tone;
}

function chip(name, text, tone) {
  write(byId(name), text);
  const chip = byId(`${name}-chip`);
  if (chip.dataset.tone !== tone) chip.dataset.tone = tone;
  if (chip.title !== text) chip.title = text;
}

/** A number with its sign in front of a fixed number of digits; no "−0.00". */
export function number(value, digits) {
  if (!Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/** Sets a screen reader's text for a slider: its value with the unit. */
function sayValue(slider) {
  const text = `${slider.value} ${slider.dataset.unit}`;
  if (slider.getAttribute("aria-valuetext") !== text) slider.setAttribute("aria-valuetext", text);
}

const whole = new Intl.NumberFormat("en-GB");

function stateWords(view, condition, played) {
  if (condition === "paused") return ["Recording paused", "off"];
  if (condition === "connecting") return ["Connecting…", "off"];
  if (condition !== "live" || !view.known) return ["No data", "warn"];
  const [text, tone] = STATES[view.state] ?? STATES.unknown;
  // What a recording shows has been: nothing runs.
  return played ? [text.replace("Running", "Recording"), tone] : [text, tone];
}

export class Panel {
  constructor() {
    this.sliders = document.querySelectorAll("input[type=range][data-unit]");
    this.lit = LIMITS.map(() => -Infinity);
    this.lamps = LIMITS.map(([, name]) => {
      const lamp = document.createElement("li");
      lamp.dataset.tone = "off";
      const dot = document.createElement("i");
      dot.setAttribute("aria-hidden", "true");
      lamp.append(dot, name);
      byId("limits").append(lamp);
      return lamp;
    });
  }

  scene(scene) {
    const source = { virtual: "virtual device", serial: scene.source.path, recording: "recording" }[scene.source.kind];
    const parts = [`Profile ${scene.profile}`, scene.procedure, source].filter(Boolean);
    write(byId("subtitle"), parts.join(" · "));
    byId("subtitle").title = parts.join(" · ");
    byId("lateral-row").hidden = true;
    this.played = scene.source.kind === "recording";
    byId("recording-chip").hidden = this.played;
  }

  device(device) {
    const name = /^0*$/.test(device.identity) ? "virtual" : device.identity;
    write(byId("device"), `${name}, ${device.firmware}, ${device.tick_hz / 1000} kHz`);
    byId("device").title = `Configuration ${device.config_hash}, ${device.dac_bits}-bit converter`;
  }

  /** Notes which limits are in force, at every frame, so that none is missed. */
  limits(bits, nowMs) {
    LIMITS.forEach(([bit], i) => {
      if (bits & bit) this.lit[i] = nowMs;
    });
  }

  /** Writes everything. `view` is that of main.js, `link` the server's last word on the link. */
  show(view, link, condition, nowMs) {
    const known = view.known;
    write(byId("depth"), known ? number(view.depth, 2) : "–");
    write(byId("under-skin"), known ? number(Math.max(0, view.depth * Math.sin(view.skinAngle)), 2) : "–");
    write(byId("motor-force"), known ? number(view.motor, 2) : "–");
    write(byId("force"), known ? number(view.force, 2) : "–");
    write(byId("speed"), known ? number(view.speed, 1) : "–");
    write(byId("torque"), known ? number(view.torque, 1) : "–");
    write(byId("tilt"), known ? number((view.skinAngle * 180) / Math.PI, 0) : "–");
    // Of the one law that has such a force, once the needle was turned in its tissue.
    if (known && view.lateral) byId("lateral-row").hidden = false;
    write(byId("lateral"), known ? number(view.lateral, 2) : "–");
    write(byId("peak"), known ? number(view.peak, 2) : "–");
    this.lamps.forEach((lamp, i) => {
      const tone = condition === "live" && nowMs - this.lit[i] < LAMP_MS ? "warn" : "off";
      if (lamp.dataset.tone !== tone) {
        lamp.dataset.tone = tone;
        lamp.setAttribute("aria-label", `${LIMITS[i][1]}: ${tone === "warn" ? "in force" : "not in force"}`);
      }
    });
    const [state, tone] = stateWords(view, condition, this.played);
    chip("state", state, tone);
    // A screen reader is told what has changed, not each phase of an insertion.
    const banner = byId("banner");
    write(byId("announcement"), banner.hidden ? (tone === "good" ? state.split(":")[0] : state) : banner.textContent);
    for (const slider of this.sliders) sayValue(slider);
    const powered = condition === "live" && view.state !== "idle" && view.state !== "fault";
    byId("start").disabled = condition !== "paused" && (condition !== "live" || powered);
    byId("zero").disabled = condition !== "live" || powered;
    if (link) this.link(link, condition);
  }

  link(link, condition) {
    const lost = link.lost_frames + link.lost_samples;
    write(byId("frames"), whole.format(link.frames));
    write(byId("lost-frames"), whole.format(link.lost_frames), link.lost_frames ? "bad" : "");
    write(byId("lost-samples"), whole.format(link.lost_samples), link.lost_samples ? "bad" : "");
    if (condition === "lost") chip("link", "No link", "bad");
    else if (condition === "stale" || !link.connected) chip("link", "Device silent", "bad");
    else if (lost) chip("link", `Link: ${whole.format(lost)} lost`, "warn");
    else chip("link", "Link: nothing lost", "good");
    const recording = link.recording;
    const name = recording ? recording.file.split(/[\\/]/).at(-1) : "";
    if (condition === "lost") chip("recording", "Recording unknown", "off");
    else if (recording) chip("recording", `Recording ${name}, ${(recording.bytes / 1e6).toFixed(1)} MB`, "bad");
    else chip("recording", "Not recording", "off");
  }

  timing(timing) {
    const ticks = timing.missed_ticks ? `, ${whole.format(timing.missed_ticks)} late` : "";
    const codes = timing.late_codes ? `, ${whole.format(timing.late_codes)} past the converter's instant` : "";
    write(byId("tick"), `${timing.longest_tick_us.toFixed(1)} µs${ticks}${codes}`);
  }

  /** One sentence across the page, or nothing. */
  banner(text) {
    const banner = byId("banner");
    if (banner.textContent !== text) banner.textContent = text;
    if (banner.hidden !== (text === "")) banner.hidden = text === "";
  }
}
