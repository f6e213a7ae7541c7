// What a driver sees of the own car: the dashboard, the wheel, the pillars.

import { block, LOOK, newMesh } from "./shapes.js";

const TURNS = 2.2; // of the wheel in the driver's hands for full lock, rad
const RIM_M = 0.165;

export function dashboard(eye) {
  const mesh = newMesh();
  const [x, z] = [eye.ahead + 0.72, eye.up - 0.34];
  block(mesh, [x, -0.82, z - 0.5], [x + 0.55, 0.82, z], [58, 60, 66]);
  block(mesh, [x - 0.05, -0.26, z - 0.08], [x + 0.2, 0.26, z + 0.035], [38, 40, 45]);
  mesh.quad([x - 0.052, 0.13, z - 0.06], [x - 0.052, -0.13, z - 0.06], [x - 0.03, -0.13, z + 0.025], [x - 0.03, 0.13, z + 0.025], [26, 62, 88], LOOK.unlit, [-1, 0, 0]);
  for (let k = 0; k < 8; k++) {
    const at = (a, b) => [x - 0.056 + 0.002 * b, 0.105 - 0.026 * (k + 0.7 * a), z + 0.002 + 0.014 * b];
    mesh.quad(at(0, 0), at(1, 0), at(1, 1), at(0, 1), k > 5 ? [220, 60, 50] : [90, 220, 120], LOOK.unlit, [-1, 0, 0]);
  }
  for (const y of [-1, 1]) {
    const [low, high] = [[x + 0.42, y * 0.78, z - 0.02], [x - 0.3, y * 0.56, eye.up + 0.24]];
    const wide = 0.05;
    mesh.quad(low, [low[0] + 0.02, low[1] - y * wide, low[2]], [high[0] + 0.02, high[1] - y * wide, high[2]], high, [22, 23, 26]);
  }
  block(mesh, [x - 0.4, -0.62, eye.up + 0.29], [x - 0.2, 0.62, eye.up + 0.38], [40, 42, 47]);
  return mesh;
}

// The wheel about its own middle, in the plane of y and z.
export function handWheel() {
  const mesh = newMesh();
  const [parts, thick] = [24, 0.017];
  const at = (k, t) => {
    const [turn, round] = [(2 * Math.PI * k) / parts, (2 * Math.PI * t) / 6];
    const radius = RIM_M + thick * Math.cos(round);
    return [thick * Math.sin(round), radius * Math.cos(turn), radius * Math.sin(turn) * 0.92];
  };
  for (let k = 0; k < parts; k++) for (let t = 0; t < 6; t++) mesh.quad(at(k, t), at(k + 1, t), at(k + 1, t + 1), at(k, t + 1), k === 6 || k === 5 ? [226, 176, 40] : [70, 72, 78]);
  block(mesh, [-0.012, -0.15, -0.03], [0.012, 0.15, 0.03], [52, 54, 60]);
  block(mesh, [-0.02, -0.055, -0.06], [0.012, 0.055, 0.045], [44, 46, 52]);
  const buttons = [{ y: -0.09, z: 0, colour: [200, 52, 46] }, { y: 0.09, z: 0, colour: [60, 170, 90] }, { y: -0.03, z: 0.02, colour: [226, 190, 60] }, { y: 0.03, z: 0.02, colour: [80, 140, 220] }];
  for (const { y, z, colour } of buttons) block(mesh, [-0.03, y - 0.012, z - 0.012], [-0.012, y + 0.012, z + 0.012], colour);
  return mesh;
}

// Where the wheel is in a car whose steering stands so, as a matrix of the car's frame.
export function handWheelAt(eye, steering) {
  const [c, s] = [Math.cos(steering * TURNS), Math.sin(steering * TURNS)];
  const [lean, up] = [Math.cos(0.32), Math.sin(0.32)];
  // Turned about its axis, then leant back.
  return new Float32Array([lean, 0, -up, 0, up * s, c, lean * s, 0, up * c, -s, lean * c, 0, eye.ahead + 0.52, 0, eye.up - 0.31, 1]);
}
