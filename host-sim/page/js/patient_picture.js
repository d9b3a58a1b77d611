// The patient that is being edited, drawn as the page draws the one that counts: the section with the needle's tip in the vein, and the
// force that the hand will feel on the way there.

import { surface } from "./canvas.js";
import { number } from "./language.js";
import { punctureForce } from "./patient_sliders.js";
import { Section } from "./section.js";
import { Tissue } from "./tissue.js";

/** Force at the top of the curve, N: the firmest skin of the sliders. */
const MOST_N = 2;
/** Room above the curve for its figures, and below it, in points. */
const TOP = 16;
const BOTTOM = 6;
const STEP_MM = 0.05;

export class PatientPicture {
  /**
   * @param {HTMLCanvasElement} canvas the section
   * @param {HTMLCanvasElement} curve the force along the way
   * @param {Record<string, string>} colours of style.css, by name
   */
  constructor(canvas, curve, colours) {
    this.colours = colours;
    this.section = new Section(canvas, colours, true);
    this.curve = surface(curve);
    this.profile = null;
    this.needle = null;
    for (const one of [canvas, curve]) new ResizeObserver(() => this.draw()).observe(one);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  /** Draws a profile that has a vein; `needle` is the scene's. */
  show(profile, needle) {
    this.profile = profile;
    this.needle = needle;
    this.draw();
  }

  draw() {
    if (!this.profile || !this.needle) return;
    const angle = (this.profile.entry_deg * Math.PI) / 180;
    const tissue = new Tissue(sceneOf(this.profile, this.needle));
    const depth = tissue.vessel.axis_mm / Math.sin(Math.max(angle, 0.087));
    // Walls above the tip have given way, so that nothing is dented.
    for (const layer of tissue.layers) layer.touched = layer.given = layer.depth_mm < tissue.vessel.axis_mm;
    tissue.move(depth, angle, 0, "in_lumen", 1);
    this.section.draw({ depth, force: 0, motor: 0, angle, hand: 0, person: false, ghost: NaN, seconds: Infinity }, tissue);
    this.forces(angle);
  }

  /** Force against depth: each wall rises until it gives way and leaves its relief behind it. */
  forces(angle) {
    const { context: g, width, height } = this.curve;
    const sine = Math.sin(Math.max(angle, 0.087));
    const walls = this.profile.layer.filter((layer) => layer.wall).map((layer) => ({ at: layer.depth_mm / sine, ...layer.wall }));
    const end = walls.at(-1).at + walls.at(-1).puncture_mm + 2;
    const x = (mm) => 8 + ((width - 16) * (mm + 1)) / (end + 1);
    const y = (force) => height - BOTTOM - ((height - TOP - BOTTOM) * force) / MOST_N;
    g.fillStyle = this.colours.panel;
    g.fillRect(0, 0, width, height);
    g.strokeStyle = this.colours.grid;
    g.lineWidth = 1;
    g.beginPath();
    g.moveTo(0, y(0));
    g.lineTo(width, y(0));
    g.stroke();
    g.strokeStyle = this.colours.force;
    g.lineWidth = 2;
    g.beginPath();
    g.moveTo(x(-1), y(0));
    for (let mm = 0; mm <= end; mm += STEP_MM) g.lineTo(x(mm), y(forceAt(walls, mm)));
    g.stroke();
    g.fillStyle = this.colours.text;
    g.font = `600 12px ${this.colours.font}`;
    g.textBaseline = "bottom";
    g.textAlign = "center";
    for (const wall of walls) {
      const force = punctureForce(wall);
      g.fillText(`${number(force, 2)} N`, Math.min(width - 24, Math.max(24, x(wall.at + wall.puncture_mm))), y(Math.min(force, MOST_N)) - 2);
    }
  }
}

/** The force of all walls at `mm` along the needle, N. */
function forceAt(walls, mm) {
  return walls.reduce((sum, { at, elastic, relief, puncture_mm: travel }) => {
    const past = mm - at;
    if (past <= 0) return sum;
    const law = past <= travel ? elastic : relief;
    // The relief falls to its vertex and stays there.
    const to = law === relief ? Math.min(past, relief.vertex_mm) : past;
    return sum + (to - law.vertex_mm) ** 2 / law.compliance_mm2_per_n + law.base_n;
  }, 0);
}

/** Returns what `Tissue` needs of a scene, from a profile with a vein in level layers. */
function sceneOf(profile, needle) {
  const depth = (name) => profile.layer.find((layer) => layer.tissue === name).depth_mm;
  const [near, far] = [depth("vessel"), depth("far-wall")];
  return {
    needle,
    layers: profile.layer.map((layer) => ({
      name: layer.tissue, depth_mm: layer.depth_mm, is_vessel: layer.tissue === "vessel", is_far_wall: layer.tissue === "far-wall",
      puncture_travel_mm: layer.wall?.puncture_mm ?? null,
    })),
    vessel: { axis_mm: (near + far) / 2, height_mm: far - near, width_mm: profile.vessel?.width_mm ?? far - near, offset_mm: profile.vessel?.offset_mm ?? 0 },
  };
}
