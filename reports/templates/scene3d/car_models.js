// Three cars, built from numbers: x in half lengths to the nose, y in half widths, z in metres above the road.

import { block, lathe, loft, LOOK, newMesh } from "./shapes.js";

const BLACK = [24, 25, 28];
const CARBON = [34, 36, 40];
const GLASS = [22, 28, 36];
const PAINT = [236, 236, 236];
const TYRE = [80, 80, 84];
const RIM = [120, 124, 130];
const LAMP = [255, 250, 228];
const REAR_LAMP = [120, 12, 14];

// Sections of a body: place along it; half width at sill and shoulder; heights of underside, shoulder and middle of the top.
// Sections of a cabin: place; half width at its foot and roof; heights of foot and roof.
const MODELS = {
  gt3: {
    axles: [0.56, -0.58], radius: 0.34,
    body: [
      [-1, 0.66, 0.86, 0.47, 0.8, 0.86], [-0.96, 0.7, 0.94, 0.42, 0.86, 0.93], [-0.8, 0.76, 0.99, 0.37, 0.88, 0.97], [-0.62, 0.94, 1, 0.34, 0.88, 0.97],
      [-0.42, 0.95, 0.97, 0.1, 0.85, 0.95], [-0.15, 0.9, 0.91, 0.1, 0.8, 0.92], [0.2, 0.9, 0.92, 0.1, 0.79, 0.92], [0.4, 0.95, 0.97, 0.1, 0.82, 0.92],
      [0.58, 0.97, 1, 0.1, 0.83, 0.89], [0.76, 0.95, 0.96, 0.1, 0.75, 0.8], [0.9, 0.9, 0.88, 0.11, 0.61, 0.67], [0.97, 0.82, 0.76, 0.13, 0.5, 0.55], [1, 0.72, 0.64, 0.2, 0.4, 0.43],
    ],
    cabin: [
      [-0.84, 0.56, 0.4, 0.93, 0.95], [-0.6, 0.66, 0.5, 0.93, 1.1], [-0.4, 0.7, 0.54, 0.92, 1.2], [-0.36, 0.7, 0.545, 0.92, 1.21], [-0.1, 0.71, 0.55, 0.9, 1.24],
      [-0.06, 0.71, 0.55, 0.9, 1.24], [0.06, 0.71, 0.55, 0.9, 1.22], [0.34, 0.68, 0.56, 0.89, 0.94],
    ],
    pillars: [2, 4], roof: [2, 5],
    wing: { x: -0.97, z: 1.22, wide: 0.93, chord: 0.16 },
  },
  coupe: {
    axles: [0.55, -0.6], radius: 0.345,
    body: [
      [-1, 0.64, 0.8, 0.47, 0.9, 0.98], [-0.96, 0.7, 0.9, 0.4, 0.95, 1.03], [-0.8, 0.76, 0.97, 0.36, 0.95, 1.02], [-0.62, 0.94, 1, 0.34, 0.93, 1],
      [-0.4, 0.96, 0.97, 0.15, 0.9, 0.97], [-0.1, 0.94, 0.94, 0.15, 0.87, 0.94], [0.2, 0.94, 0.94, 0.15, 0.86, 0.95], [0.4, 0.96, 0.97, 0.15, 0.86, 0.96],
      [0.58, 0.97, 0.98, 0.15, 0.84, 0.92], [0.78, 0.94, 0.93, 0.16, 0.78, 0.85], [0.92, 0.86, 0.84, 0.18, 0.68, 0.74], [0.98, 0.76, 0.74, 0.22, 0.58, 0.62], [1, 0.66, 0.62, 0.28, 0.48, 0.52],
    ],
    cabin: [
      [-0.88, 0.62, 0.48, 0.98, 1.01], [-0.62, 0.72, 0.54, 0.97, 1.18], [-0.42, 0.76, 0.57, 0.95, 1.28], [-0.37, 0.76, 0.575, 0.95, 1.29], [-0.06, 0.78, 0.58, 0.93, 1.32],
      [-0.02, 0.78, 0.58, 0.93, 1.32], [0.08, 0.78, 0.58, 0.93, 1.3], [0.38, 0.76, 0.6, 0.92, 0.97],
    ],
    pillars: [2, 4], roof: [1, 5],
    wing: null,
  },
  prototype: {
    axles: [0.66, -0.6], radius: 0.345,
    body: [
      [-1, 0.74, 0.74, 0.34, 0.56, 0.6], [-0.9, 0.8, 0.8, 0.3, 0.6, 0.66], [-0.6, 0.72, 0.7, 0.09, 0.6, 0.74], [-0.3, 0.84, 0.8, 0.08, 0.56, 0.72],
      [0, 0.86, 0.78, 0.08, 0.5, 0.62], [0.3, 0.76, 0.64, 0.08, 0.44, 0.56], [0.5, 0.62, 0.5, 0.09, 0.42, 0.52], [0.75, 0.56, 0.42, 0.12, 0.4, 0.46], [0.94, 0.5, 0.36, 0.16, 0.32, 0.36], [1, 0.4, 0.26, 0.2, 0.27, 0.29],
    ],
    cabin: [
      [-0.7, 0.2, 0.1, 0.7, 0.74], [-0.4, 0.36, 0.22, 0.68, 0.92], [-0.14, 0.5, 0.34, 0.6, 1.02], [-0.1, 0.5, 0.345, 0.6, 1.03], [0.06, 0.52, 0.36, 0.57, 1.04],
      [0.1, 0.52, 0.35, 0.56, 1.02], [0.3, 0.48, 0.3, 0.52, 0.74], [0.42, 0.4, 0.24, 0.5, 0.56],
    ],
    pillars: [2], roof: [0, 3],
    // Mudguards over the wheels: place, half length, height.
    guards: [[0.66, 0.24, 0.74, 0.34], [-0.62, 0.36, 0.82, 0.36]],
    wing: { x: -0.98, z: 1.0, wide: 0.96, chord: 0.14 },
    fin: true,
  },
};
export const LIVERIES = 4;
// Of a fin: places along the car, and heights.
const FIN = [[-0.98, 0.66], [-0.98, 0.98], [-0.7, 1], [-0.3, 0.95], [-0.3, 0.7]];
// Sides of a body's sections that look to the road; the others go up on the right and down on the left.
const LOW = new Set([0, 13, 14, 15]);

