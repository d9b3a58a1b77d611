// What the needle does to the layers in the picture: which are touched, which have given way, how far each is dented, where the tip
// is as seen from the vessel. Only a picture: the force comes from the device, and this follows its events and depths.

import { Vein } from "./vein.js";

/** The time in which tissue springs back after a puncture, s. */
const RECOVERY_S = 0.12;
/** The sideways reach of a dent, in mm. */
const REACH_SKIN_MM = 4;
const REACH_VESSEL_MM = 1.6;
/** Friction drags a punctured surface along: mm for each N. */
const DRAG_MM_PER_N = 0.35;
const LARGEST_DRAG_MM = 0.7;
/** Less than this is not seen. */
const SMALLEST_DENT_MM = 0.002;
/** Layers are met along the needle at depth / sin(angle); the device does not distinguish angles
 *  flatter than this. */
const FLATTEST = 0.087;

export class Tissue {
  /** @param {object} scene depths are perpendicular to the skin; `vessel` is null or { axis_mm, height_mm, width_mm, offset_mm } */
  constructor(scene) {
    this.layers = scene.layers.map((layer) => ({
      ...layer, of_vessel: layer.is_vessel || layer.is_far_wall, touched: false, given: false, dent: 0, along: 0,
    }));
    this.needle = scene.needle;
    this.beside = scene.beside ?? [];
    /** The section of a body, structure after structure, or null for level layers. */
    this.outlines = scene.body?.outlines ?? null;
    const vessel = scene.vessel;
    this.vessel = vessel && {
      ...vessel, near_mm: vessel.axis_mm - vessel.height_mm / 2, far_mm: vessel.axis_mm + vessel.height_mm / 2,
    };
    /** "outside", "touching", "in_lumen", "through" or "beside". */
    this.place = "outside";
    /** Blood in the hub: it stays until the needle has left the skin. */
    this.flashback = false;
    this.vein = new Vein();
  }

  /** Follows an event of the device. */
  happen(event) {
    this.vein.happen(event, this);
    if (event.kind === "flashback") this.flashback = true;
    if (event.kind === "started" || event.layer === null) return;
    const layer = this.layers[event.layer];
    if (!layer) return;
    if (event.kind === "contact") layer.touched = true;
    if (["puncture", "vessel", "in_track"].includes(event.kind)) {
      layer.touched = layer.given = true;
      if (layer.structure === "artery") this.flashback = true;
    }
    if (event.kind === "exit") {
      layer.touched = layer.given = false;
      if (event.layer === 0) this.flashback = false;
    }
  }

  /** Follows the depth along the needle at `angle` to the skin, whose line has depth 0 at `originY` mm below it, and what the device says
   *  of the vessel. */
  move(depth, angle, force, place, seconds, originY = 0) {
    this.place = place;
    if (place === "in_lumen") this.flashback = true;
    const relaxed = 1 - Math.exp(-seconds / RECOVERY_S);
    const sine = Math.sin(Math.max(angle, FLATTEST));
    for (const layer of this.layers) {
      layer.along = (layer.depth_mm - originY) / sine;
      if (layer.puncture_travel_mm === null) continue;
      const past = depth - layer.along;
      if (layer.touched && !layer.given && past > 0) {
        layer.dent = past;
        continue;
      }
      const inside = layer.given && past > 0;
      const drag = inside ? Math.max(-LARGEST_DRAG_MM, Math.min(LARGEST_DRAG_MM, DRAG_MM_PER_N * force)) : 0;
      layer.dent += relaxed * (drag - layer.dent);
      if (drag === 0 && Math.abs(layer.dent) < SMALLEST_DENT_MM) layer.dent = 0;
    }
  }

  /** Returns the tissue around the vessel: the layer above its near wall. */
  get around() {
    const vessel = this.layers.findIndex((layer) => layer.is_vessel);
    return this.layers[vessel - 1]?.name ?? "other";
  }

  /** True if the tip is in the vessel's lumen. */
  get inLumen() {
    return this.place === "in_lumen";
  }
}

/**
 * Where a point of the tissue at rest is now: every dent pulls its surroundings along the needle, less with distance.
 * Writes to `out` to allocate nothing.
 */
export function displace(tissue, axis, x, y, out) {
  out.x = x;
  out.y = y;
  for (const layer of tissue.layers) {
    if (layer.dent === 0) continue;
    const reach = layer.of_vessel ? REACH_VESSEL_MM : REACH_SKIN_MM;
    const dx = (x - axis.fromX - layer.along * axis.x) / reach;
    const dy = (y - axis.fromY - layer.along * axis.y) / reach;
    const share = layer.dent / (1 + dx * dx + dy * dy);
    out.x += share * axis.x;
    out.y += share * axis.y;
  }
}
