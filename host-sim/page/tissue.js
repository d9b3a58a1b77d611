// What the needle does to the layers in the picture: which are touched, which have given way, how far each is dented.
// Only a picture: the force comes from the device, and this follows its events and depths.

/** How fast tissue springs back after a puncture. */
const RECOVERY_S = 0.12;
/** How far a dent reaches sideways, in mm. */
const REACH_SKIN_MM = 4;
const REACH_VESSEL_MM = 1.6;
/** Friction drags a punctured surface along: mm for each N. */
const DRAG_MM_PER_N = 0.35;
const LARGEST_DRAG_MM = 0.7;
/** Antecubital vein, mean of 461: 10.1177/11297298231186651. */
export const VESSEL_MM = { wide: 4.46, high: 3.01 };

export class Tissue {
  constructor(layers) {
    this.layers = layers.map((layer) => ({ ...layer, touched: false, given: false, dent: 0 }));
  }

  /** Follows an event of the device. */
  happen(event) {
    if (event.kind === "started" || event.layer === null) return;
    const layer = this.layers[event.layer];
    if (!layer) return;
    if (event.kind === "contact") layer.touched = true;
    if (event.kind === "puncture" || event.kind === "vessel") layer.touched = layer.given = true;
    if (event.kind === "exit") layer.touched = layer.given = false;
  }

  /** Follows the depth; also finds out by itself what happened before this page was opened. */
  move(depth, force, seconds, steepness) {
    const relaxed = 1 - Math.exp(-seconds / RECOVERY_S);
    for (const layer of this.layers) {
      if (layer.puncture_travel_mm === null) continue;
      // Depths lie in the body; the tip goes along the needle.
      const top = layer.depth_mm / steepness;
      const wall = top + layer.puncture_travel_mm;
      if (depth > wall + 0.3) layer.given = true;
      if (depth < top - 0.3) layer.given = false;
      if (!layer.given && depth > top) {
        layer.dent = depth - top;
        continue;
      }
      const inside = layer.given && depth > top;
      const drag = inside ? Math.max(-LARGEST_DRAG_MM, Math.min(LARGEST_DRAG_MM, DRAG_MM_PER_N * force)) : 0;
      layer.dent += relaxed * (drag - layer.dent);
    }
  }

  /** Whether the tip is in the vessel. */
  get inVessel() {
    return this.layers.some((layer) => layer.is_vessel && layer.given) && !this.layers.some((layer) => layer.is_far_wall && layer.given);
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
    const reach = layer.is_vessel ? REACH_VESSEL_MM : REACH_SKIN_MM;
    const dx = (x - (layer.depth_mm * axis.x) / axis.y) / reach;
    const dy = (y - layer.depth_mm) / reach;
    const share = layer.dent / (1 + dx * dx + dy * dy);
    out.x += share * axis.x;
    out.y += share * axis.y;
  }
}
