// The second view of the picture: limb in three dimensions and ultrasound, started only when somebody looks at it.

import { Headset } from "./headset.js";
import { t } from "./language.js";
import { WebGl } from "./limb_webgl.js";
import { WebGpu } from "./limb_webgpu.js";
import { Picture } from "./picture.js";
import { Tissue3d } from "./tissue3d.js";
import { Ultrasound } from "./ultrasound.js";

const byId = (id) => document.getElementById(id);

export class BodyView {
  constructor(colours) {
    this.colours = colours;
    this.open = false;
    this.picture = null;
    this.waiting = null;
    this.scene = null;
    this.stats = { frames: 0, stepMs: NaN, imageMs: NaN };
    window.__body = this.stats;
    this.model = byId("tissue-model");
    this.model.addEventListener("change", () => this.picture && this.build());
    byId("view-section").addEventListener("click", () => this.show(false));
    byId("view-body").addEventListener("click", () => this.show(true));
    if (location.hash === "#body") this.show(true);
  }

  /** Whose needle the slider moves. */
  setHand(hand) {
    this.hand = hand;
    this.depth = byId("needle-depth");
    this.depth.addEventListener("input", () => hand.want(Number(this.depth.value)));
  }

  /** Goes to this view or back to the section. */
  show(open) {
    this.open = open;
    document.body.dataset.view = open ? "body" : "section";
    byId("view-section").setAttribute("aria-pressed", String(!open));
    byId("view-body").setAttribute("aria-pressed", String(open));
    if (open && !this.waiting) this.waiting = this.start();
  }

  async start() {
    try {
      const picture = await Picture.load();
      await this.openLimb(new URLSearchParams(location.search).get("graphics"));
      this.ultrasound = new Ultrasound(byId("ultrasound"), this.colours);
      this.headset = new Headset(byId("headset"), this.colours, (seconds) => this.stepForHeadset(seconds), () => [this.picture, this.drawn]);
      this.stats.headset = this.headset;
      // Last, for there is nothing to draw with before.
      this.picture = picture;
      if (this.scene) this.build();
    } catch (error) {
      byId("body-note").textContent = t("picture.cannot", { cause: error.message });
    }
  }

  /** WebGPU where there is one, else WebGL 2; `?graphics=webgpu` takes one without a graphics processor, `?graphics=webgl2` none. */
  async openLimb(wanted) {
    const canvas = byId("limb");
    let renderer = null;
    if (wanted !== "webgl2") {
      renderer = await WebGpu.open(canvas, wanted === "webgpu").catch((error) => console.warn(`WebGPU: ${error.message}`));
    }
    renderer ??= new WebGl(canvas);
    this.limb = new Tissue3d(canvas, this.colours, renderer);
    // A click on the skin is a wish to enter there; the probe is dragged over it.
    this.limb.clicked = (found) => this.entered?.(found);
    this.limb.probeMoved = (place, event) => this.ultrasound?.drag(place, event);
    this.stats.graphics = renderer.name;
    renderer.lost?.then(() => this.replaceLimb());
  }

  /** WebGPU is gone: a canvas that it has had takes nothing else, so another one replaces it. */
  async replaceLimb() {
    const canvas = byId("limb");
    this.limb = null;
    canvas.replaceWith(canvas.cloneNode());
    await this.openLimb("webgl2");
    if (this.scene && this.picture?.built) this.build();
  }

  /** Another anatomy. */
  setScene(scene) {
    this.scene = scene;
    this.depth.max = scene.needle.length_mm;
    // A real device and a recording have no hand that a slider could move.
    this.depth.disabled = !scene.hand;
    this.depth.closest("label").hidden = !scene.hand;
    // Table 1 is skin, vessel and skin.
    this.model.disabled = !scene.vessel || Boolean(scene.body);
    byId("model-row").hidden = Boolean(scene.body);
    if (this.model.disabled) this.model.value = "limb";
    if (this.picture) this.build();
  }

  build() {
    const angle = this.scene.tilt_rad - this.scene.skin_tilt_rad;
    const table1 = this.model.value === "table-1";
    if (!this.picture.build(this.scene, angle, table1)) {
      byId("body-note").textContent = t("picture.no_anatomy");
      return;
    }
    byId("body-note").textContent = "";
    this.drawn = table1 ? asSlabs(this.scene) : this.scene;
    this.limb?.build(this.picture, this.drawn);
    this.headset?.build();
    this.ultrasound.build(this.picture);
    this.stats.particles = this.picture.particles;
    this.stats.structures = this.scene.layers.map((layer) => layer.structure ?? layer.name);
    this.stats.entry = this.scene.body ?? null;
    // Across the needle's plane: it moves where the limb turns.
    this.stats.skinBesideMm = this.picture.skin(0, 8, 0).depth;
    this.stats.probe = this.ultrasound.probe;
    this.stats.sight = (x, y) => this.limb?.sight({ clientX: x, clientY: y }) ?? null;
  }

  happen(event) {
    if (this.picture?.built) this.picture.happen(event);
  }

  /** The needle as the device has it. */
  needle() {
    const { depth, angle, tilt, vessel, originX, originY } = this.view;
    return { depth, angle: angle ?? tilt - this.scene.skin_tilt_rad, origin: [originX, originY], flashback: vessel === "in_lumen" };
  }

  /** Moves the tissue on by the time since the last picture; the first has none. */
  step(seconds) {
    this.picture.step(Math.max(seconds, 1 / 120), this.needle());
  }

  /** Moves the tissue on for a headset; what it draws. */
  stepForHeadset(seconds) {
    if (!this.view || !this.picture?.built) return null;
    this.step(seconds);
    return [this.picture, this.needle(), this.ultrasound.probe];
  }

  /** One picture; `view` as main.js keeps it. */
  draw(view) {
    if (!this.open || !this.picture?.built) return;
    this.view = view;
    // While a person holds the slider it says where the hand wants to be, else where the needle is.
    if (!view.person || document.activeElement !== this.depth) this.depth.value = view.depth.toFixed(1);
    const begin = performance.now();
    // In a headset its own pictures move the tissue on: there the page's may stop.
    if (!this.headset?.session) this.step(view.seconds);
    const stepped = performance.now();
    this.limb?.draw(this.picture, this.needle(), this.ultrasound.probe);
    const drawn = performance.now();
    this.ultrasound.draw(this.picture, view.seconds, view.depth);
    if (this.scene.source.kind !== "recording") this.ultrasound.report(this.hand.link, performance.now());
    this.stats.stepMs = stepped - begin;
    this.stats.drawMs = drawn - stepped;
    this.stats.imageMs = performance.now() - drawn;
    this.stats.needle = this.needle();
    this.stats.share = this.ultrasound.seen?.share ?? NaN;
    this.stats.frames++;
  }
}

/** The scene of Table 1 of Paper 000: the vessel is a slab between two slabs of skin. */
function asSlabs(scene) {
  const layers = scene.layers.map((layer) => ({ ...layer, name: layer.is_vessel ? "lumen" : "skin", is_vessel: false, is_far_wall: false }));
  return { ...scene, layers, vessel: null };
}
