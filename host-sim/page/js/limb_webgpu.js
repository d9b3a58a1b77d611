// The limb's triangles by WebGPU, where the browser has a graphics processor for it; limb_webgl.js does the same with the same
// functions, and its shaders say the same.

import { SLICES } from "./picture.js";
import { IDENTITY } from "./limb_shapes.js";

const SHADER = `
struct Frame {
  view: mat4x4f,
  eye: vec4f,
  wall: vec4f,
  // Colour, and how far a wall reaches beyond its lumen, mm.
  blood: vec4f,
  along: vec4f,
  // Upper and lower wall of the vessel along x, two places in each.
  lumen: array<vec4f, ${SLICES / 2}>,
}
struct Look {
  model: mat4x4f,
  colour: vec4f,
  // A normal for the whole mesh, or zero; shine.
  normal: vec4f,
  // Whether it is a section.
  cut: vec4f,
}
@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> look: Look;

struct Point {
  @builtin(position) position: vec4f,
  @location(0) at: vec3f,
  @location(1) normal: vec3f,
}

@vertex fn vertex(@location(0) place: vec4f, @location(1) normal: vec4f) -> Point {
  let world = look.model * vec4f(place.xyz, 1.0);
  var position = frame.view * world;
  // WebGL's clip space reaches from −1 to 1, this one from 0.
  position.z = 0.5 * (position.z + position.w);
  return Point(position, world.xyz, (look.model * vec4f(normal.xyz, 0.0)).xyz);
}

fn walls_at(slice: u32) -> vec2f {
  let pair = frame.lumen[slice / 2u];
  return select(pair.zw, pair.xy, slice % 2u == 0u);
}

@fragment fn fragment(point: Point) -> @location(0) vec4f {
  let at = point.at;
  var n = look.normal.xyz;
  if (dot(n, n) == 0.0) { n = normalize(point.normal); }
  var base = look.colour.rgb;
  if (look.cut.x > 0.5) {
    let slot = clamp((at.x - frame.along.x) / (frame.along.y - frame.along.x), 0.0, 1.0) * ${SLICES - 1}.0;
    let low = min(u32(slot), ${SLICES - 2}u);
    let here = walls_at(low);
    let next = walls_at(low + 1u);
    let walls = mix(here, next, slot - f32(low));
    if (here.y > here.x && next.y > next.x) {
      let open = at.z > walls.x && at.z < walls.y;
      // Within the block one sees the hollow vessel, towards its ends and beyond its blood.
      if (open && at.x > frame.along.x + 2.5 && at.x < frame.along.y - 2.5) { discard; }
      let edge = frame.blood.w;
      if (open) { base = frame.blood.rgb; }
      else if (at.z > walls.x - edge && at.z < walls.y + edge) { base = frame.wall.rgb; }
    }
  }
  let to_eye = normalize(frame.eye.xyz - at);
  if (dot(n, to_eye) < 0.0) { n = -n; }
  let light = normalize(vec3f(-0.35, 0.6, -0.9));
  let lit = 0.5 + 0.5 * max(dot(n, light), 0.0);
  let gloss = look.normal.w * pow(max(dot(normalize(light + to_eye), n), 0.0), 40.0);
  return vec4f(base * lit + gloss, look.colour.a);
}`;

const SAMPLES_PER_PIXEL = 4;
const DEPTH_FORMAT = "depth24plus";
/** Numbers of a `Frame`, and of a `Look` with the distance that WebGPU wants between two of them. */
const FRAME_NUMBERS = 32 + 2 * SLICES;
const LOOK_NUMBERS = 28;
const LOOK_STRIDE = 64;
const MOST_MESHES = 128;

export class WebGpu {
  name = "webgpu";

  /** Returns null if WebGPU is not available, or only in software (which `evenInSoftware`
   *  accepts). */
  static async open(canvas, evenInSoftware) {
    const adapter = await navigator.gpu?.requestAdapter();
    const pretends = adapter?.info?.isFallbackAdapter ?? adapter?.isFallbackAdapter;
    if (!adapter || (pretends && !evenInSoftware)) return null;
    const device = await adapter.requestDevice();
    const format = navigator.gpu.getPreferredCanvasFormat();
    // Before the canvas is taken: where this fails it is still free for WebGL.
    const layout = device.createBindGroupLayout({ entries: [uniform(0, false), uniform(1, true)] });
    const passes = await pipelines(device, layout, format);
    const context = canvas.getContext("webgpu");
    if (!context) return null;
    context.configure({ device, format, alphaMode: "opaque" });
    return new WebGpu(canvas, context, device, layout, passes, format);
  }

  constructor(canvas, context, device, layout, passes, format) {
    Object.assign(this, { canvas, context, device, passes, format });
    this.frame = this.buffer(FRAME_NUMBERS * 4, GPUBufferUsage.UNIFORM);
    this.looks = this.buffer(MOST_MESHES * LOOK_STRIDE * 4, GPUBufferUsage.UNIFORM);
    this.look = new Float32Array(MOST_MESHES * LOOK_STRIDE);
    this.group = device.createBindGroup({
      layout,
      entries: [
        { binding: 0, resource: { buffer: this.frame } },
        { binding: 1, resource: { buffer: this.looks, size: LOOK_NUMBERS * 4 } },
      ],
    });
    this.drawn = [];
    /** Resolves where the processor is lost (a driver that starts anew); nothing is drawn from then on. */
    this.lost = device.lost;
  }

