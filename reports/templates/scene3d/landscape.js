// What stands around a circuit: trees of two kinds and stands with people, each one shape drawn in many places.

import { tracksideCameras } from "../race/trackside.js";
import { FALL_M, OUTSIDE_M, toward, UP } from "./circuit.js";
import { block, drawn, LOOK, newMesh } from "./shapes.js";

const TREE_GAP_M = 13;
const TREE_ROOM_M = 24; // from any road
const STAND_M = 14;
const STANDS_AT_START_M = 70; // on either side of the line
const ROAD_CELL_M = 24;

function fir() {
  const mesh = newMesh();
  const trunk = [88, 66, 46];
  block(mesh, [-0.03, -0.03, 0], [0.03, 0.03, 0.2], trunk);
  for (const [low, high, radius, shade] of [[0.12, 0.55, 0.26, 0.85], [0.36, 0.78, 0.2, 1], [0.6, 1, 0.13, 1.15]]) {
    const at = (k) => [radius * Math.cos(k * 1.0472), radius * Math.sin(k * 1.0472), low];
    for (let k = 0; k < 6; k++) mesh.triangle(at(k), at(k + 1), [0, 0, high], [52, 92, 54].map((part) => part * shade * (k % 2 ? 0.94 : 1.04)));
  }
  return mesh;
}

function broadleaf() {
  const mesh = newMesh();
  const chance = drawn(5);
  block(mesh, [-0.04, -0.04, 0], [0.04, 0.04, 0.42], [92, 72, 52]);
  for (const [x, y, z, radius] of [[0.03, 0, 0.64, 0.34], [-0.15, -0.1, 0.5, 0.25]]) {
    const at = (i, k) => {
      const [tilt, turn] = [(-0.5 + i / 3) * Math.PI, k * 1.0472 + i * 0.5];
      return [x + radius * Math.cos(tilt) * Math.cos(turn), y + radius * Math.cos(tilt) * Math.sin(turn), z + radius * Math.sin(tilt)];
    };
    for (let i = 0; i < 3; i++) {
      for (let k = 0; k < 6; k++) {
        const colour = [86, 120, 58].map((part) => part * (0.78 + 0.12 * i + 0.14 * chance()));
        if (i > 0) mesh.triangle(at(i, k), at(i, k + 1), at(i + 1, k + 1), colour);
        if (i < 2) mesh.triangle(at(i, k), at(i + 1, k + 1), at(i + 1, k), colour);
      }
    }
  }
  return mesh;
}

// Steps with a roof, looking along y to the road; far away, people are no more than their shirts.
function stand(far) {
  const mesh = newMesh();
  const chance = drawn(3);
  const half = STAND_M / 2;
  for (let step = 0; step < 7; step++) {
    const [y, z] = [-step * 0.9, 1.2 + 0.6 * step];
    const concrete = [158, 162, 168];
    mesh.quad([-half, y, z - 0.6], [half, y, z - 0.6], [half, y, z], [-half, y, z], concrete, LOOK.plain, [0, 1, 0]);
    mesh.quad([-half, y, z], [half, y, z], [half, y - 0.9, z], [-half, y - 0.9, z], concrete, LOOK.plain, UP);
    for (const [x, way] of [[-half, -1], [half, 1]]) mesh.quad([x, y, -6], [x, y, z], [x, y - 0.9, z], [x, y - 0.9, -6], concrete, LOOK.plain, [way, 0, 0]);
    for (let x = -half + 0.3; x < half - 0.5; x += 0.75) {
      if (chance() < 0.22) continue;
      const shirt = [[200, 60, 54], [60, 96, 180], [236, 232, 224], [236, 190, 70], [70, 74, 84], [90, 150, 110]][Math.floor(chance() * 6)];
      const [left, front] = [x + 0.08 * chance(), y - 0.35];
      if (far) {
        mesh.triangle([left, front, z], [left + 0.44, front, z], [left + 0.21, front - 0.1, z + 0.9], shirt, LOOK.plain, [0, 0.8, 0.6]);
        continue;
      }
      mesh.quad([left, front, z], [left + 0.44, front, z], [left + 0.42, front - 0.1, z + 0.55], [left + 0.02, front - 0.1, z + 0.55], shirt, LOOK.plain, [0, 0.8, 0.6]);
      mesh.triangle([left + 0.06, front - 0.1, z + 0.56], [left + 0.36, front - 0.1, z + 0.56], [left + 0.21, front - 0.1, z + 0.9], [214, 172, 142], LOOK.plain, [0, 0.8, 0.6]);
    }
  }
  for (const x of [-half + 0.2, half - 0.4]) block(mesh, [x, -6.4, 0], [x + 0.25, -6.1, 8.4], [92, 98, 108]);
  mesh.quad([-half, 0.8, 8.1], [half, 0.8, 8.1], [half, -6.6, 8.7], [-half, -6.6, 8.7], [222, 226, 230]);
  mesh.quad([-half, -6.3, -6], [half, -6.3, -6], [half, -6.3, 8.6], [-half, -6.3, 8.6], [120, 126, 134]);
  return mesh;
}

