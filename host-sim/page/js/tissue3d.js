// The limb in three dimensions, cut along the needle's plane. What it draws comes from picture.js; it moves nothing. How triangles
// reach the screen is limb_webgpu.js' and limb_webgl.js' business.

import { DEEP_MM, LIMB_MM, along, axesOf, look, multiply, needleShapes, perspective, shapes } from "./limb_shapes.js";
import { WAITING_MM, wholeLength } from "./needle.js";
import { ALONG_MM, IMAGE_WIDTH_MM, KINDS } from "./picture.js";

const MOST_PIXELS_PER_POINT = 2;
/** The vertical field of view, rad. */
const FIELD = 0.6;
/** A pointer that moves less between down and up is a click, in CSS pixels. */
const CLICK_PX = 5;
/** A pointer so near the middle of the probe's face takes the probe, mm. */
const PROBE_MM = 7;
/** Free around tip and hub, mm. */
const MARGIN_MM = 3;

export class Tissue3d {
  /** @param {HTMLCanvasElement} canvas
   *  @param {Record<string, string>} colours of style.css, by name
   *  @param {WebGl | WebGpu} renderer of that canvas */
  constructor(canvas, colours, renderer) {
    this.canvas = canvas;
    this.colours = colours;
    this.renderer = renderer;
    /** Called for a click and for a drag on the skin: functions of what `picture.pick` returns. */
    this.clicked = () => {};
    this.probeMoved = () => {};
    /** The direction of view, rad, and the factor by which the view is farther away than needle and hub need. */
    this.orbit = { yaw: 0.35, pitch: 0.42, away: 1 };
    this.layers = [];
    this.static = this.upload(shapes());
    this.turnable();
  }

  /** Shapes as meshes, by name. */
  upload(shapes) {
    return Object.fromEntries(Object.entries(shapes).map(([name, shape]) => [name, this.renderer.shape(shape)]));
  }