// Which model a car is drawn as: its own, or that of the kind it is shaped like.
export function modelNamed(name, length, width) {
  if (name in MODELS) return name;
  return width / length > 0.425 ? "gt3" : "coupe";
}

// Half of a section from the middle of the underside to that of the top, and its other half.
function ringOf(points) {
  const other = points.slice(1, -1).toReversed().map(([x, y, z]) => [x, -y, z]);
  return [...points, ...other].toReversed();
}

function bodyRing([x, sill, shoulder, low, high, top], h, s) {
  const [w, b] = [sill * s, shoulder * s];
  const mid = low + 0.45 * (high - low);
  return ringOf([
    [x * h, 0, low], [x * h, 0.8 * w, low], [x * h, w, low + 0.05], [x * h, 0.5 * (w + b) + 0.01, mid], [x * h, b, high - 0.08], [x * h, 0.95 * b, high - 0.015],
    [x * h, 0.78 * b, high + 0.35 * (top - high)], [x * h, 0.3 * b, top - 0.1 * (top - high)], [x * h, 0, top],
  ]);
}

function cabinRing([x, foot, roof, low, top], h, s) {
  const [f, r] = [foot * s, roof * s];
  return ringOf([[x * h, 0, low - 0.06], [x * h, f, low - 0.05], [x * h, f, low], [x * h, r + 0.35 * (f - r), low + 0.75 * (top - low)], [x * h, r, top - 0.04 * Math.min(1, (top - low) * 5)], [x * h, 0.62 * r, top], [x * h, 0, top + 0.006]]);
}

// The whole car on its wheels, nose along x. `wheels` are apart: they turn. `inside` is what is left for who looks out of it.
export function carModel(kind, length, width) {
  const model = MODELS[kind];
  const [h, s] = [length / 2, width / 2];
  const [mesh, glass] = [newMesh(), newMesh()];
  const rings = model.body.map((section) => bodyRing(section, h, s));
  loft(mesh, rings, (k) => (LOW.has(k) ? [BLACK] : [PAINT, k === 1 || k === 12 ? LOOK.sill : k === 6 || k === 7 ? LOOK.stripe : LOOK.paint]));
  cabin(glass, model, h, s);
  for (const x of model.axles) for (const y of [-1, 1]) arch(mesh, x * h, y * s, model);
  details(mesh, model, h, s, rings);
  for (const guard of model.guards ?? []) for (const side of [-1, 1]) mudguard(mesh, guard, side, h, s);
  if (model.wing) wing(mesh, model.wing, h, s);
  if (model.fin) {
    for (const y of [-0.012, 0.012]) {
      const [first, ...others] = FIN.map(([x, z]) => [x * h, y, z]);
      for (let k = 0; k + 1 < others.length; k++) mesh.triangle(first, others[k], others[k + 1], PAINT, LOOK.stripe, [0, Math.sign(y), 0]);
    }
  }
  return { body: mesh, glass, wheels: model.axles.flatMap((x) => [1, -1].map((y) => [x * h, y * (s - 0.105), model.radius])), radius: model.radius };
}