  /** A mesh of its own points, four numbers each. */
  shape({ places, normals, triangles }) {
    const points = [places, normals].map((numbers) => this.filled(new Float32Array(numbers), GPUBufferUsage.VERTEX));
    return this.indexed(points, new Uint32Array(triangles));
  }

  /** Meshes that share moving points, in place of those of before; `triangles` of each into `points`. */
  surfaces(points, normals, triangles) {
    for (const buffer of [...(this.moving ?? []), ...(this.shared ?? []).map((mesh) => mesh.index)]) buffer.destroy();
    this.moving = [points, normals].map((numbers) => this.filled(numbers, GPUBufferUsage.VERTEX));
    this.shared = triangles.map((each) => this.indexed(this.moving, each));
    return this.shared;
  }

  /** Begins a picture: where the shared points are now, and what all meshes have in common. */
  begin(points, normals, { view, eye, along, lumen, wall, blood, edge, sky }) {
    const { queue } = this.device;
    [points, normals].forEach((numbers, i) => queue.writeBuffer(this.moving[i], 0, numbers));
    queue.writeBuffer(this.frame, 0, new Float32Array([...view, ...eye, 0, ...wall, 0, ...blood, edge, ...along, 0, 0, ...lumen]));
    this.sky = sky;
    this.drawn = [];
  }

  /** Draws a mesh; `pass` is "opaque", "clear" or "clearNear", clear ones from the back to the front. */
  mesh(mesh, { colour, normal = [0, 0, 0], shine = 0, model = IDENTITY, cut = false, pass = "opaque" }) {
    if (this.drawn.length === MOST_MESHES) return;
    this.look.set([...model, ...colour, ...normal, shine, cut ? 1 : 0], this.drawn.length * LOOK_STRIDE);
    this.drawn.push({ mesh, pass });
  }

  /** Ends the picture: all of it goes to the processor. */
  end() {
    const { device } = this;
    device.queue.writeBuffer(this.looks, 0, this.look, 0, this.drawn.length * LOOK_STRIDE);
    const encoder = device.createCommandEncoder();
    const { colour, depth } = this.targets();
    const clearValue = [...this.sky, 1];
    const resolveTarget = this.context.getCurrentTexture().createView();
    const pass = encoder.beginRenderPass({
      colorAttachments: [{ view: colour, resolveTarget, clearValue, loadOp: "clear", storeOp: "discard" }],
      depthStencilAttachment: { view: depth, depthClearValue: 1, depthLoadOp: "clear", depthStoreOp: "discard" },
    });
    this.drawn.forEach(({ mesh, pass: how }, i) => {
      pass.setPipeline(this.passes[how]);
      pass.setBindGroup(0, this.group, [i * LOOK_STRIDE * 4]);
      mesh.points.forEach((points, slot) => pass.setVertexBuffer(slot, points));
      pass.setIndexBuffer(mesh.index, "uint32");
      pass.drawIndexed(mesh.count);
    });
    pass.end();
    device.queue.submit([encoder.finish()]);
  }

  /** The target that is drawn to before the canvas gets it, as large as the canvas. */
  targets() {
    const { width, height } = this.canvas;
    if (this.textures?.[0].width !== width || this.textures[0].height !== height) {
      this.textures?.forEach((texture) => texture.destroy());
      const usage = GPUTextureUsage.RENDER_ATTACHMENT;
      this.textures = [this.format, DEPTH_FORMAT].map((format) =>
        this.device.createTexture({ size: [width, height], format, usage, sampleCount: SAMPLES_PER_PIXEL }));
    }
    const [colour, depth] = this.textures.map((texture) => texture.createView());
    return { colour, depth };
  }

  indexed(points, triangles) {
    return { points, index: this.filled(triangles, GPUBufferUsage.INDEX), count: triangles.length };
  }

  filled(numbers, usage) {
    const buffer = this.buffer(numbers.byteLength, usage);
    this.device.queue.writeBuffer(buffer, 0, numbers);
    return buffer;
  }

  buffer(size, usage) {
    return this.device.createBuffer({ size, usage: usage | GPUBufferUsage.COPY_DST });
  }
}

function uniform(binding, hasDynamicOffset) {
  return { binding, visibility: GPUShaderStage.VERTEX | GPUShaderStage.FRAGMENT, buffer: { type: "uniform", hasDynamicOffset } };
}

/** One pipeline for each way in which a mesh covers what is behind it. */
async function pipelines(device, layout, format) {
  const module = device.createShaderModule({ code: SHADER });
  const buffers = [0, 1].map((shaderLocation) => ({
    arrayStride: 16,
    attributes: [{ shaderLocation, offset: 0, format: "float32x4" }],
  }));
  const over = { srcFactor: "src-alpha", dstFactor: "one-minus-src-alpha" };
  const make = (clear, near) => device.createRenderPipelineAsync({
    layout: device.createPipelineLayout({ bindGroupLayouts: [layout] }),
    vertex: { module, entryPoint: "vertex", buffers },
    fragment: { module, entryPoint: "fragment", targets: [{ format, blend: clear ? { color: over, alpha: over } : undefined }] },
    primitive: { topology: "triangle-list" },
    multisample: { count: SAMPLES_PER_PIXEL },
    depthStencil: {
      format: DEPTH_FORMAT, depthWriteEnabled: !clear, depthCompare: "less",
      // In front of surfaces in the same plane.
      depthBias: near ? -8 : 0, depthBiasSlopeScale: near ? -4 : 0,
    },
  });
  const [opaque, translucent, clearNear] = await Promise.all([make(false, false), make(true, false), make(true, true)]);
  return { opaque, clear: translucent, clearNear };
}
