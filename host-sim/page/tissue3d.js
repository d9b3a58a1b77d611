// The limb in three dimensions, cut along the needle's plane: WebGL 2. What it draws comes from picture.js; it moves nothing.

import { ALONG_MM, HALF_WIDTH_MM, IMAGE_WIDTH_MM, KINDS, LIMB_RADIUS_MM, SLICES } from "./picture.js";

const MOST_PIXELS_PER_POINT = 2;
const NEEDLE = { radius: 0.41, length: 34, bevel: 2.1, hub: 1.7, hubLength: 7 };
/** The limb beyond what is simulated, mm along. */
const LIMB_MM = [-60, 80];
const DEEP_MM = 34;
const AROUND = 20;

const VERTEX = `#version 300 es
layout(location = 0) in vec4 place;
layout(location = 1) in vec4 normalIn;
uniform mat4 view;
uniform mat4 model;
out vec3 at;
out vec3 normal;
void main() {
  vec4 world = model * vec4(place.xyz, 1.0);
  at = world.xyz;
  normal = mat3(model) * normalIn.xyz;
  gl_Position = view * world;
}`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 at;
in vec3 normal;
uniform vec4 colour;
uniform vec3 flatNormal;
uniform vec3 eye;
uniform float shine;
// Sections: upper and lower wall of the vessel along x; colours of wall.
uniform bool cut;
uniform vec2 lumen[${SLICES}];
uniform vec2 along;
uniform vec3 wall;
uniform vec3 blood;
uniform float edge;
out vec4 result;
void main() {
  vec3 n = dot(flatNormal, flatNormal) > 0.0 ? flatNormal : normalize(normal);
  vec3 base = colour.rgb;
  if (cut) {
    float slot = clamp((at.x - along.x) / (along.y - along.x), 0.0, 1.0) * float(${SLICES - 1});
    int low = min(int(slot), ${SLICES - 2});
    vec2 walls = mix(lumen[low], lumen[low + 1], slot - float(low));
    if (lumen[low].y > lumen[low].x && lumen[low + 1].y > lumen[low + 1].x) {
      bool open = at.z > walls.x && at.z < walls.y;
      // Within the block one sees the hollow vessel, towards its ends and beyond its blood.
      if (open && at.x > along.x + 2.5 && at.x < along.y - 2.5) discard;
      if (open) base = blood;
      else if (at.z > walls.x - edge && at.z < walls.y + edge) base = wall;
    }
    // Fibres, so that one sees the tissue move only where it does.
    base *= 0.96 + 0.04 * sin(at.z * 9.0 + sin(at.x * 1.3));
  }
  vec3 toEye = normalize(eye - at);
  if (dot(n, toEye) < 0.0) n = -n;
  vec3 light = normalize(vec3(-0.35, 0.6, -0.9));
  float lit = 0.5 + 0.5 * max(dot(n, light), 0.0);
  float gloss = shine * pow(max(dot(normalize(light + toEye), n), 0.0), 40.0);
  result = vec4(base * lit + gloss, colour.a);
}`;

export class Tissue3d {
  /** @param {HTMLCanvasElement} canvas
   *  @param {Record<string, string>} colours of style.css, by name */
  constructor(canvas, colours) {
    this.canvas = canvas;
    this.colours = colours;
    this.orbit = { yaw: 0.35, pitch: 0.42, distance: 44 };
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
    if (!gl) throw new Error("This browser has no WebGL 2");
    this.gl = gl;
    this.program = program(gl);
    this.places = new Map();
    this.layers = [];
    this.static = staticParts(gl);
    this.turnable();
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  /** Dragging turns the limb, the wheel comes nearer; arrow keys do the same. */
  turnable() {
    let last = null;
    const turn = (dx, dy) => {
      this.orbit.yaw = clamp(this.orbit.yaw + dx * 0.008, -1.4, 1.4);
      this.orbit.pitch = clamp(this.orbit.pitch + dy * 0.008, -0.1, 1.5);
    };
    this.canvas.addEventListener("pointerdown", (event) => {
      last = event;
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (last?.pointerId !== event.pointerId) return;
      turn(event.clientX - last.clientX, event.clientY - last.clientY);
      last = event;
    });
    for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, () => { last = null; });
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.orbit.distance = clamp(this.orbit.distance * Math.exp(event.deltaY * 0.001), 15, 160);
    }, { passive: false });
    this.canvas.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [-10, 0], ArrowRight: [10, 0], ArrowUp: [0, -10], ArrowDown: [0, 10] }[event.key];
      if (!by) return;
      event.preventDefault();
      turn(...by);
    });
  }

  /** Takes over what a newly built picture is made of. */
  build(picture, scene) {
    const { gl } = this;
    for (const surface of this.layers) gl.deleteVertexArray(surface.array), gl.deleteBuffer(surface.index);
    this.points ??= gl.createBuffer();
    this.normals ??= gl.createBuffer();
    for (const [buffer, numbers] of [[this.points, picture.points], [this.normals, picture.normals]]) {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.DYNAMIC_DRAW);
    }
    this.layers = picture.surfaces().map((surface) => {
      const array = vertexArray(gl, this.points, this.normals);
      const index = gl.createBuffer();
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, index);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, surface.triangles, gl.STATIC_DRAW);
      return { ...surface, array, index, count: surface.triangles.length, name: scene.layers[surface.layer]?.name };
    });
    const bands = scene.layers.filter((layer) => !layer.is_vessel && !layer.is_far_wall);
    this.bands = bands.map((layer, i) => ({ name: layer.name, top: layer.depth_mm, bottom: bands[i + 1]?.depth_mm ?? DEEP_MM }));
    // In the needle's plane; beside it the limb curves down.
    const points = picture.points;
    this.blockBottom = 0;
    for (let i = 0; i < points.length; i += 4) {
      if (Math.abs(points[i + 1]) < 0.1) this.blockBottom = Math.max(this.blockBottom, points[i + 2]);
    }
  }

  /** One picture; `needle` is { depth, angle, flashback }, `probe` as ultrasound.js has it, or null. */
  draw(picture, needle, probe) {
    const { gl } = this;
    const { width, height } = this.fit();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.points);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, picture.points);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.normals);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, picture.normals);
    const [r, g, b] = rgb(this.colours.sky);
    gl.clearColor(r, g, b, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(this.program.handle);
    const { yaw, pitch, distance } = this.orbit;
    const target = [7, 0, 4];
    // A narrow picture steps back, so that the vessel stays in it.
    const far = distance * Math.max(1, 1.35 / (width / height));
    const eye = [
      target[0] - far * Math.sin(yaw) * Math.cos(pitch),
      target[1] + far * Math.cos(yaw) * Math.cos(pitch),
      target[2] - far * Math.sin(pitch),
    ];
    this.set("view", multiply(perspective(0.6, width / height, 1, 400), look(eye, target)));
    this.set("eye", eye);
    this.set("along", ALONG_MM);
    this.set("lumen", picture.lumen);
    this.set("wall", rgb(this.colours["vessel-wall"]));
    this.set("blood", rgb(this.colours.lumen));
    this.set("edge", 0.35);
    this.opaque(needle);
    this.clear(needle, probe);
  }

  opaque(needle) {
    this.section();
    const skin = rgb(this.colours.skin);
    for (const surface of this.layers) {
      if (surface.kind === KINDS.skinBehind) this.mesh(surface, { colour: [...skin, 1] });
      if (surface.kind === KINDS.vesselBehind) this.mesh(surface, { colour: [...rgb(this.colours.lumen), 1], shine: 0.25 });
    }
    this.mesh(this.static.limbBehind, { colour: [...skin, 1] });
    const steel = { colour: [...rgb(this.colours.steel), 1], shine: 0.7, model: along(needle) };
    this.mesh(this.static.needle, steel);
    const hub = needle.flashback ? this.colours.lumen : this.colours.grip;
    this.mesh(this.static.hub, { ...steel, colour: [...rgb(hub), 1], shine: 0.3 });
  }

  /** The layers cut along the needle's plane: simulated in the block, at rest beside and under it. */
  section() {
    const facing = [0, 1, 0];
    for (const surface of this.layers) {
      if (surface.kind !== KINDS.section) continue;
      this.mesh(surface, { colour: [...this.tissue(surface.name), 1], normal: facing, cut: true });
    }
    for (const band of this.bands) {
      const colour = [...this.tissue(band.name), 1];
      for (const [from, to, top] of [[LIMB_MM[0], ALONG_MM[0], band.top], [ALONG_MM[1], LIMB_MM[1], band.top], [...ALONG_MM, Math.max(band.top, this.blockBottom)]]) {
        if (band.bottom <= top) continue;
        const model = [to - from, 0, 0, 0, 0, 1, 0, 0, 0, 0, band.bottom - top, 0, from, 0, top, 1];
        this.mesh(this.static.square, { colour, normal: facing, model, cut: true });
      }
    }
  }

  /** What one sees through, from the back to the front. */
  clear(needle, probe) {
    const { gl } = this;
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    for (const surface of this.layers) {
      if (surface.kind === KINDS.vesselBefore) this.mesh(surface, { colour: [...rgb(this.colours["vessel-wall"]), 0.22], shine: 0.3 });
    }
    if (probe) this.probe(probe);
    const skin = [...rgb(this.colours.skin), 0.16];
    for (const surface of this.layers) if (surface.kind === KINDS.skinBefore) this.mesh(surface, { colour: skin, shine: 0.15 });
    this.mesh(this.static.limbBefore, { colour: skin, shine: 0.15 });
    gl.depthMask(true);
    gl.disable(gl.BLEND);
  }

  /** The probe's face and the plane that it sees. */
  probe(probe) {
    const colour = rgb(this.colours.depth);
    const [s, c] = [Math.sin(probe.azimuth), Math.cos(probe.azimuth)];
    const [sl, cl] = [Math.sin(probe.lean), Math.cos(probe.lean)];
    const lateral = [c, s, 0];
    const axial = [-s * sl, c * sl, cl];
    const side = [-s * cl, c * cl, -sl];
    const sag = LIMB_RADIUS_MM - Math.sqrt(Math.max(0, LIMB_RADIUS_MM ** 2 - probe.across ** 2));
    const place = (u, v, n) => [0, 1, 2].map((i) => [probe.along, probe.across, sag][i] + u * lateral[i] + v * axial[i] + n * side[i]);
    const model = (at, a, b, d) => [...a, 0, ...b, 0, ...d, 0, ...at, 1];
    const wide = lateral.map((x) => x * IMAGE_WIDTH_MM);
    const deep = axial.map((x) => x * probe.depth);
    // In the needle's plane it would lie in the section.
    const { gl } = this;
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(-4, -8);
    this.mesh(this.static.square, { colour: [...colour, 0.14], normal: side, model: model(place(-IMAGE_WIDTH_MM / 2, 0, 0), wide, side, deep) });
    gl.disable(gl.POLYGON_OFFSET_FILL);
    const box = [lateral.map((x) => x * (IMAGE_WIDTH_MM + 1)), side.map((x) => x * 4), axial.map((x) => -x * 5)];
    this.mesh(this.static.box, { colour: [...colour, 0.3], shine: 0.2, model: model(place(0, -0.1, 0), ...box) });
  }

  tissue(name) {
    return rgb(this.colours[name] ?? this.colours.other);
  }

  set(name, value) {
    const { gl } = this;
    const at = this.program.at(name);
    if (value.length === 16) gl.uniformMatrix4fv(at, false, value);
    else if (name === "lumen") gl.uniform2fv(at, value);
    else if (value.length === 4) gl.uniform4fv(at, value);
    else if (value.length === 3) gl.uniform3fv(at, value);
    else if (value.length === 2) gl.uniform2fv(at, value);
    else if (typeof value === "boolean") gl.uniform1i(at, value ? 1 : 0);
    else gl.uniform1f(at, value);
  }

  mesh(mesh, { colour, normal = [0, 0, 0], shine = 0, model = IDENTITY, cut = false }) {
    this.set("colour", colour);
    this.set("flatNormal", normal);
    this.set("shine", shine);
    this.set("model", model);
    this.set("cut", cut);
    this.gl.bindVertexArray(mesh.array);
    this.gl.drawElements(this.gl.TRIANGLES, mesh.count, this.gl.UNSIGNED_INT, 0);
  }

  fit() {
    const { canvas, gl } = this;
    const ratio = Math.min(window.devicePixelRatio || 1, MOST_PIXELS_PER_POINT);
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    gl.viewport(0, 0, width, height);
    return { width, height };
  }
}

const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

/** `#rrggbb` as three numbers from 0 to 1. */
function rgb(colour) {
  const number = parseInt(colour.slice(1, 7), 16);
  return [number >> 16, (number >> 8) & 255, number & 255].map((part) => part / 255);
}

