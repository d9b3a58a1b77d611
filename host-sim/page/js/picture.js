// Tissue and ultrasound as picture-wasm computes them; host-sim/page/picture-wasm/src/lib.rs is the other side and documents each function.

import { bytes } from "./bytes.js";

/** By the numbers of picture-wasm; 7 to 9 are vessels. */
export const TISSUES = ["skin", "fat", "muscle", "other", "bursa", "tendon", "cartilage", "lumen", "lumen", "lumen"];
const VESSEL = 7;
const FAR_WALL = 8;
export const KINDS = { skinBehind: 0, skinBefore: 1, section: 2, vesselBehind: 3, vesselBefore: 4, insideBehind: 5, insideBefore: 6 };
export const LINES = 256;
export const SAMPLES = 1024;
export const SLICES = 64;
/** The part of the limb along the insertion that is drawn, as in host-sim/picture/tissue/src/configuration.rs. */
export const ALONG_MM = [-9.1, 26];
export const HALF_WIDTH_MM = 10.4;
export const LIMB_RADIUS_MM = 42;
export const IMAGE_WIDTH_MM = 24;

export class Picture {
  /** Fetches and starts it; fails where the browser cannot. */
  static async load() {
    const { instance } = await WebAssembly.instantiate(await bytes("picture.wasm"), {});
    return new Picture(instance.exports);
  }

  constructor(core) {
    this.core = core;
    this.built = false;
  }

  /** Builds the tissue of a scene at an angle to the skin (rad), or Table 1 of Paper 000 instead; false where it cannot be drawn. */
  build(scene, angle, table1 = false) {
    const numbers = [scene.layers.length];
    for (const layer of scene.layers) {
      const tissue = layer.is_vessel ? VESSEL : layer.is_far_wall ? FAR_WALL : Math.max(0, TISSUES.indexOf(layer.name));
      numbers.push(tissue, layer.depth_mm, layer.puncture_travel_mm ?? -1, layer.friction_n_per_mm);
    }
    numbers.push(scene.vessel?.width_mm ?? NaN, scene.vessel?.offset_mm ?? 0, angle, scene.needle.diameter_mm);
    numbers.push(...how(scene, table1));
    this.floats(this.core.input(), numbers.length).set(numbers);
    this.built = this.core.build(numbers.length) === 1;
    return this.built;
  }

  /** Follows an event of the device. */
  happen(event) {
    if (event.layer === null || event.layer === undefined) return;
    if (["puncture", "vessel", "far_wall", "flashback", "in_track"].includes(event.kind)) this.core.tell(event.layer, 1);
    if (event.kind === "exit") this.core.tell(event.layer, 0);
  }

  /** Moves time on; `origin` is where the needle's line has depth 0, along the skin and below it. */
  step(seconds, { depth, angle, origin }) {
    this.core.step(seconds, depth, angle, origin[0], origin[1]);
  }

  // The memory moves when it grows: a pointer is asked for first, then the memory is looked at.

  floats(pointer, count) {
    return new Float32Array(this.core.memory.buffer, pointer, count);
  }

  get particles() { return this.core.particles(); }

  get points() { return this.floats(this.core.points(), 4 * this.core.particles()); }

  get normals() { return this.floats(this.core.normals(), 4 * this.core.particles()); }

  get lumen() { return this.floats(this.core.lumen(), 2 * SLICES); }

  /** Returns the surfaces to draw: `{ kind, layer, triangles }`; the triangles are copies. */
  surfaces() {
    return Array.from({ length: this.core.surfaces() }, (_, i) => {
      const [pointer, count] = [this.core.surface_triangles(i), 3 * this.core.surface_triangle_count(i)];
      const triangles = new Uint32Array(this.core.memory.buffer, pointer, count).slice();
      const tissue = TISSUES[this.core.surface_tissue(i)];
      return { kind: this.core.surface_kind(i), layer: this.core.surface_layer(i), tissue, triangles };
    });
  }

  /** Returns the depth of the skin under a place of the limb, mm, and the lean of a probe that stands upright there, rad. */
  skin(along, across, azimuth) {
    return { depth: this.core.skin(along, across), lean: this.core.upright(along, across, azimuth) };
  }

  /** Returns the place where a line of sight meets the skin: `{ place, along, around }`, of which the last two are a body's, or null. */
  pick(eye, direction) {
    this.floats(this.core.input(), 6).set([...eye, ...direction]);
    const pointer = this.core.pick();
    if (!pointer) return null;
    const [x, y, z, along, around] = this.floats(pointer, 5);
    return { place: [x, y, z], along, around };
  }

  /** Returns the depth of the ultrasound image in this anatomy, mm. */
  get imageDepth() { return this.core.image_depth(); }

  /** An ultrasound image: brightness, line after line. */
  image(probe, seconds, gain) {
    this.core.probe(probe.along, probe.across, probe.azimuth, probe.lean);
    const pointer = this.core.image(seconds, gain);
    return new Uint8Array(this.core.memory.buffer, pointer, LINES * SAMPLES);
  }

  /** Returns how much of the needle the last image shows, and the mean so far. */
  get seen() {
    const seen = (what) => this.core.seen(what);
    return { share: seen(0), tip: seen(1) === 1, beside: seen(2), tipShare: seen(3), meanShare: seen(4), inserted: seen(5) };
  }
}

/** Returns the kind of tissue to build: Table 1 of Paper 000 (1), a body with its place (2), or level layers (0). */
function how(scene, table1) {
  if (table1) return [1];
  const body = scene.body;
  if (!body) return [0];
  return [2, body.site, body.along_mm, body.around_deg, body.azimuth_deg, body.turn_deg, body.incline_deg, body.fat_mm];
}