function cabin(mesh, model, h, s) {
  const rings = model.cabin.map((section) => cabinRing(section, h, s));
  loft(mesh, rings, (k, i) => {
    const roof = k > 2 && k < 7 && i >= model.roof[0] && i < model.roof[1];
    if (roof) return [PAINT, k === 4 || k === 5 ? LOOK.stripe : LOOK.paint];
    return model.pillars.includes(i) || k === 0 || k === 9 ? [PAINT, LOOK.paint] : [GLASS, LOOK.glass];
  });
}

function arch(mesh, x, y, { radius }) {
  const side = Math.sign(y);
  const [R, out] = [radius + 0.065, y + side * 0.004];
  const spokes = 18;
  for (let k = 0; k < spokes; k++) {
    const [a, b] = [k, k + 1].map((j) => [x + R * Math.cos((2 * Math.PI * j) / spokes), out, Math.max(radius - 0.02 + R * Math.sin((2 * Math.PI * j) / spokes), 0.06)]);
    mesh.triangle([x, out, radius], a, b, BLACK, LOOK.plain, [0, side, 0]);
  }
}

// Lamps, splitter, skirts, diffuser, mirrors, exhausts.
function details(mesh, model, h, s, rings) {
  const race = model.wing !== null;
  const [tail] = model.body;
  for (const y of [-1, 1]) {
    if (model.guards) mesh.quad(...[[0.7, 0.5, 0.13], [0.9, 0.5, 0.13], [0.9, 0.6, 0.09], [0.7, 0.6, 0.09]].map(([across, z, back]) => [(0.98 - back) * h, y * across * s, z]), LAMP, LOOK.unlit);
    else lamp(mesh, rings.at(-4), rings.at(-3), y > 0 ? [9, 8] : [4, 5]);
    const rear = -1.004 * h;
    const rearZ = tail[4] - 0.13;
    mesh.quad([rear, y * 0.36 * s, rearZ], [rear, y * 0.84 * s, rearZ], [rear, y * 0.84 * s, rearZ + 0.085], [rear, y * 0.36 * s, rearZ + 0.085], REAR_LAMP, LOOK.brake, [-1, 0, 0]);
    const [near, out, foot] = model.guards ? [0.4, 0.62, 0.68] : [0.78, 0.98, 0.9];
    block(mesh, [(model.cabin[5][0] + 0.17) * h, Math.min(y * near * s, y * out * s), foot], [(model.cabin[5][0] + 0.21) * h, Math.max(y * near * s, y * out * s), foot + 0.1], BLACK);
    block(mesh, [-0.36 * h, y > 0 ? 0.88 * s : -0.97 * s, 0.08], [0.34 * h, y > 0 ? 0.97 * s : -0.88 * s, 0.16], CARBON);
    if (!model.guards) block(mesh, [-1.01 * h, y * 0.4 * s - 0.05, tail[3] - 0.06], [-0.95 * h, y * 0.4 * s + 0.05, tail[3] + 0.03], [70, 72, 76]);
  }
  // The brake light in the middle, as high as the tail.
  mesh.quad([-1.006 * h, -0.16, tail[4] - 0.02], [-1.006 * h, 0.16, tail[4] - 0.02], [-1.006 * h, 0.16, tail[4] + 0.02], [-1.006 * h, -0.16, tail[4] + 0.02], REAR_LAMP, LOOK.brake, [-1, 0, 0]);
  mesh.quad([-1.003 * h, -0.62 * s, tail[3]], [-1.003 * h, 0.62 * s, tail[3]], [-1.003 * h, 0.76 * s, tail[4] - 0.17], [-1.003 * h, -0.76 * s, tail[4] - 0.17], PAINT, LOOK.paint, [-1, 0, 0]);
  if (race) block(mesh, [0.7 * h, -0.93 * s, 0.075], [1.03 * h, 0.93 * s, 0.1], CARBON);
  // Between the wheels, which are seen beside it.
  block(mesh, [-1.0 * h, -0.62 * s, 0.24], [-0.82 * h, 0.62 * s, tail[3]], BLACK, LOOK.plain, -0.02);
  if (race) for (const y of [-0.45, -0.15, 0.15, 0.45]) block(mesh, [-1.02 * h, y * s - 0.012, 0.2], [-0.84 * h, y * s + 0.012, 0.34], CARBON);
}