function program(gl) {
  const handle = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(handle, shader);
  }
  gl.linkProgram(handle);
  if (!gl.getProgramParameter(handle, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(handle) || "WebGL refused the program");
  const known = new Map();
  const at = (name) => {
    if (!known.has(name)) known.set(name, gl.getUniformLocation(handle, name));
    return known.get(name);
  };
  return { handle, at };
}

function vertexArray(gl, places, normals) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  for (const [slot, buffer] of [[0, places], [1, normals]]) {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(slot);
    gl.vertexAttribPointer(slot, 4, gl.FLOAT, false, 0, 0);
  }
  return array;
}

/** What never deforms: limb beside the block, needle, square, box. */
function staticParts(gl) {
  const make = ({ places, normals, triangles }) => {
    const buffers = [places, normals].map((numbers) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
      return buffer;
    });
    const array = vertexArray(gl, ...buffers);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(triangles), gl.STATIC_DRAW);
    return { array, count: triangles.length };
  };
  const square = { places: [0, 0, 0, 1, 1, 0, 0, 1, 1, 0, 1, 1, 0, 0, 1, 1], normals: new Array(16).fill(0), triangles: [0, 1, 2, 0, 2, 3] };
  return {
    limbBehind: make(limb(-1)),
    limbBefore: make(limb(1)),
    needle: make(turned([[-NEEDLE.length, NEEDLE.radius], [-NEEDLE.bevel, NEEDLE.radius], [0, 0.02]])),
    hub: make(turned([[-NEEDLE.length - NEEDLE.hubLength, NEEDLE.hub], [-NEEDLE.length - 2, NEEDLE.hub], [-NEEDLE.length, NEEDLE.radius]])),
    square: make(square),
    box: make(box()),
  };
}

