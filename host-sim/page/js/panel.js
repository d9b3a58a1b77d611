// Numbers, lamps and words around the pictures. Written ten times a second: faster cannot be read.

import { count, number, t } from "./language.js";

const LIMITS = [
  [1, "limit.torque"],
  [2, "limit.slew"],
  [4, "limit.fade"],
  [8, "limit.warm"],
  [16, "limit.damping"],
  [32, "limit.estimated"],
];
/** A limit in force for a millisecond stays lit so long, or the lamp would flicker. */
const LAMP_MS = 600;
/** States: their tones; their words are `state.NAME`. */
const STATES = {
  idle: "off", approach: "good", elastic: "good", puncture: "good", friction: "good", withdrawal: "good", excitation: "good", fault: "bad", unknown: "warn",
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

/** Sets a screen reader's text for a slider: its value with the unit. */
function sayValue(slider) {
  const text = `${slider.value} ${t(`unit.${slider.dataset.unit}`)}`;
  if (slider.getAttribute("aria-valuetext") !== text) slider.setAttribute("aria-valuetext", text);
}

function stateWords(view, condition, played) {
  if (condition === "paused") return [t("state.paused"), "off"];
  if (condition === "connecting") return [t("page.connecting"), "off"];
  if (condition !== "live" || !view.known) return [t("state.no_data"), "warn"];
  const state = Object.hasOwn(STATES, view.state) ? view.state : "unknown";
  const text = t(`state.${state}`);
  // What a recording shows has been: nothing runs.
  return [played ? text.replace(t("state.running"), t("state.recording")) : text, STATES[state]];
}

export class Panel {
  constructor() {
    this.sliders = document.querySelectorAll("input[type=range][data-unit]");
    this.coolMs = -Infinity;
    this.lit = LIMITS.map(() => -Infinity);
    this.lamps = LIMITS.map(([, name]) => {
      const lamp = document.createElement("li");
      lamp.dataset.tone = "off";
      const dot = document.createElement("i");
      dot.setAttribute("aria-hidden", "true");
      const words = document.createElement("span");
      words.textContent = t(name);
      lamp.append(dot, words);
      if (name === "limit.warm") this.warm = words;
      byId("limits").append(lamp);
      return lamp;
    });
  }

  scene(scene) {
    const source = { virtual: t("source.virtual"), serial: scene.source.path, recording: t("source.recording") }[scene.source.kind];
    const parts = [t("source.profile", { name: scene.profile }), scene.procedure, source].filter(Boolean);
    write(byId("subtitle"), parts.join(" · "));
    byId("subtitle").title = parts.join(" · ");
    byId("lateral-row").hidden = true;
    this.played = scene.source.kind === "recording";
    byId("recording-chip").hidden = this.played;
  }

  device(device) {
    const name = /^0*$/.test(device.identity) ? t("source.virtual_name") : device.identity;
    write(byId("device"), `${name}, ${device.firmware}, ${device.tick_hz / 1000} kHz`);
    byId("device").title = t("source.device_title", { hash: device.config_hash, bits: device.dac_bits });
  }

  /** Counts down on the motor's lamp: its heat is unknown for so many seconds more. */
  cool(seconds, nowMs) {
    this.coolMs = nowMs + 1e3 * seconds;
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
    write(byId("under-skin"), known ? number(Math.max(0, view.underSkin), 2) : "–");
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
        lamp.setAttribute("aria-label", t(tone === "warn" ? "limit.on" : "limit.off", { name: t(LIMITS[i][1]) }));
      }
    });
    const cooling = Math.ceil((this.coolMs - nowMs) / 1e3);
    write(this.warm, condition === "live" && cooling > 0 ? t("limit.cooling", { seconds: count(cooling) }) : t("limit.warm"));
    const [state, tone] = stateWords(view, condition, this.played);
    chip("state", state, tone);
    // A screen reader announces what has changed, not each phase of an insertion.
    const banner = byId("banner");
    write(byId("announcement"), banner.hidden ? (tone === "good" ? state.split(":")[0].trim() : state) : banner.textContent);
    for (const slider of this.sliders) sayValue(slider);
    const powered = condition === "live" && view.state !== "idle" && view.state !== "fault";
    byId("start").disabled = condition !== "paused" && (condition !== "live" || powered);
    byId("zero").disabled = condition !== "live" || powered;
    if (link) this.link(link, condition);
  }

  link(link, condition) {
    const lost = link.lost_frames + link.lost_samples;
    write(byId("frames"), count(link.frames));
    write(byId("lost-frames"), count(link.lost_frames), link.lost_frames ? "bad" : "");
    write(byId("lost-samples"), count(link.lost_samples), link.lost_samples ? "bad" : "");
    if (condition === "lost") chip("link", t("link.none"), "bad");
    else if (condition === "stale" || !link.connected) chip("link", t("link.silent"), "bad");
    else if (lost) chip("link", t("link.lost", { count: count(lost) }), "warn");
    else chip("link", t("link.good"), "good");
    const recording = link.recording;
    const name = recording ? recording.file.split(/[\\/]/).at(-1) : "";
    if (condition === "lost") chip("recording", t("recording.unknown"), "off");
    else if (recording) chip("recording", t("recording.on", { name, megabytes: number(recording.bytes / 1e6, 1) }), "bad");
    else chip("recording", t("recording.off"), "off");
  }

  timing(timing) {
    const ticks = timing.missed_ticks ? t("reading.late", { count: count(timing.missed_ticks) }) : "";
    const codes = timing.late_codes ? t("reading.codes", { count: count(timing.late_codes) }) : "";
    write(byId("tick"), `${number(timing.longest_tick_us, 1)} µs${ticks}${codes}`);
  }

  /** One sentence across the page, or nothing. */
  banner(text) {
    const banner = byId("banner");
    if (banner.textContent !== text) banner.textContent = text;
    if (banner.hidden !== (text === "")) banner.hidden = text === "";
  }
}
