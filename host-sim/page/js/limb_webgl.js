// The limb's triangles by WebGL 2, where a browser has no WebGPU; limb_webgpu.js does the same with the same functions.

import { SLICES } from "./picture.js";
import { IDENTITY } from "./limb_shapes.js";

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
  }
  vec3 toEye = normalize(eye - at);
  if (dot(n, toEye) < 0.0) n = -n;
  vec3 light = normalize(vec3(-0.35, 0.6, -0.9));
  float lit = 0.5 + 0.5 * max(dot(n, light), 0.0);
  float gloss = shine * pow(max(dot(normalize(light + toEye), n), 0.0), 40.0);
  result = vec4(base * lit + gloss, colour.a);
}`;

/** The blending of a mesh with what is behind it: see `mesh`. */
const PASSES = {
  opaque: { blend: false, offset: false },
  clear: { blend: true, offset: false },
  // In front of surfaces in the same plane.
  clearNear: { blend: true, offset: true },
};

export class WebGl {
  name = "webgl2";

  constructor(canvas) {
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
    if (!gl) throw new Error("This browser has neither WebGPU nor WebGL 2");
    this.gl = gl;
    this.canvas = canvas;
    this.program = program(gl);
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  /** A mesh of its own points, four numbers each. */
  shape({ places, normals, triangles }) {
    const { gl } = this;
    const buffers = [places, normals].map((numbers) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
      return buffer;
    });
    return indexed(gl, buffers, new Uint32Array(triangles));
  }

  /** Meshes that share moving points, in place of those of before; `triangles` of each into `points`. */
  surfaces(points, normals, triangles) {
    const { gl } = this;
    for (const mesh of this.shared ?? []) gl.deleteVertexArray(mesh.array), gl.deleteBuffer(mesh.index);
    this.moving ??= [gl.createBuffer(), gl.createBuffer()];
    [points, normals].forEach((numbers, i) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.moving[i]);
      gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.DYNAMIC_DRAW);
    });
    this.shared = triangles.map((each) => indexed(gl, this.moving, each));
    return this.shared;
  }

  /** Begins a picture: where the shared points are now, and what all meshes have in common. A headset has its own `target`, two eyes
   *  share it, and only the first `clears` it. */
  begin(points, normals, { view, eye, along, lumen, wall, blood, edge, sky, target = null, clears = true }) {
    const { gl } = this;
    [points, normals].forEach((numbers, i) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.moving[i]);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, numbers);
    });
    gl.bindFramebuffer(gl.FRAMEBUFFER, target?.framebuffer ?? null);
    gl.viewport(...(target?.viewport ?? [0, 0, this.canvas.width, this.canvas.height]));
    gl.clearColor(...sky, 1);
    gl.depthMask(true);
    if (clears) gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(this.program.handle);
    const { at } = this.program;
    gl.uniformMatrix4fv(at("view"), false, view);
    gl.uniform3fv(at("eye"), eye);
    gl.uniform2fv(at("along"), along);
    gl.uniform2fv(at("lumen"), lumen);
    gl.uniform3fv(at("wall"), wall);
    gl.uniform3fv(at("blood"), blood);
    gl.uniform1f(at("edge"), edge);
  }

  /** Draws a mesh; `pass` is "opaque", "clear" or "clearNear", clear ones from the back to the front. */
  mesh(mesh, { colour, normal = [0, 0, 0], shine = 0, model = IDENTITY, cut = false, pass = "opaque" }) {
    const { gl } = this;
    const { blend, offset } = PASSES[pass];
    gl.depthMask(!blend);
    (blend ? gl.enable : gl.disable).call(gl, gl.BLEND);
    (offset ? gl.enable : gl.disable).call(gl, gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(-4, -8);
    const { at } = this.program;
    gl.uniform4fv(at("colour"), colour);
    gl.uniform3fv(at("flatNormal"), normal);
    gl.uniform1f(at("shine"), shine);
    gl.uniformMatrix4fv(at("model"), false, model);
    gl.uniform1i(at("cut"), cut ? 1 : 0);
    gl.bindVertexArray(mesh.array);
    gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
  }

  /** Ends the picture. */
  end() {}
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

function indexed(gl, [places, normals], triangles) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  for (const [slot, buffer] of [[0, places], [1, normals]]) {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(slot);
    gl.vertexAttribPointer(slot, 4, gl.FLOAT, false, 0, 0);
  }
  const index = gl.createBuffer();
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, index);
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
  return { array, index, count: triangles.length };
}