// A matrix that turns about the upright, stretches and moves.
/**
 * @param {number[]} place
 * @param {number} turn rad
 * @param {number} size
 */
function matrixAt([x, y, z], turn, size, tall = size) {
  const [c, s] = [Math.cos(turn) * size, Math.sin(turn) * size];
  return [c, s, 0, 0, -s, c, 0, 0, 0, 0, tall, 0, x, y, z, 1];
}

// Where things stand, by kind: { matrix, tint, at }, along the lap; the second mesh of a kind is for far away.
export function standing({ circuit, line }) {
  const n = circuit.rows;
  const spacing = circuit.lap / n;
  const at = (name, i) => [line[name].x[i], line[name].y[i], line[name].z[i]];
  const roads = new Set();
  const cell = (x, y) => `${Math.floor(x / ROAD_CELL_M)} ${Math.floor(y / ROAD_CELL_M)}`;
  for (let i = 0; i < n; i++) roads.add(cell((line.left.x[i] + line.right.x[i]) / 2, (line.left.y[i] + line.right.y[i]) / 2));
  /** @type {(place: number[], room: number) => boolean} */
  const free = ([x, y], room) => {
    for (let dx = -room; dx <= room; dx += room) for (let dy = -room; dy <= room; dy += room) if (roads.has(cell(x + dx, y + dy))) return false;
    return true;
  };
  const chance = drawn(7);
  /** @typedef {{ matrix: number[], tint: number, at: number[] }} Standing */
  /** @type {Standing[][]} */
  const [firs, leaves, stands] = [[], [], []];
  /** @type {number[][]} */
  const taken = [];
  // A place beyond the wall of a side; the land falls there.
  const beyond = (side, i, metres) => {
    const foot = toward(at(`wall_${side}`, i), at(side, i), -metres);
    return [foot[0], foot[1], line[`wall_${side}`].z[i] - (FALL_M * Math.min(metres, OUTSIDE_M)) / OUTSIDE_M];
  };
  const stood = (side, i) => {
    const foot = beyond(side, i, 3.5);
    if (!free(beyond(side, i, 24), 4)) return;
    const edge = at(side, i);
    const turn = Math.atan2(edge[1] - foot[1], edge[0] - foot[0]) - Math.PI / 2;
    stands.push({ matrix: matrixAt([foot[0], foot[1], line[`wall_${side}`].z[i]], turn, 1), tint: 1, at: foot });
    taken.push(foot);
  };
  const every = Math.max(Math.round((STAND_M + 1) / spacing), 1);
  const reach = Math.round(STANDS_AT_START_M / spacing);
  for (const side of ["left", "right"]) for (let i = -reach; i <= reach; i += every) stood(side, (i + n) % n);
  for (const camera of tracksideCameras({ circuit, line }).filter((_, k) => k % 3 === 1)) {
    const i = Math.floor(camera.along / spacing);
    const side = Math.hypot(camera.eye[0] - line.left.x[i], camera.eye[1] - line.left.y[i]) < Math.hypot(camera.eye[0] - line.right.x[i], camera.eye[1] - line.right.y[i]) ? "left" : "right";
    for (const k of [-3, -2, 2, 3]) stood(side, (i + k * every + n) % n);
  }
  const gap = Math.max(Math.round(TREE_GAP_M / spacing), 1);
  for (let i = 0; i < n; i += gap) {
    for (const side of ["left", "right"]) {
      const foot = beyond(side, i, 7 + 60 * chance() ** 1.5);
      const [size, turn, tint, kind] = [7 + 8 * chance(), 6.28 * chance(), 0.8 + 0.4 * chance(), chance() + 0.35 * Math.sin(i / 40)];
      if (!free(foot, TREE_ROOM_M / 2) || taken.some((other) => Math.hypot(other[0] - foot[0], other[1] - foot[1]) < 16)) continue;
      (kind < 0.5 ? firs : leaves).push({ matrix: matrixAt(foot, turn, kind < 0.5 ? size * 1.1 : size, kind < 0.5 ? size * 1.25 : size), tint, at: foot });
    }
  }
  return [{ meshes: [fir()], places: firs }, { meshes: [broadleaf()], places: leaves }, { meshes: [stand(false), stand(true)], places: stands }];
}
