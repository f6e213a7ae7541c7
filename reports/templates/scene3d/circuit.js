// The ground of a circuit, its kerbs, walls and paint, in pieces along the lap, so that what lies behind a camera is left out.

import { unit } from "./cameras.js";
import { drawn, LOOK, newMesh, rgb } from "./shapes.js";

const WALL_M = 1.0;
const ZONE = [150, 122, 62]; // where penalties are served
const MEADOW = [92, 124, 66];
const PLAIN_M = 3000;
const PLAIN_PARTS = 24; // on a side, as haze is reckoned at corners
const GROUND_PIECE_M = 120; // of the lap
const FAR_ROWS = 4; // that are drawn as one far away
export const OUTSIDE_M = 90; // as far the land falls away behind a wall
export const FALL_M = 9;
const KERB_M = 0.06;
const LANE_ABOVE_M = 0.03; // pit lane above the run-off
const ADVERTS = [[196, 44, 40], [28, 84, 160], [232, 232, 228], [226, 170, 32], [30, 110, 74], [40, 42, 48]];
const ADVERT_M = 9;

export const UP = [0, 0, 1];

// A point some metres from `a` towards `b`, on the level.
export function toward(a, b, metres) {
  const far = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
  return a.map((part, i) => part + ((b[i] - part) * metres) / far);
}

// The pieces: meshes, the second for far away, with what they are within; `line` holds points by name, `ground` surfaces by row.
export function circuitPieces({ circuit, line, ground }) {
  const n = circuit.rows;
  const spacing = circuit.lap / n;
  const rows = Math.max(Math.round(GROUND_PIECE_M / spacing), 1);
  const pieces = [];
  for (let first = 0; first < n; first += rows) {
    const last = Math.min(first + rows, n);
    const meshes = [1, FAR_ROWS].map((step) => {
      const mesh = newMesh();
      for (let i = first; i < last; i += step) layRow(mesh, { circuit, line, ground, spacing }, i, Math.min(i + step, last) % n);
      if (first === 0) paintStart(mesh, line);
      return mesh;
    });
    const middle = Math.floor((first + last) / 2) % n;
    pieces.push({ meshes, centre: [line.left.x[middle], line.left.y[middle], line.left.z[middle]], reach: (last - first) * spacing / 2 + OUTSIDE_M });
  }
  return pieces;
}

// What lies between two rows.
function layRow(mesh, { circuit, line, ground, spacing }, i, j) {
  const at = (name, k, up = 0) => [line[name].x[k], line[name].y[k], line[name].z[k] + up];
  const tone = 1 + 0.06 * Math.sin(i * 0.37) * Math.sin(i * 0.083);
  const dim = (colour) => colour.map((part) => part * tone);
  const strip = (a, b, colour, look, up = [0, 0]) => mesh.quad(at(a, i, up[0]), at(b, i, up[1]), at(b, j, up[1]), at(a, j, up[0]), colour, look, UP);
  for (const [side, row] of [["left", 0], ["right", 1]]) {
    const [edge, kerb, wall] = [side, `kerb_${side}`, `wall_${side}`];
    strip(wall, kerb, dim(rgb(circuit.surfaces[ground[row][i]])), LOOK.grass);
    if (Math.hypot(line[edge].x[i] - line[kerb].x[i], line[edge].y[i] - line[kerb].y[i]) > 0.1) {
      const colour = rgb(circuit.kerb[Math.floor((i * spacing) / 2.4) % 2]);
      strip(kerb, edge, colour, LOOK.plain, [KERB_M, 0.005]);
      mesh.quad(at(kerb, i), at(kerb, j), at(kerb, j, KERB_M), at(kerb, i, KERB_M), colour.map((part) => part * 0.7), LOOK.plain, UP);
    }
    barrier(mesh, at, wall, edge, i, j, spacing, circuit.walls[side].map(rgb));
    const out = (k) => {
      const away = toward(at(wall, k), at(edge, k), -OUTSIDE_M);
      return [away[0], away[1], line[wall].z[k] - FALL_M];
    };
    mesh.quad(at(wall, i), at(wall, j), out(j), out(i), dim(MEADOW), LOOK.grass, UP);
  }
  if (ground[3][i]) {
    const [edge, other] = ground[3][i] > 0 ? ["left", "right"] : ["right", "left"];
    const beside = (k, away) => toward(at(edge, k, LANE_ABOVE_M), at(other, k, LANE_ABOVE_M), -away);
    const [near, far] = circuit.lane;
    mesh.quad(beside(i, near), beside(i, far), beside(j, far), beside(j, near), dim(rgb(circuit.road)), LOOK.road, UP);
  }
  strip("left", "right", dim(ground[2][i] ? ZONE : rgb(circuit.road)), LOOK.road);
  for (const [side, other] of [["left", "right"], ["right", "left"]]) {
    const [a, b] = [at(side, i, 0.015), at(side, j, 0.015)];
    mesh.quad(a, b, toward(b, at(other, j, 0.015), 0.18), toward(a, at(other, i, 0.015), 0.18), [228, 229, 224], LOOK.road, UP);
  }
}

