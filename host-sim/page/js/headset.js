// The three-dimensional view in a headset (WebXR): the same limb and needle, drawn once for each eye. Its button is shown only where
// the browser has a headset. Nothing here moves the needle: that is the device's, or the hand's at the page.

import { t } from "./language.js";
import { WebGl } from "./limb_webgl.js";
import { multiply } from "./limb_shapes.js";
import { Tissue3d } from "./tissue3d.js";

/** The limb is shown this many times as large as it is. */
const MAGNIFIED = 4;
/** The needle's entry: right, up and back from where the head is at the beginning, m. */
const ENTRY_M = [0, -0.2, -0.6];
const M_PER_MM = MAGNIFIED * 1e-3;
/** From mm (x along the insertion, y towards the viewer, z down) to m (y up, z towards the viewer). */
const PLACED = [M_PER_MM, 0, 0, 0, 0, 0, M_PER_MM, 0, 0, -M_PER_MM, 0, 0, ...ENTRY_M, 1];

export class Headset {
  /** @param {HTMLButtonElement} button enters and leaves
   *  @param {Record<string, string>} colours of style.css, by name
   *  @param {(seconds: number) => object} step moves the picture on; returns what Tissue3d.draw needs
   *  @param {() => object} built what the limb is built from */
  constructor(button, colours, step, built) {
    Object.assign(this, { button, colours, step, built });
    this.session = null;
    this.frames = 0;
    button.addEventListener("click", () => this.toggle().catch((error) => this.say(t("picture.headset_none", { error: error.message }))));
    navigator.xr?.addEventListener?.("devicechange", () => this.offer());
    this.offer();
  }

  /** Shows the button where there is a headset. */
  async offer() {
    const has = await navigator.xr?.isSessionSupported?.("immersive-vr").catch(() => false);
    this.button.hidden = !has;
  }

  say(text) {
    this.button.textContent = text;
  }

  async toggle() {
    if (this.session) return this.session.end();
    const session = await navigator.xr.requestSession("immersive-vr");
    session.addEventListener("end", () => this.ended());
    const canvas = document.createElement("canvas");
    const renderer = new WebGl(canvas);
    await renderer.gl.makeXRCompatible();
    this.layer = new XRWebGLLayer(session, renderer.gl);
    session.updateRenderState({ baseLayer: this.layer, depthNear: 0.05, depthFar: 20 });
    this.limb = new Tissue3d(canvas, this.colours, renderer);
    this.space = await session.requestReferenceSpace("local");
    this.session = session;
    this.build();
    this.say(t("picture.headset_leave"));
    this.last = NaN;
    session.requestAnimationFrame((now, frame) => this.draw(now, frame));
  }

  ended() {
    this.session = this.limb = null;
    this.say(t("picture.headset"));
  }

  /** Another anatomy. */
  build() {
    if (this.limb) this.limb.build(...this.built());
  }

  draw(now, frame) {
    if (!this.session) return;
    this.session.requestAnimationFrame((next, later) => this.draw(next, later));
    const shown = this.step(Math.min(0.1, (now - this.last) / 1000 || 0));
    this.last = now;
    const pose = frame.getViewerPose(this.space);
    if (!shown || !pose) return;
    this.eyes = pose.views.map((view) => this.eye(view));
    this.eyes.forEach((eye, i) => this.limb.paint(...shown, { ...eye, clears: i === 0 }));
    this.frames++;
  }

  /** Returns what one eye sees: from where, in mm, and onto which part of the headset's picture. */
  eye(view) {
    const { transform, projectionMatrix } = view;
    const { x, y, width, height } = this.layer.getViewport(view);
    const at = transform.position;
    const [right, up, back] = [at.x - ENTRY_M[0], at.y - ENTRY_M[1], at.z - ENTRY_M[2]].map((m) => m / M_PER_MM);
    return {
      view: multiply(projectionMatrix, multiply(transform.inverse.matrix, PLACED)),
      eye: [right, back, -up],
      target: { framebuffer: this.layer.framebuffer, viewport: [x, y, width, height] },
    };
  }
}