/** Half of the limb's skin, on one side of the needle's plane, without what the block shows. */
function limb(side) {
  const places = [];
  const normals = [];
  const triangles = [];
  const skin = (x, angle) => {
    const [s, c] = [Math.sin(angle), Math.cos(angle)];
    places.push(x, side * LIMB_RADIUS_MM * s, LIMB_RADIUS_MM * (1 - c), 1);
    normals.push(0, side * s, -c, 0);
  };
  const patch = (x, angles) => {
    for (let i = 0; i < angles.length - 1; i++) {
      const first = places.length / 4;
      for (const [a, b] of [[x[0], angles[i]], [x[1], angles[i]], [x[1], angles[i + 1]], [x[0], angles[i + 1]]]) skin(a, b);
      triangles.push(first, first + 1, first + 2, first, first + 2, first + 3);
    }
  };
  const edge = Math.asin(HALF_WIDTH_MM / LIMB_RADIUS_MM);
  const steps = (from, to) => Array.from({ length: AROUND + 1 }, (_, i) => from + ((to - from) * i) / AROUND);
  const lowest = Math.acos(1 - DEEP_MM / LIMB_RADIUS_MM);
  patch([LIMB_MM[0], ALONG_MM[0]], steps(0, lowest));
  patch([ALONG_MM[1], LIMB_MM[1]], steps(0, lowest));
  patch(ALONG_MM, steps(edge, lowest));
  return { places, normals, triangles };
}