  /** Dragging turns the limb, the wheel comes nearer; arrow keys do the same. */
  turnable() {
    let last = null;
    const turn = (dx, dy) => {
      this.orbit.yaw = clamp(this.orbit.yaw + dx * 0.008, -1.4, 1.4);
      this.orbit.pitch = clamp(this.orbit.pitch + dy * 0.008, -0.1, 1.5);
    };
    let [moved, probe] = [0, false];
    this.canvas.addEventListener("pointerdown", (event) => {
      last = event;
      moved = 0;
      probe = this.onProbe(event);
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (last?.pointerId !== event.pointerId) return;
      const [dx, dy] = [event.clientX - last.clientX, event.clientY - last.clientY];
      moved += Math.abs(dx) + Math.abs(dy);
      if (probe) this.dragProbe(event);
      else turn(dx, dy);
      last = event;
    });
    this.canvas.addEventListener("pointerup", (event) => {
      if (last?.pointerId === event.pointerId && moved < CLICK_PX && !probe) {
        const found = this.sight(event);
        if (found) this.clicked(found);
      }
    });
    for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, () => { last = null; });
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.orbit.away = clamp(this.orbit.away * Math.exp(event.deltaY * 0.001), 0.25, 3);
    }, { passive: false });
    this.canvas.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [-10, 0], ArrowRight: [10, 0], ArrowUp: [0, -10], ArrowDown: [0, 10] }[event.key];
      if (!by) return;
      event.preventDefault();
      turn(...by);
    });
  }

  /** Returns the place of the skin under the pointer, as `picture.pick` says it; null where none is. */
  sight(event) {
    if (!this.seen || !this.picture) return null;
    const box = this.canvas.getBoundingClientRect();
    const [u, v] = [(2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height];
    const { eye, target, aspect } = this.seen;
    const [right, up, back] = axesOf(eye, target);
    const tangent = Math.tan(FIELD / 2);
    const direction = [0, 1, 2].map((i) => u * tangent * aspect * right[i] + v * tangent * up[i] - back[i]);
    return this.picture.pick(eye, direction);
  }

  /** True if the pointer is on the probe, which sits on the skin. */
  onProbe(event) {
    const found = this.held && this.sight(event);
    return Boolean(found) && Math.hypot(found.place[0] - this.held.along, found.place[1] - this.held.across) < PROBE_MM;
  }

  dragProbe(event) {
    const found = this.sight(event);
    if (found) this.probeMoved(found.place, event);
  }

  /** Takes over what a newly built picture is made of. */
  build(picture, scene) {
    this.picture = picture;
    this.body = scene.body ?? null;
    this.measures = scene.needle;
    this.needle = this.upload(needleShapes(scene.needle));
    this.deepest = scene.layers.at(-1)?.depth_mm ?? 5;
    this.vessel = scene.vessel;
    const surfaces = picture.surfaces();
    const meshes = this.renderer.surfaces(picture.points, picture.normals, surfaces.map((surface) => surface.triangles));
    this.layers = surfaces.map(({ kind, layer, tissue }, i) => ({ kind, mesh: meshes[i], name: this.body ? tissue : scene.layers[layer]?.name }));
    // A body brings its own surroundings.
    const bands = this.body ? [] : scene.layers.filter((layer) => !layer.is_vessel && !layer.is_far_wall);
    this.bands = bands.map((layer, i) => ({ name: layer.name, top: layer.depth_mm, bottom: bands[i + 1]?.depth_mm ?? DEEP_MM }));
    // The lowest point in the needle's plane; outside that plane the limb curves down.
    const points = picture.points;
    this.blockBottom = 0;
    for (let i = 0; i < points.length; i += 4) {
      if (Math.abs(points[i + 1]) < 0.1) this.blockBottom = Math.max(this.blockBottom, points[i + 2]);
    }
  }

  /** One picture; `needle` is { depth, angle, origin, flashback }, `probe` as ultrasound.js has it, or null. */
  draw(picture, needle, probe) {
    const { width, height } = this.fit();
    const { eye, target } = this.camera(needle, width / height);
    this.seen = { eye, target, aspect: width / height };
    this.held = probe;
    this.paint(picture, needle, probe, { view: multiply(perspective(FIELD, width / height, 1, 400), look(eye, target)), eye });
  }

  /** The same from a place of one's own: `view` as a matrix, `eye` in mm, and what else a renderer's `begin` takes. */
  paint(picture, needle, probe, camera) {
    this.renderer.begin(picture.points, picture.normals, {
      ...camera,
      along: ALONG_MM,
      lumen: picture.lumen,
      wall: rgb(this.colours["vessel-wall"]),
      blood: rgb(this.colours.lumen),
      edge: 0.35,
      sky: rgb(this.colours.sky),
    });
    this.opaque(needle);
    this.clear(probe);
    this.renderer.end();
  }

  /** Returns the camera's place and target: tip, hub and the deepest wall are in the picture. */
  camera({ depth, angle }, aspect) {
    const { yaw, pitch, away } = this.orbit;
    const [s, c] = [Math.sin(angle), Math.cos(angle)];
    const end = Math.min(depth, WAITING_MM) - wholeLength(this.measures);
    const tip = Math.max(depth, Math.min(this.measures.length_mm, this.deepest / Math.max(s, 0.1)));
    const target = [((end + tip) / 2) * c, 0, ((end + tip) / 2) * s];
    const back = [-Math.sin(yaw) * Math.cos(pitch), Math.cos(yaw) * Math.cos(pitch), -Math.sin(pitch)];
    const right = [-Math.cos(yaw), -Math.sin(yaw), 0];
    const up = [Math.sin(yaw) * Math.sin(pitch), -Math.cos(yaw) * Math.sin(pitch), -Math.cos(pitch)];
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const room = Math.tan(FIELD / 2);
    const needed = [end, tip].map((along) => {
      const from = [along * c - target[0], 0, along * s - target[2]];
      const aside = Math.max((Math.abs(dot(from, right)) + MARGIN_MM) / aspect, Math.abs(dot(from, up)) + MARGIN_MM);
      return aside / room + dot(from, back);
    });
    const far = away * Math.max(...needed);
    return { target, eye: target.map((at, i) => at + far * back[i]) };
  }

  opaque(needle) {
    this.section();
    const skin = rgb(this.colours.skin);
    for (const surface of this.layers) {
      if (surface.kind === KINDS.skinBehind) this.renderer.mesh(surface.mesh, { colour: [...skin, 1] });
      if (surface.kind === KINDS.vesselBehind) this.renderer.mesh(surface.mesh, { colour: [...rgb(this.colours.lumen), 1], shine: 0.25 });
    }
    for (const surface of this.layers) {
      if (surface.kind === KINDS.insideBehind) this.renderer.mesh(surface.mesh, { colour: [...this.tissue(surface.name), 1], shine: 0.1 });
    }
    if (!this.body) {
      this.renderer.mesh(this.static.limbBehind, { colour: [...skin, 1] });
      this.renderer.mesh(this.static.limbEnds, { colour: [...this.tissue(this.bands.at(-1)?.name), 1] });
    }
    if (this.vessel) this.vesselEnds();
    const steel = { colour: [...rgb(this.colours.steel), 1], shine: 0.7, model: along(needle) };
    this.renderer.mesh(this.needle.cannula, steel);
    const hub = needle.flashback ? this.colours.lumen : this.colours.grip;
    this.renderer.mesh(this.needle.hub, { ...steel, colour: [...rgb(hub), 1], shine: 0.3 });
  }

  /** Blood closes the vessel where the block ends: one looks into it and not through it. */
  vesselEnds() {
    const { axis_mm: axis, height_mm: height, width_mm: width, offset_mm: offset } = this.vessel;
    const [wide, high] = [width / 2 + Math.abs(offset) + 1, height + 2];
    for (const x of ALONG_MM) {
      const model = [0, -wide, 0, 0, 1, 0, 0, 0, 0, 0, high, 0, x, 0, axis - high / 2, 1];
      this.renderer.mesh(this.static.square, { colour: [...rgb(this.colours.lumen), 1], normal: [1, 0, 0], model });
    }
  }

  /** The layers cut along the needle's plane: simulated in the block, at rest next to it and under
   *  it. */
  section() {
    const facing = [0, 1, 0];
    for (const surface of this.layers) {
      if (surface.kind !== KINDS.section) continue;
      this.renderer.mesh(surface.mesh, { colour: [...this.tissue(surface.name), 1], normal: facing, cut: true });
    }
    for (const band of this.bands) {
      const colour = [...this.tissue(band.name), 1];
      for (const [from, to, top] of [[LIMB_MM[0], ALONG_MM[0], band.top], [ALONG_MM[1], LIMB_MM[1], band.top], [...ALONG_MM, Math.max(band.top, this.blockBottom)]]) {
        if (band.bottom <= top) continue;
        const model = [to - from, 0, 0, 0, 0, 1, 0, 0, 0, 0, band.bottom - top, 0, from, 0, top, 1];
        this.renderer.mesh(this.static.square, { colour, normal: facing, model, cut: true });
      }
    }
  }

  /** Draws the transparent parts, from back to front. */
  clear(probe) {
    const wall = { colour: [...rgb(this.colours["vessel-wall"]), 0.22], shine: 0.3, pass: "clear" };
    const skin = { colour: [...rgb(this.colours.skin), 0.16], shine: 0.15, pass: "clear" };
    const all = (kind, how) => {
      for (const surface of this.layers) if (surface.kind === kind) this.renderer.mesh(surface.mesh, how);
    };
    all(KINDS.vesselBefore, wall);
    for (const surface of this.layers) {
      if (surface.kind === KINDS.insideBefore) this.renderer.mesh(surface.mesh, { ...wall, colour: [...this.tissue(surface.name), 0.18] });
    }
    if (probe) this.probe(probe);
    all(KINDS.skinBefore, skin);
    if (!this.body) this.renderer.mesh(this.static.limbBefore, skin);
  }

  /** The probe's face and the plane that it sees. */
  probe(probe) {
    const colour = rgb(this.colours.depth);
    const [s, c] = [Math.sin(probe.azimuth), Math.cos(probe.azimuth)];
    const { depth: sag, lean: upright } = this.picture.skin(probe.along, probe.across, probe.azimuth);
    const [sl, cl] = [Math.sin(probe.lean + upright), Math.cos(probe.lean + upright)];
    const lateral = [c, s, 0];
    const axial = [-s * sl, c * sl, cl];
    const side = [-s * cl, c * cl, -sl];
    const place = (u, v, n) => [0, 1, 2].map((i) => [probe.along, probe.across, sag][i] + u * lateral[i] + v * axial[i] + n * side[i]);
    const model = (at, a, b, d) => [...a, 0, ...b, 0, ...d, 0, ...at, 1];
    const wide = lateral.map((x) => x * IMAGE_WIDTH_MM);
    const deep = axial.map((x) => x * probe.depth);
    // In the needle's plane it would lie in the section.
    const plane = { colour: [...colour, 0.14], normal: side, model: model(place(-IMAGE_WIDTH_MM / 2, 0, 0), wide, side, deep) };
    this.renderer.mesh(this.static.square, { ...plane, pass: "clearNear" });
    const box = [lateral.map((x) => x * (IMAGE_WIDTH_MM + 1)), side.map((x) => x * 4), axial.map((x) => -x * 5)];
    const face = { colour: [...colour, 0.3], shine: 0.2, model: model(place(0, -0.1, 0), ...box) };
    this.renderer.mesh(this.static.box, { ...face, pass: "clear" });
  }

  tissue(name) {
    return rgb(this.colours[name] ?? this.colours.other);
  }

  /** The canvas as large as it is shown. */
  fit() {
    const { canvas } = this;
    const ratio = Math.min(window.devicePixelRatio || 1, MOST_PIXELS_PER_POINT);
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    return { width, height };
  }
}

const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

/** `#rrggbb` as three numbers from 0 to 1. */
function rgb(colour) {
  const number = parseInt(colour.slice(1, 7), 16);
  return [number >> 16, (number >> 8) & 255, number & 255].map((part) => part / 255);
}
