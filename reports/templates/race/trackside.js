// Cameras beside the circuit: where they stand, which of them shows a moment, and where it looks.

import { minus } from "../scene3d/cameras.js";
import { battleAt } from "./battle.js";

/**
 * @typedef {import("./recording.js").Recording} Recording
 * @typedef {import("../scene3d/cameras.js").Place} Place
 */

const CAMERA_GAP_M = 240; // between two along the lap, at most
const CAMERA_ROOM_M = 80; // and at least
const BEND_PER_M = 1 / 300; // curvature from which on a road bends
const CHORD_M = 20; // over which curvature is measured
const STAND = { beyond: 1.5, up: 4 }; // m from the foot of the wall
const PICTURE_M = 24; // what a picture is wide, at least, where the cars are
const WIDEST = 0.62; // half the greater angle of view, rad
export const SHOT = { least: 3, step: 0.5, ahead: 1, turn: 0.8 }; // s

/**
 * One camera outside of each bend, at its middle, and as many in equal steps between two as the gap asks for, each on the side
 * that is outside of the nearest bend.
 * @param {Pick<Recording, "circuit" | "line">} recording
 */
export function tracksideCameras({ circuit, line }) {
  const [n, lap] = [circuit.rows, circuit.lap];
  /** @param {number} i */
  const row = (i) => ((i % n) + n) % n;
  /** @param {number} i */
  const middle = (i) => [(line.left.x[row(i)] + line.right.x[row(i)]) / 2, (line.left.y[row(i)] + line.right.y[row(i)]) / 2];
  const reach = Math.max(Math.round((CHORD_M * n) / lap), 1);
  const curvature = Array.from({ length: n }, (_, i) => {
    const [[ax, ay], [bx, by], [cx, cy]] = [middle(i - reach), middle(i), middle(i + reach)];
    const [ux, uy, vx, vy] = [bx - ax, by - ay, cx - bx, cy - by];
    return Math.atan2(ux * vy - uy * vx, ux * vx + uy * vy) / ((reach * lap) / n);
  });
  /** @param {number} i */
  const turns = (i) => (Math.abs(curvature[row(i)]) > BEND_PER_M ? Math.sign(curvature[row(i)]) : 0);
  const begin = Math.max(curvature.findIndex((_, i) => turns(i) !== turns(i - 1)), 0);
  /** @type {{ at: number, side: "left" | "right" }[]} */
  const bends = [];
  for (let i = begin; i < begin + n; i++) {
    let end = i;
    while (end + 1 < begin + n && turns(end + 1) === turns(i)) end++;
    if (turns(i)) bends.push({ at: (i + end) / 2, side: turns(i) > 0 ? "right" : "left" });
    i = end;
  }
  const room = (CAMERA_ROOM_M * n) / lap;
  const kept = [];
  for (const bend of bends) if (bend.at - (kept.at(-1)?.at ?? -Infinity) >= room) kept.push(bend);
  if (!kept.length) kept.push({ at: 0, side: "right" });
  const cameras = kept.flatMap((bend, k) => {
    const next = k + 1 < kept.length ? kept[k + 1] : { ...kept[0], at: kept[0].at + n };
    const parts = Math.ceil((((next.at - bend.at) / n) * lap) / CAMERA_GAP_M);
    return Array.from({ length: Math.max(parts, 1) }, (_, i) => ({
      at: Math.round(bend.at + ((next.at - bend.at) * i) / parts), side: 2 * i <= parts ? bend.side : next.side,
    }));
  });
  return cameras.map(({ at, side }) => {
    const [wall, edge] = [line[`wall_${side}`], line[side]].map(({ x, y, z }) => [x[row(at)], y[row(at)], z[row(at)]]);
    const wide = Math.hypot(wall[0] - edge[0], wall[1] - edge[1]) || 1;
    const out = [0, 1].map((i) => wall[i] + ((wall[i] - edge[i]) / wide) * STAND.beyond);
    return { along: (row(at) * lap) / n, eye: [...out, wall[2] + STAND.up] };
  });
}

/** @typedef {{ from: number, camera: number, cars: number[] }} Shot */

/**
 * The shots that show a race, in order: from when, by which camera, and of which cars. The camera is the one that is nearest,
 * along the lap, to where the battle is a second later; a shot takes three seconds at least.
 * @param {Recording} recording
 * @param {{ along: number, eye: Place }[]} cameras
 * @param {number} followed the car; -1 for none
 */
export function shotsOf(recording, cameras, followed) {
  const { circuit: { lap }, race: { origin }, samples: { distance } } = recording;
  /** @param {number} along */
  const nearest = (along) => {
    const far = cameras.map((camera) => Math.abs(((((camera.along - along) % lap) + 1.5 * lap) % lap) - 0.5 * lap));
    return far.indexOf(Math.min(...far));
  };
  /** @type {Shot[]} */
  const shots = [];
  for (let now = 0; now <= recording.end; now += SHOT.step) {
    const last = shots.at(-1);
    if (last && now - last.from < SHOT.least) continue;
    const cars = battleAt(recording, recording.tickAt(now), followed);
    const camera = nearest(origin + distance[cars[0]][recording.tickAt(now + SHOT.ahead)]);
    if (!last || camera !== last.camera || cars.join() !== last.cars.join()) shots.push({ from: now, camera, cars });
  }
  return shots;
}

/**
 * How a camera at `eye` shows places: the first in any case, the others as far as the widest picture has room for them.
 * @param {Place} eye
 * @param {Place[]} places
 * @param {number} aspect of the picture, width by height
 * @returns {import("../scene3d/cameras.js").Camera}
 */
export function aimed(eye, places, aspect) {
  const seen = places.map((place) => {
    const [x, y, z] = minus(place, eye);
    return { turn: Math.atan2(y, x), tilt: Math.atan2(z, Math.hypot(x, y)), margin: Math.atan(PICTURE_M / 2 / Math.hypot(x, y, z)) };
  });
  const [first] = seen;
  const aside = seen.map(({ turn }) => Math.atan2(Math.sin(turn - first.turn), Math.cos(turn - first.turn)));
  const widest = Math.atan(Math.tan(WIDEST) * Math.min(aspect, 1));
  /** @type {(value: number, limit: number) => number} */
  const within = (value, limit) => Math.min(Math.max(value, -limit), limit);
  const aim = within((Math.min(...aside) + Math.max(...aside)) / 2, Math.max(widest - first.margin, 0));
  const half = Math.min(Math.max(...seen.map(({ margin }, i) => Math.abs(aside[i] - aim) + margin)), widest);
  const fov = 2 * Math.atan(Math.tan(half) / aspect);
  const mean = seen.reduce((sum, { tilt }) => sum + tilt / seen.length, 0);
  const [turn, tilt] = [first.turn + aim, first.tilt + within(mean - first.tilt, fov / 4)];
  const ahead = [Math.cos(turn) * Math.cos(tilt), Math.sin(turn) * Math.cos(tilt), Math.sin(tilt)];
  const far = Math.hypot(...minus(places[0], eye));
  return { eye, target: eye.map((part, i) => part + ahead[i] * far), up: [0, 0, 1], fov, near: 2 };
}
