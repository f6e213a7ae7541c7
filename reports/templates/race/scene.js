// A race from above, drawn on a canvas.

import { startNumber } from "./recording.js";

/** @typedef {import("./recording.js").Line} Line */

const TRAIL_S = 3;
export const NEWS_S = 4;
export const ALARM = "#f06a6a";
export const QUIET = "#99a1ac";

/**
 * What draws on a canvas.
 * @param {HTMLCanvasElement} canvas
 */
export const penOf = (canvas) => /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));

/**
 * As many pixels as the screen has for a canvas: width, height, and how many there are in one of the page's.
 * @param {HTMLCanvasElement} canvas
 * @param {number} share of the pixels on a side that the screen has
 */
export function sized(canvas, share = 1) {
  const ratio = (window.devicePixelRatio || 1) * share;
  const [width, height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  return [width, height, ratio];
}

/**
 * What the scene draws; of test drives only the present and a short past.
 * @typedef {Pick<import("./recording.js").Recording, "cars" | "line" | "ground" | "drives"> & {
 *   race: Pick<import("./recording.js").RaceData, "cars" | "length" | "width" | "incidents">,
 *   circuit: Pick<import("./recording.js").CircuitData, "surfaces" | "kerb" | "road" | "lane">,
 *   time: number[], samples: { x: ArrayLike<number>[], y: ArrayLike<number>[] },
 *   moment: (seconds: number) => [number, number],
 *   value: (name: import("./recording.js").SampleName, car: number, tick: number, part: number) => number,
 * }} Drawable
 */

/**
 * @typedef {object} SceneState
 * @property {number} now s
 * @property {number} followed the car; -1 for the whole circuit
 * @property {number} zoom
 * @property {[number, number] | null} moved the middle, m, where somebody has moved the map
 * @property {number} scale what is shown: pixels a metre
 * @property {[number, number]} centre and its middle, m
 */

/**
 * A function that draws the race at state.now, with the camera on car state.followed, or over the whole circuit if that is
 * negative; it leaves what it shows in state.scale and state.centre.
 * @param {Drawable} recording
 * @param {HTMLCanvasElement} scene
 * @param {SceneState} state
 */
export function raceScene(recording, scene, state) {
  const { race, circuit, cars, time, samples, line, ground, moment, value } = recording;
  const view = penOf(scene);
  const bounds = [line.wall_left, line.wall_right].reduce(
    (box, { x, y }) => {
      for (let i = 0; i < x.length; i++) {
        box = [Math.min(box[0], x[i]), Math.min(box[1], y[i]), Math.max(box[2], x[i]), Math.max(box[3], y[i])];
      }
      return box;
    },
    [Infinity, Infinity, -Infinity, -Infinity],
  );

  /**
   * Strips between two lines: rows that are alike share one path, which is built once.
   * @param {Line} first
   * @param {Line} second
   * @param {(row: number) => string | null} kindOf its colour
   */
  function strips(first, second, kindOf) {
    const paths = new Map();
    const n = first.x.length;
    for (let i = 0; i < n; i++) {
      const kind = kindOf(i);
      if (kind === null) continue;
      if (!paths.has(kind)) paths.set(kind, new Path2D());
      const path = paths.get(kind);
      const j = (i + 1) % n;
      path.moveTo(first.x[i], first.y[i]);
      path.lineTo(second.x[i], second.y[i]);
      path.lineTo(second.x[j], second.y[j]);
      path.lineTo(first.x[j], first.y[j]);
      path.closePath();
    }
    return [...paths];
  }

  /** @param {Line} line */
  function closed({ x, y }) {
    const path = new Path2D();
    for (let i = 0; i < x.length; i++) path.lineTo(x[i], y[i]);
    path.closePath();
    return path;
  }

  const fills = [];
  for (const [side, row] of /** @type {["left" | "right", number][]} */ ([["left", 0], ["right", 1]])) {
    /** @param {number} i */
    const surface = (i) => circuit.surfaces[ground[row][i]];
    fills.push(...strips(line[`wall_${side}`], line[`kerb_${side}`], surface));
    const [edge, kerb] = [line[side], line[`kerb_${side}`]];
    /** @param {number} i */
    const wide = (i) => Math.hypot(edge.x[i] - kerb.x[i], edge.y[i] - kerb.y[i]) > 0.1;
    fills.push(...strips(kerb, edge, (i) => (wide(i) ? circuit.kerb[(i >> 1) % 2] : null)));
  }
  /**
   * A line some metres beside an edge of the road.
   * @param {Line} edge
   * @param {Line} other
   * @param {number} away
   */
  function beside(edge, other, away) {
    const wide = Array.from(edge.x, (x, i) => Math.hypot(x - other.x[i], edge.y[i] - other.y[i]));
    /** @param {"x" | "y"} part */
    const moved = (part) => edge[part].map((at, i) => at + ((at - other[part][i]) / wide[i]) * away);
    return { x: moved("x"), y: moved("y"), z: edge.z };
  }
  for (const [edge, other, side] of /** @type {["left" | "right", "left" | "right", number][]} */ ([["left", "right", 1], ["right", "left", -1]])) {
    const [near, far] = circuit.lane.map((away) => beside(line[edge], line[other], away));
    fills.push(...strips(near, far, (i) => (ground[3][i] === side ? circuit.road : null)));
  }
  fills.push(...strips(line.left, line.right, () => circuit.road));
  const zone = strips(line.left, line.right, (i) => (ground[2][i] ? "#f2b134" : null));
  const edges = [closed(line.left), closed(line.right)];
  const walls = [closed(line.wall_left), closed(line.wall_right)];
  const startLine = new Path2D();
  startLine.moveTo(line.left.x[0], line.left.y[0]);
  startLine.lineTo(line.right.x[0], line.right.y[0]);

  // A car in half lengths and half widths, nose to the right.
  /** @type {[number, number][]} */
  const shape = [[1, 0.35], [0.93, 0.72], [0.6, 0.88], [0.1, 0.84], [-0.45, 0.9], [-0.92, 0.9], [-1, 0.6]];
  /** @type {[number, number][][]} */
  const glass = [[[0.3, 0.58], [0.06, 0.68]], [[-0.38, 0.62], [-0.58, 0.5]]];
  const [half, side] = [race.length / 2, race.width / 2];
  /** @type {(points: [number, number][]) => [number, number][]} */
  const mirrored = (points) => [...points, ...points.toReversed().map(([x, y]) => /** @type {[number, number]} */ ([x, -y]))];
  /** @param {[number, number][]} points */
  const polygon = (points) => {
    const path = new Path2D();
    for (const [x, y] of mirrored(points)) path.lineTo(x * half, y * side);
    path.closePath();
    return path;
  };
  const body = polygon(shape);
  const windows = glass.map(polygon);
  const wing = new Path2D();
  wing.rect(-half, -side, 0.14 * half, 2 * side);
  const tyres = new Path2D();
  for (const x of [-0.62, 0.62]) for (const y of [-1, 1]) tyres.rect(x * half - 0.33, y * (side - 0.13) - 0.15, 0.66, 0.3);

  function drawScene() {
    const [width, height, ratio] = sized(scene);
    const [tick, part] = moment(state.now);
    const whole = Math.min(width / (bounds[2] - bounds[0]), height / (bounds[3] - bounds[1])) * 0.94;
    let scale = whole * state.zoom;
    /** @type {[number, number]} */
    let centre = [(bounds[0] + bounds[2]) / 2, (bounds[1] + bounds[3]) / 2];
    if (state.followed >= 0 && time.length) {
      scale = (width / 110) * state.zoom;
      centre = [value("x", state.followed, tick, part), value("y", state.followed, tick, part)];
    } else if (state.moved) {
      centre = state.moved;
    }
    state.scale = scale;
    state.centre = centre;
    const near = scale > 1.5 * ratio;
    view.setTransform(1, 0, 0, 1, 0, 0);
    view.fillStyle = near ? "#26302a" : "#121519";
    view.fillRect(0, 0, width, height);
    const [left, top] = [width / 2 - centre[0] * scale, height / 2 + centre[1] * scale];
    view.setTransform(scale, 0, 0, -scale, left, top);
    for (const [colour, path] of fills) {
      view.fillStyle = colour;
      view.fill(path);
    }
    // Far away the road would be a hair.
    if (!near) {
      view.strokeStyle = "#565b64";
      view.lineWidth = (3.5 * ratio) / scale;
      view.stroke(edges[0]);
      view.stroke(edges[1]);
    }
    view.globalAlpha = 0.3;
    for (const [colour, path] of zone) {
      view.fillStyle = view.strokeStyle = colour;
      view.lineWidth = near ? 0.3 : (4 * ratio) / scale;
      view.fill(path);
      if (!near) view.stroke(path);
    }
    view.globalAlpha = 1;
    if (near) {
      view.lineWidth = 0.18;
      view.strokeStyle = "#e1e2de";
      edges.forEach((edge) => view.stroke(edge));
      view.lineWidth = 0.4;
      view.strokeStyle = "#cdd0d4";
      walls.forEach((wall) => view.stroke(wall));
    }
    view.lineWidth = near ? 0.5 : (2 * ratio) / scale;
    view.strokeStyle = "#fff";
    view.stroke(startLine);
    if (!time.length) return;
    const order = [...Array(cars).keys()].sort((a, b) => Number(a === state.followed) - Number(b === state.followed));
    order.forEach((car) => drawTrail(car, tick, part, near, ratio));
    drawIncidents(near, ratio);
    if (near) order.forEach((car) => drawDraught(car, tick, part));
    order.forEach((car) => drawCar(car, tick, part, near, ratio));
  }

  /** @type {(car: number, tick: number, part: number, near: boolean, ratio: number) => void} */
  function drawTrail(car, tick, part, near, ratio) {
    view.strokeStyle = race.cars[car].colour;
    view.lineWidth = near ? 0.5 : (2 * ratio) / state.scale;
    view.lineCap = "round";
    let [x, y] = [value("x", car, tick, part), value("y", car, tick, part)];
    for (let k = tick; k >= 0 && time[k] > state.now - TRAIL_S; k--) {
      view.globalAlpha = 0.7 * (1 - (state.now - time[k]) / TRAIL_S);
      view.beginPath();
      view.moveTo(x, y);
      [x, y] = [samples.x[car][k], samples.y[car][k]];
      view.lineTo(x, y);
      view.stroke();
    }
    view.globalAlpha = 1;
  }

  /**
   * The hole in the air in front of a car, the brighter the deeper the car sits in it.
   * @type {(car: number, tick: number, part: number) => void}
   */
  function drawDraught(car, tick, part) {
    const share = value("slipstream", car, tick, part);
    if (share < 0.03 || !recording.drives(car, tick)) return;
    view.save();
    view.translate(value("x", car, tick, part), value("y", car, tick, part));
    view.rotate(value("yaw", car, tick, part));
    const reach = 14;
    const fade = view.createLinearGradient(half, 0, half + reach, 0);
    fade.addColorStop(0, `rgba(150, 215, 255, ${0.75 * share})`);
    fade.addColorStop(1, "rgba(150, 215, 255, 0)");
    view.fillStyle = fade;
    view.beginPath();
    view.moveTo(half, -0.8 * side);
    view.lineTo(half + reach, -0.5 * side);
    view.lineTo(half + reach, 0.5 * side);
    view.lineTo(half, 0.8 * side);
    view.fill();
    view.restore();
  }

  /** @type {(car: number, tick: number, part: number, near: boolean, ratio: number) => void} */
  function drawCar(car, tick, part, near, ratio) {
    const [x, y] = [value("x", car, tick, part), value("y", car, tick, part)];
    const driving = recording.drives(car, tick);
    view.globalAlpha = driving ? 1 : 0.45;
    view.save();
    view.translate(x, y);
    if (near) {
      view.rotate(value("yaw", car, tick, part));
      view.fillStyle = "#16171a";
      view.fill(tyres);
      view.fillStyle = race.cars[car].colour;
      view.fill(body);
      view.fillStyle = "#1c222a";
      windows.forEach((pane) => view.fill(pane));
      view.fill(wing);
      if (value("brake", car, tick, part) > 0.05) {
        view.fillStyle = "#ff463c";
        for (const y of [-0.86, 0.42]) view.fillRect(-1.04 * half, y * side, 0.3, 0.44 * side);
      }
    } else {
      const radius = ((car === state.followed ? 7 : 5) * ratio) / state.scale;
      view.beginPath();
      view.arc(0, 0, radius, 0, 2 * Math.PI);
      view.fillStyle = race.cars[car].colour;
      view.fill();
      view.lineWidth = (1.5 * ratio) / state.scale;
      view.strokeStyle = "#121519";
      view.stroke();
    }
    view.restore();
    view.globalAlpha = 1;
    label(near && car === state.followed ? race.cars[car].name : startNumber(car), x, y, near ? 14 : 11, ratio, driving ? "#fff" : QUIET);
  }

  /** @type {(near: boolean, ratio: number) => void} */
  function drawIncidents(near, ratio) {
    for (const incident of race.incidents) {
      const age = state.now - incident.time;
      if (incident.notice || age < 0 || age > NEWS_S || !incident.cars.length) continue;
      const [tick, part] = moment(incident.time);
      const car = incident.cars[0];
      view.globalAlpha = 1 - age / NEWS_S;
      view.strokeStyle = ALARM;
      view.lineWidth = (2 * ratio) / state.scale;
      view.beginPath();
      const radius = near ? 4 + 2 * age : ((8 + 4 * age) * ratio) / state.scale;
      view.arc(value("x", car, tick, part), value("y", car, tick, part), radius, 0, 2 * Math.PI);
      view.stroke();
    }
    view.globalAlpha = 1;
  }

  /** @type {(text: string, x: number, y: number, above: number, ratio: number, colour: string) => void} */
  function label(text, x, y, above, ratio, colour) {
    const [px, py] = [(x - state.centre[0]) * state.scale + scene.width / 2, scene.height / 2 - (y - state.centre[1]) * state.scale];
    if (px < -100 || py < -20 || px > scene.width + 100 || py > scene.height + 20) return;
    view.save();
    view.setTransform(1, 0, 0, 1, 0, 0);
    view.font = `${12 * ratio}px system-ui, sans-serif`;
    view.textAlign = "center";
    view.lineWidth = 3 * ratio;
    view.strokeStyle = "#101317c0";
    view.strokeText(text, px, py - above * ratio);
    view.fillStyle = colour;
    view.fillText(text, px, py - above * ratio);
    view.restore();
  }

  return drawScene;
}
