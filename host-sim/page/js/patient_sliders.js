// The four figures of a vein that somebody at a bedside knows: how deep it is, how wide, how firm its wall and the skin are. Each is read
// from a profile and written to it; all other figures stay as they are.

/** The wall's force where it gives way, N: (T − n)²/a + b at its travel T (Paper 001, eq. 1). */
export function punctureForce({ elastic, puncture_mm: travel }) {
  return (travel - elastic.vertex_mm) ** 2 / elastic.compliance_mm2_per_n + elastic.base_n;
}

/** Makes a wall so firm that it gives way at `force` N, after the same travel: both parabolas are scaled. */
function makeFirm(wall, force) {
  const share = force / punctureForce(wall);
  for (const parabola of [wall.elastic, wall.relief]) {
    parabola.compliance_mm2_per_n = rounded(parabola.compliance_mm2_per_n / share, 4);
    parabola.base_n = rounded(parabola.base_n * share, 4);
  }
}

const rounded = (value, digits) => Number(value.toFixed(digits));

const index = (profile, tissue) => profile.layer.findIndex((layer) => layer.tissue === tissue);
const layer = (profile, tissue) => profile.layer[index(profile, tissue)];

/** Moves the layers from number `first` on by `mm`. */
function move(profile, first, mm) {
  for (const below of profile.layer.slice(first)) below.depth_mm = rounded(below.depth_mm + mm, 3);
}

const height = (profile) => layer(profile, "far-wall").depth_mm - layer(profile, "vessel").depth_mm;

/** Each by the ending of its element's id: its range, its value in a profile, and how a value is written to one. */
export const FIGURES = {
  depth: {
    // At least this below the layer over it.
    low: (profile) => Math.ceil(10 * (profile.layer[index(profile, "vessel") - 1].depth_mm + 0.5)) / 10,
    high: () => 12,
    read: (profile) => layer(profile, "vessel").depth_mm,
    write: (profile, mm) => move(profile, index(profile, "vessel"), mm - layer(profile, "vessel").depth_mm),
  },
  size: {
    low: () => 1,
    high: () => 8,
    read: (profile) => profile.vessel?.width_mm ?? height(profile),
    // A vein keeps its shape.
    write(profile, mm) {
      const was = height(profile);
      const tall = (was * mm) / this.read(profile);
      move(profile, index(profile, "far-wall"), tall - was);
      if (profile.vessel) profile.vessel.width_mm = rounded(mm, 3);
    },
  },
  skin: {
    low: () => 0.3,
    high: () => 1.8,
    read: (profile) => punctureForce(layer(profile, "skin").wall),
    write: (profile, force) => makeFirm(layer(profile, "skin").wall, force),
  },
  wall: {
    low: () => 0.15,
    high: () => 1.2,
    read: (profile) => punctureForce(layer(profile, "vessel").wall),
    write(profile, force) {
      const share = force / this.read(profile);
      for (const name of ["vessel", "far-wall"]) {
        const { wall } = layer(profile, name);
        if (wall) makeFirm(wall, punctureForce(wall) * share);
      }
    },
  },
};

/** Keys of a patient from which layers and forces follow by rules: sliders would not show what counts. */
const RULED = ["age_years", "weight_kg", "height_cm", "sex", "pathology"];

/** Returns true for a vein in level layers whose walls have figures of their own. */
export function hasVein(profile) {
  if (profile.body || RULED.some((key) => key in (profile.patient ?? {}))) return false;
  const levels = (profile.layer ?? []).every((one) => typeof one.depth_mm === "number" && !one.thickness);
  const [skin, vessel, far] = ["skin", "vessel", "far-wall"].map((name) => index(profile, name));
  return levels && skin === 0 && vessel > 0 && far > vessel && [skin, vessel].every((i) => profile.layer[i].wall?.elastic);
}
