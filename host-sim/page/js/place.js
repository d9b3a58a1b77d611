// Where the needle enters a body: the site, the point of entry, the direction and the turn of the limb. A new place is an edited patient: the
// device gets the layers along the new line once the needle is outside.

import { t } from "./language.js";

const byId = (id) => document.getElementById(id);
/** Sliders and the keys of a patient's [body] that they stand for. */
const SLIDERS = { "place-along": "along_mm", "place-around": "around_deg", "place-azimuth": "azimuth_deg", "place-turn": "turn_deg" };
/** Patients with a body, by their sites. */
const SITES = { shoulder: "shoulder-joint", forearm: "forearm", knee: "knee", hip: "hip" };
/** A hand that moves a slider is waited for, ms. */
const PAUSE_MS = 250;
/** A needle that has been turned by more than this stays so for a while before its new line is asked for, degrees and ms. */
const TURNED_DEG = 0.6;
const STILL_MS = 500;
/** The needle is drawn back to here before it enters elsewhere, mm. */
const OUTSIDE_MM = -5;

export class PlaceEditor {
  /** @param {import("./link.js").Link} link where wishes go
   *  @param {import("./hand.js").Hand} hand which draws the needle out */
  constructor(link, hand) {
    this.link = link;
    this.hand = hand;
    this.row = byId("place");
    this.note = byId("place-note");
    this.site = byId("site");
    this.profile = null;
    /** The wish that is to be asked: keys of the body, `incline_deg` or `patient`. */
    this.wish = null;
    this.due = Infinity;
    this.skinTilt = 0;
    this.turned = { degrees: NaN, since: 0, refused: NaN };
    this.asked = false;
    /** The demo is to go on once the needle is elsewhere. */
    this.givesBack = false;
    for (const [id, key] of Object.entries(SLIDERS)) byId(id).addEventListener("input", (event) => this.want({ [key]: Number(event.target.value) }));
    this.site.addEventListener("change", () => this.choose(SITES[this.site.value] ?? "adult"));
  }

  /** Another anatomy: its limb's length. */
  setScene(scene) {
    this.body = scene.body ?? null;
    this.skinTilt = scene.skin_tilt_rad;
    this.row.hidden = !this.body || !this.profile;
    this.site.value = this.body?.name ?? "";
    if (!this.body) return;
    [byId("place-along").min, byId("place-along").max] = this.body.reach_mm;
    this.show();
  }

  /** The server's word: the patient that counts, and what became of the last wish. */
  follow({ profile, answer }) {
    this.profile = profile;
    this.row.hidden = !this.body;
    byId("site-row").hidden = false;
    if (this.asked) {
      this.asked = false;
      const refused = answer && !answer.taken;
      this.say(refused ? answer.reason : "");
      if (refused) this.turned.refused = this.turned.degrees;
      if (this.givesBack) this.link.send({ do: "demo" });
      this.givesBack = false;
    }
    this.show();
  }

  /** Another site, with its patient's own entry. */
  choose(patient) {
    this.wish = { patient };
    this.due = performance.now();
  }

  /** A click on the skin enters there. */
  enter({ along, around }) {
    if (this.body && Number.isFinite(along)) this.want({ along_mm: along, around_deg: around }, 0);
  }

  want(keys, pause = PAUSE_MS) {
    if (!this.profile?.body) return;
    const { patient, ...others } = this.wish ?? {};
    this.wish = { ...others, ...keys };
    this.due = performance.now() + pause;
    this.show();
  }

  say(text) {
    if (this.note.textContent !== text) this.note.textContent = text;
  }

  /** Called before each picture. */
  tell(view) {
    const now = performance.now();
    if (this.profile?.body) this.watchTilt(view, now);
    if (!this.wish || now < this.due || this.asked) return;
    if (view.depth > 0) {
      if (!view.person) this.givesBack = true;
      if (this.hand.movable) this.hand.want(OUTSIDE_MM);
      this.say(this.hand.movable ? t("place.drawn_out") : t("place.draw_out"));
      return;
    }
    const message = this.wish.patient ? { do: "choose", patient: this.wish.patient } : { do: "edit", profile: this.edited(view) };
    this.wish = null;
    this.asked = this.link.send(message);
    if (!this.asked) this.say(t("patient.unreachable"));
  }

  /** The patient with the entry that is wished, for the needle as it is held now. */
  edited(view) {
    const { incline_deg: incline = inclination(view, this.skinTilt), ...body } = this.wish;
    const profile = structuredClone(this.profile);
    profile.entry_deg = incline;
    Object.assign(profile.body, body);
    return profile;
  }

  /** A needle that has been turned outside of the body gets the layers of its new line. */
  watchTilt(view, now) {
    const degrees = inclination(view, this.skinTilt);
    if (Math.abs(degrees - this.turned.degrees) > TURNED_DEG / 2 || Number.isNaN(this.turned.degrees)) {
      this.turned.degrees = degrees;
      this.turned.since = now;
    }
    const isNew = Math.abs(degrees - this.profile.entry_deg) > TURNED_DEG && Math.abs(degrees - this.turned.refused) > TURNED_DEG;
    if (view.depth < 0 && isNew && now - this.turned.since > STILL_MS && !this.wish && !this.asked) {
      this.want({ incline_deg: degrees }, 0);
    }
  }

  /** Sliders and numbers as wished, else as they count. */
  show() {
    const body = { ...(this.profile?.body ?? this.body), ...this.wish };
    for (const [id, key] of Object.entries(SLIDERS)) {
      const value = Math.round(body[key] ?? 0);
      byId(id).value = value;
      byId(`${id}-value`).textContent = `${value} ${key.endsWith("_mm") ? "mm" : "°"}`;
    }
  }
}

/** The needle's inclination in degrees, as a patient's file may say it. */
function inclination(view, skinTilt) {
  const degrees = ((view.tilt - skinTilt) * 180) / Math.PI;
  return Math.min(90, Math.max(5, Math.round(degrees * 10) / 10));
}