/** A body turned about x from pairs of x and radius. */
function turned(profile) {
  const places = [];
  const normals = [];
  const triangles = [];
  for (const [x, radius] of profile) {
    for (let i = 0; i < AROUND; i++) {
      const [s, c] = [Math.sin((i / AROUND) * 2 * Math.PI), Math.cos((i / AROUND) * 2 * Math.PI)];
      // The ground face: the tip lies at the edge that is deepest.
      places.push(x, radius * s, radius * c, 1);
      normals.push(0, s, c, 0);
    }
  }
  for (let ring = 0; ring < profile.length - 1; ring++) {
    for (let i = 0; i < AROUND; i++) {
      const [a, b] = [ring * AROUND + i, ring * AROUND + ((i + 1) % AROUND)];
      triangles.push(a, b, b + AROUND, a, b + AROUND, a + AROUND);
    }
  }
  return { places, normals, triangles };
}

/** A box from −½ to ½ in x and y, from 0 to 1 in z. */
function box() {
  const places = [];
  const normals = [];
  const triangles = [];
  const sides = [[0, 0.5], [0, -0.5], [1, 0.5], [1, -0.5], [2, 0.5], [2, -0.5]];
  for (const [axis, at] of sides) {
    const first = places.length / 4;
    for (const [u, v] of [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) {
      const place = [0, 0, 0.5];
      place[axis] = axis === 2 ? at + 0.5 : at;
      place[(axis + 1) % 3] += u;
      place[(axis + 2) % 3] += v;
      places.push(...place, 1);
      normals.push(...[0, 1, 2].map((i) => (i === axis ? Math.sign(at) : 0)), 0);
    }
    triangles.push(first, first + 1, first + 2, first, first + 2, first + 3);
  }
  return { places, normals, triangles };
}

/** From the needle's own axes (x towards the tip) into the body. */
function along({ depth, angle }) {
  const [s, c] = [Math.sin(angle), Math.cos(angle)];
  return [c, 0, s, 0, 0, 1, 0, 0, -s, 0, c, 0, depth * c, 0, depth * s, 1];
}

function perspective(field, aspect, near, far) {
  const f = 1 / Math.tan(field / 2);
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
}

/** z points down into the body, so up is −z. */
function look(eye, target) {
  const norm = (v) => v.map((x) => x / Math.hypot(...v));
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const back = norm(eye.map((x, i) => x - target[i]));
  const right = norm(cross([0, 0, -1], back));
  const up = cross(back, right);
  return [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, -dot(right, eye), -dot(up, eye), -dot(back, eye), 1];
}

function multiply(a, b) {
  const product = new Array(16).fill(0);
  for (let column = 0; column < 4; column++)
    for (let row = 0; row < 4; row++)
      for (let k = 0; k < 4; k++) product[4 * column + row] += a[4 * k + row] * b[4 * column + k];
  return product;
}
