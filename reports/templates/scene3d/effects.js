// What tyres leave: dark marks where they slide, smoke, and dust beside the road.

import { UP } from "./circuit.js";
import { LOOK, newMesh, rgb } from "./shapes.js";

const SLIDING = 0.13; // rad between where a car points and where it goes
const SLIDING_M_S = 7; // below this speed nothing is left
const MARK_M = 0.26; // half the width of a mark is half of it
const PUFFS = { count: 7, apart_s: 0.12, grows: 1.7, size: 0.55 };

// How far a car slides sideways between two places, rad, given its yaw.
function slideOf(before, after) {
  const [dx, dy] = [after.x - before.x, after.y - before.y];
  if (Math.hypot(dx, dy) < 0.05) return 0;
  const turn = Math.atan2(dy, dx) - after.yaw;
  return Math.abs(Math.atan2(Math.sin(turn), Math.cos(turn)));
}

export const slides = (before, after) => {
  const slide = slideOf(before, after);
  return after.speed > SLIDING_M_S && slide > SLIDING && slide < 2.6;
};

// The corners of the marks of the four wheels of a car between two places.
export function marksBetween(before, after, wheels) {
  const place = (car, [x, y]) => {
    const [c, s] = [Math.cos(car.yaw), Math.sin(car.yaw)];
    return [car.x + x * c - y * s, car.y + x * s + y * c, car.z + 0.012];
  };
  return wheels.map((wheel) => {
    const [a, b] = [place(before, wheel), place(after, wheel)];
    const far = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
    const [nx, ny] = [(-(b[1] - a[1]) / far) * (MARK_M / 2), ((b[0] - a[0]) / far) * (MARK_M / 2)];
    return [[a[0] - nx, a[1] - ny, a[2]], [b[0] - nx, b[1] - ny, b[2]], [b[0] + nx, b[1] + ny, b[2]], [a[0] + nx, a[1] + ny, a[2]]];
  });
}

// On what a car drives: the name of the colour beside the road, or null on it. `distance` is along the lap.
function besideRoad({ circuit, line, ground }, car, distance) {
  const n = circuit.rows;
  const row = Math.floor(((((distance % circuit.lap) + circuit.lap) % circuit.lap) / circuit.lap) * n) % n;
  const [left, right] = ["left", "right"].map((side) => [line[side].x[row], line[side].y[row]]);
  const wide = Math.hypot(left[0] - right[0], left[1] - right[1]);
  const share = ((car.x - right[0]) * (left[0] - right[0]) + (car.y - right[1]) * (left[1] - right[1])) / wide ** 2;
  const beyond = Math.max(share - 1, -share) * wide;
  return beyond > 1.2 ? rgb(circuit.surfaces[ground[share > 0.5 ? 0 : 1][row]]) : null;
}

// What a car raises between two places: where, of which colour, how much; null where nothing.
export function raisedBy(made, before, after, distance) {
  if (after.speed < SLIDING_M_S) return null;
  const dirt = besideRoad(made, after, distance);
  if (dirt) return { ...after, colour: dirt.map((part) => 90 + 0.55 * part), strength: Math.min(after.speed / 30, 1) };
  return slides(before, after) ? { ...after, colour: [228, 228, 230], strength: 0.7 } : null;
}

// Puffs behind a car: `past(seconds)` tells where it was, with the colour of what it raised, or null.
export function puffsOf(past) {
  const puffs = [];
  for (let k = 0; k < PUFFS.count; k++) {
    const age = k * PUFFS.apart_s;
    const there = past(age);
    if (!there) continue;
    const [c, s] = [Math.cos(there.yaw), Math.sin(there.yaw)];
    for (const side of [-0.75, 0.75]) {
      puffs.push({
        place: [there.x - 1.6 * c - side * s, there.y - 1.6 * s + side * c, there.z + 0.7 * (PUFFS.size + PUFFS.grows * age)],
        size: PUFFS.size + PUFFS.grows * age, colour: there.colour, opacity: there.strength * 0.34 * (1 - k / PUFFS.count),
      });
    }
  }
  return puffs;
}

// Facing whoever looks, gone at the rim.
export function puffModel() {
  const mesh = newMesh();
  for (let k = 0; k < 8; k++) {
    const at = (j) => [Math.cos(j * 0.7854), Math.sin(j * 0.7854), 0];
    mesh.triangle([0, 0, 0], at(k), at(k + 1), [[255, 255, 255, 1], [255, 255, 255, 0], [255, 255, 255, 0]], LOOK.unlit, UP);
  }
  return mesh;
}