// Over a part of the skin between two sections, with its edges at these points of them.
function lamp(mesh, back, front, [low, high]) {
  const on = (k, share) => back[k].map((part, i) => part + (front[k][i] - part) * share + [0.015, 0, 0.015][i]);
  const between = (share, t) => on(low, share).map((part, i) => part + (on(high, share)[i] - part) * t);
  mesh.quad(between(0.95, 0.1), between(0.9, 0.9), between(0.35, 0.85), between(0.5, 0.15), LAMP, LOOK.unlit, [0.6, 0, 0.8]);
}

function wing(mesh, { x, z, wide, chord }, h, s) {
  const [back, front] = [x * h - 0.12, x * h - 0.12 + 2 * chord];
  block(mesh, [back, -wide * s, z], [front, wide * s, z + 0.03], PAINT, LOOK.stripe, -0.015);
  for (const y of [-1, 1]) {
    block(mesh, [back - 0.03, y * wide * s - 0.012, z - 0.16], [front + 0.03, y * wide * s + 0.012, z + 0.08], CARBON);
    block(mesh, [back + 0.08, y * 0.36 * s - 0.014, 0.8], [back + 0.24, y * 0.36 * s + 0.014, z], CARBON);
  }
}

function mudguard(mesh, [x, reach, top, foot], side, h, s) {
  const y = side * s * 0.8;
  const rings = [-1, -0.85, -0.55, -0.2, 0.2, 0.55, 0.85, 1].map((t) => {
    const rise = Math.sqrt(Math.max(1 - t * t, 0));
    const [z, w] = [foot + (top - foot) * rise, 0.2 * s * (0.82 + 0.18 * rise)];
    const at = (x + t * reach) * h;
    const low = 0.16 + 0.14 * Math.min(Math.max(-2 * t, 0), 1); // so that the wheel is seen from behind
    return [[at, y - w, low], [at, y - w, z - 0.05], [at, y - 0.6 * w, z], [at, y + 0.6 * w, z], [at, y + w, z - 0.05], [at, y + w, low]];
  });
  loft(mesh, rings, (k) => (k === 2 ? [PAINT, LOOK.stripe] : k === 5 ? [BLACK] : [PAINT, LOOK.paint]));
}

// A wheel about its own middle, axle along y, outside to the left.
export function wheelModel(radius) {
  const mesh = newMesh();
  const r = radius;
  lathe(mesh, [[-0.14, 0.6 * r], [-0.14, 0.93 * r], [-0.11, r], [0.11, r], [0.145, 0.94 * r], [0.148, 0.68 * r]], 16, TYRE);
  lathe(mesh, [[0.147, 0.68 * r], [0.12, 0.64 * r], [0.06, 0.6 * r], [0.05, 0]], 16, [44, 46, 50]);
  for (let k = 0; k < 5; k++) {
    const at = (turn, radius, y) => [radius * Math.cos(1.2566 * k + turn), y, radius * Math.sin(1.2566 * k + turn)];
    mesh.quad(at(-0.35, 0.1 * r, 0.1), at(-0.16, 0.66 * r, 0.13), at(0.16, 0.66 * r, 0.13), at(0.35, 0.1 * r, 0.1), RIM, LOOK.glass, [0, 1, 0]);
  }
  lathe(mesh, [[0.1, 0.16 * r], [0.12, 0]], 10, [190, 40, 36]);
  return mesh;
}

// What a car darkens below it: most in the middle, nothing a little beyond its sides.
export function shadowModel(length, width) {
  const mesh = newMesh();
  const parts = 16;
  const ring = (grown, opacity) => [...Array(parts).keys()].map((k) => {
    const [c, s] = [Math.cos((k * 2 * Math.PI) / parts), Math.sin((k * 2 * Math.PI) / parts)];
    const edge = (share, half) => Math.sign(share) * Math.min(1.5 * Math.abs(share), 1) * half;
    return { place: [edge(c, length / 2) + c * grown, edge(s, width / 2) + s * grown, 0], colour: [8, 9, 12, opacity] };
  });
  const rings = [Array(parts).fill({ place: [0, 0, 0], colour: [8, 9, 12, 0.8] }), ring(-0.3, 0.74), ring(0.04, 0.5), ring(0.45, 0)];
  for (let i = 0; i + 1 < rings.length; i++) {
    for (let k = 0; k < parts; k++) {
      const l = (k + 1) % parts;
      const [a, b, c, d] = [rings[i][k], rings[i + 1][k], rings[i + 1][l], rings[i][l]];
      mesh.triangle(a.place, b.place, c.place, [a.colour, b.colour, c.colour], LOOK.unlit, [0, 0, 1]);
      mesh.triangle(a.place, c.place, d.place, [a.colour, c.colour, d.colour], LOOK.unlit, [0, 0, 1]);
    }
  }
  return mesh;
}
