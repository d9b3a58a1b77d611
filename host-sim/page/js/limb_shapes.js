// Shapes of the three-dimensional view that never deform, and the matrices that place them. Numbers only: nothing here draws.

import { HUB_CONE_MM } from "./needle.js";
import { ALONG_MM, HALF_WIDTH_MM, LIMB_RADIUS_MM } from "./picture.js";

/** The limb beyond what is simulated, mm along. */
export const LIMB_MM = [-60, 80];
export const DEEP_MM = 34;
const AROUND = 20;
/** The edge of the limb's skin, as an angle about its axis. */
const LOWEST = Math.acos(1 - DEEP_MM / LIMB_RADIUS_MM);

/** Angles in even steps. */
function steps(from, to) {
  return Array.from({ length: AROUND + 1 }, (_, i) => from + ((to - from) * i) / AROUND);
}

export const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

/** The limb next to the block, a square, a box: each is `{ places, normals, triangles }`, with four
 *  numbers per point. */
export function shapes() {
  const square = { places: [0, 0, 0, 1, 1, 0, 0, 1, 1, 0, 1, 1, 0, 0, 1, 1], normals: new Array(16).fill(0), triangles: [0, 1, 2, 0, 2, 3] };
  return {
    limbBehind: limb(-1),
    limbBefore: limb(1),
    limbEnds: limbEnds(),
    square,
    box: box(),
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
  patch([LIMB_MM[0], ALONG_MM[0]], steps(0, LOWEST));
  patch([ALONG_MM[1], LIMB_MM[1]], steps(0, LOWEST));
  patch(ALONG_MM, steps(edge, LOWEST));
  return { places, normals, triangles };
}

/** The surfaces that close the limb behind the needle's plane at both of its ends. */
function limbEnds() {
  const places = [];
  const normals = [];
  const triangles = [];
  for (const x of LIMB_MM) {
    const first = places.length / 4;
    const point = (y, z) => {
      places.push(x, y, z, 1);
      normals.push(Math.sign(x), 0, 0, 0);
    };
    point(0, DEEP_MM);
    for (const angle of steps(0, LOWEST)) point(-LIMB_RADIUS_MM * Math.sin(angle), LIMB_RADIUS_MM * (1 - Math.cos(angle)));
    for (let i = 1; i <= AROUND; i++) triangles.push(first, first + i, first + i + 1);
  }
  return { places, normals, triangles };
}

/** Cannula and hub of a scene's needle, the tip at the origin, x towards it; each as those of `shapes`. */
export function needleShapes({ length_mm: length, diameter_mm: diameter, bevel_mm: bevel, hub_length_mm: hubLength, hub_diameter_mm: hubDiameter }) {
  const radius = diameter / 2;
  const [front, back] = [-length, -length - hubLength];
  return {
    cannula: cannula(length, radius, bevel),
    hub: turned([[back, 0], [back, hubDiameter / 2], [front - HUB_CONE_MM, hubDiameter / 2], [front, radius], [front, 0]], -radius),
  };
}

/** A tube that is ground at its end: the tip is the deepest edge, at the origin, and the ground face looks up. */
function cannula(length, radius, bevel) {
  const tube = turned([[-length, radius], [0, radius]], -radius);
  const { places, normals, triangles } = tube;
  // The last ring slants back towards its upper edge; z points down.
  for (let i = AROUND; i < 2 * AROUND; i++) places[4 * i] = (bevel * places[4 * i + 2]) / (2 * radius);
  const size = Math.hypot(2 * radius, bevel);
  const face = [(2 * radius) / size, 0, -bevel / size, 0];
  const first = places.length / 4;
  for (let i = AROUND; i < 2 * AROUND; i++) {
    places.push(...places.slice(4 * i, 4 * i + 4));
    normals.push(...face);
  }
  for (let i = 1; i < AROUND - 1; i++) triangles.push(first, first + i, first + i + 1);
  return tube;
}

/** A body turned about an axis along x at the height `axis`, from pairs of x and radius. */
function turned(profile, axis) {
  const places = [];
  const normals = [];
  const triangles = [];
  for (const [x, radius] of profile) {
    for (let i = 0; i < AROUND; i++) {
      const [s, c] = [Math.sin((i / AROUND) * 2 * Math.PI), Math.cos((i / AROUND) * 2 * Math.PI)];
      places.push(x, radius * s, axis + radius * c, 1);
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
export function along({ depth, angle, origin: [x, z] }) {
  const [s, c] = [Math.sin(angle), Math.cos(angle)];
  return [c, 0, s, 0, 0, 1, 0, 0, -s, 0, c, 0, x + depth * c, 0, z + depth * s, 1];
}

/** Clip space as WebGL has it, z from −1 to 1. */
export function perspective(field, aspect, near, far) {
  const f = 1 / Math.tan(field / 2);
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
}

/** The camera's directions to the right, up and back to the eye. z points down into the body, so up is −z. */
export function axesOf(eye, target) {
  const norm = (v) => v.map((x) => x / Math.hypot(...v));
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const back = norm(eye.map((x, i) => x - target[i]));
  const right = norm(cross([0, 0, -1], back));
  return [right, cross(back, right), back];
}

export function look(eye, target) {
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const [right, up, back] = axesOf(eye, target);
  return [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, -dot(right, eye), -dot(up, eye), -dot(back, eye), 1];
}

/** Matrices are stored column by column. */
export function multiply(a, b) {
  const product = new Array(16).fill(0);
  for (let column = 0; column < 4; column++)
    for (let row = 0; row < 4; row++)
      for (let k = 0; k < 4; k++) product[4 * column + row] += a[4 * k + row] * b[4 * column + k];
  return product;
}