// A wall with a cap in the colour of its side, panels in two shades of it in turn, and boards along parts of the lap.
function barrier(mesh, at, wall, edge, i, j, spacing, shades) {
  const advert = Math.floor((i * spacing) / ADVERT_M);
  const boards = Math.floor(advert / 14) % 2 === 0;
  const face = boards ? ADVERTS[(advert * 7 + 3) % ADVERTS.length] : shades[advert % shades.length];
  const [foot, road] = [at(wall, i), at(edge, i)];
  const inwards = unit([road[0] - foot[0], road[1] - foot[1], 0.6 * Math.hypot(road[0] - foot[0], road[1] - foot[1])]);
  mesh.quad(foot, at(wall, j), at(wall, j, WALL_M), at(wall, i, WALL_M), face, LOOK.plain, inwards);
  const [a, b] = [at(wall, i, WALL_M), at(wall, j, WALL_M)];
  mesh.quad(a, b, toward(b, at(edge, j, WALL_M), -0.35), toward(a, at(edge, i, WALL_M), -0.35), shades[0], LOOK.plain, UP);
}

// The land below all else, as far as one sees.
export function meadow({ wall_left: left, wall_right: right }) {
  const mesh = newMesh();
  const ends = (part) => [left, right].flatMap((wall) => [Math.min(...wall[part]), Math.max(...wall[part])]);
  const [[x, X], [y, Y], [z]] = ["x", "y", "z"].map((part) => [Math.min(...ends(part)), Math.max(...ends(part))]);
  const [west, east, south, north, low] = [x - PLAIN_M, X + PLAIN_M, y - PLAIN_M, Y + PLAIN_M, z - FALL_M - 3];
  const at = (i, j) => [west + ((east - west) * i) / PLAIN_PARTS, south + ((north - south) * j) / PLAIN_PARTS, low];
  for (let i = 0; i < PLAIN_PARTS; i++) for (let j = 0; j < PLAIN_PARTS; j++) mesh.quad(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1), MEADOW, LOOK.grass, UP);
  hills(mesh, [(x + X) / 2, (y + Y) / 2, low], Math.hypot(X - x, Y - y) / 2);
  return mesh;
}

// Around the horizon.
function hills(mesh, [x, y, low], reach) {
  const chance = drawn(11);
  const parts = 56;
  for (const { away, high, colour } of [{ away: 1500, high: 190, colour: [104, 128, 120] }, { away: 900, high: 90, colour: [88, 118, 84] }]) {
    const crest = [...Array(parts).keys()].map(() => high * (0.25 + chance()));
    const at = (k, radius, up) => [x + radius * Math.cos((k * 2 * Math.PI) / parts), y + radius * Math.sin((k * 2 * Math.PI) / parts), low + up];
    for (let k = 0; k < parts; k++) {
      const l = (k + 1) % parts;
      mesh.quad(at(k, reach + away, 0), at(l, reach + away, 0), at(l, reach + away * 1.35, crest[l]), at(k, reach + away * 1.35, crest[k]), colour);
    }
  }
}

// The line, in squares, and the bridge with the lights above it.
function paintStart(mesh, line) {
  const at = (name, i, up) => [line[name].x[i], line[name].y[i], line[name].z[i] + up];
  const [left, right, next] = [at("left", 0, 0.02), at("right", 0, 0.02), at("left", 1, 0.02)];
  const wide = Math.hypot(left[0] - right[0], left[1] - right[1]);
  const along = unit([next[0] - left[0], next[1] - left[1], 0]);
  for (let row = 0; row < 2; row++) {
    for (let m = 0; m < wide - 0.4; m += 0.8) {
      const ahead = (point, by) => point.map((part, i) => part + along[i] * by);
      const [a, b] = [toward(left, right, m), toward(left, right, Math.min(m + 0.8, wide))];
      const light = (Math.round(m / 0.8) + row) % 2;
      mesh.quad(ahead(a, 0.8 * row), ahead(b, 0.8 * row), ahead(b, 0.8 * row + 0.8), ahead(a, 0.8 * row + 0.8), light ? [244, 244, 244] : [26, 26, 29], LOOK.road, UP);
    }
  }
  gantry(mesh, at("wall_left", 0, 0), at("wall_right", 0, 0), along);
}

function gantry(mesh, left, right, along) {
  const high = 6.4;
  const beam = (a, b, z, Z, deep, colour, look) => {
    const moved = (p, by, up) => [p[0] + along[0] * by, p[1] + along[1] * by, p[2] + up];
    const corners = (up) => [moved(a, -deep, up), moved(b, -deep, up), moved(b, deep, up), moved(a, deep, up)];
    const [foot, head] = [corners(z), corners(Z)];
    for (let k = 0; k < 4; k++) mesh.quad(foot[k], foot[(k + 1) % 4], head[(k + 1) % 4], head[k], colour, look);
    for (const [p, q, r, s] of [head, foot]) mesh.quad(p, q, r, s, colour, look);
  };
  const inward = (a, b, by) => toward(a, b, by);
  for (const [a, b] of [[left, right], [right, left]]) beam(inward(a, b, -0.8), inward(a, b, -0.3), 0, high + 1, 0.3, [60, 64, 72], LOOK.plain);
  beam(inward(left, right, -0.8), inward(right, left, -0.8), high, high + 1.2, 0.35, [36, 40, 48], LOOK.plain);
  const middle = left.map((part, i) => (part + right[i]) / 2);
  for (let k = -2; k <= 2; k++) {
    const place = toward(middle, right, k * 0.9);
    beam(toward(place, right, -0.28), toward(place, right, 0.28), high + 0.3, high + 0.9, 0.38, [112, 22, 22], LOOK.unlit);
  }
}
