// A race in three dimensions, in the place of the map.

import { besideCar, chaseCamera, cockpitCamera, projected } from "../scene3d/cameras.js";
import { marksBetween, puffsOf, raisedBy, slides } from "../scene3d/effects.js";
import { newView } from "../scene3d/view.js";
import { watchedCar } from "./battle.js";
import { h } from "./element.js";
import { startNumber } from "./recording.js";
import { aimed, SHOT, shotsOf, tracksideCameras } from "./trackside.js";

/** @typedef {"trackside" | "chase" | "cockpit"} CameraKind */

/** @type {Record<CameraKind, string>} */
export const CAMERAS = { trackside: "trackside", chase: "from behind", cockpit: "from the cockpit" };
const LAG_S = 0.15; // by which the camera behind a car turns later than the car
const LABEL_M = 1.7;
/** @type {("x" | "y" | "z" | "yaw" | "pitch" | "roll" | "speed" | "distance" | "steering" | "brake")[]} */
const DRAWN = ["x", "y", "z", "yaw", "pitch", "roll", "speed", "distance", "steering", "brake"];

export const calm = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

/**
 * Its `node` goes over the map; `open` tells whether the browser can draw it, and `draw` draws the race at state.now.
 * @param {import("./recording.js").Recording} recording
 * @param {import("./player.js").PlayerState} state
 * @param {string} id
 */
export function spaceScene(recording, state, id) {
  const { race, circuit, line, ground, cars } = recording;
  const canvas = h("canvas", { id, class: "scene", role: "img", "aria-label": "The race in three dimensions" });
  const labels = race.cars.map(({ name }, car) => h("span", { class: "label", title: name }, startNumber(car)));
  const told = h("p", { class: "shot" });
  const node = h("div", { class: "space", hidden: true }, canvas, h("div", { class: "labels", "aria-hidden": "true" }, labels), told);
  const cameras = tracksideCameras(recording);
  const shots = new Map();
  /** @type {import("../scene3d/view.js").View | null} */
  let view = null;
  /** @type {import("./trackside.js").Shot & { followed: number, before?: import("./trackside.js").Shot } | null} */
  let held = null; // the shot while nothing may cut
  /** @type {{ time: number, quads: number[][][] }[] | null} */
  let skids = null;

  function open() {
    view ??= newView(canvas);
    if (view && !skids) {
      view.show({ circuit, line, ground, kind: race.kind, length: race.length, width: race.width, colours: race.cars.map(({ colour }) => colour), names: race.cars.map(({ name }) => name) });
      skids = skidsOf();
      view.layMarks(skids.flatMap(({ quads }) => quads));
    }
    return view !== null;
  }

  /** @param {number} seconds */
  function frameAt(seconds) {
    const [tick, part] = recording.moment(seconds);
    return { puffs: puffsAt(seconds), cars: race.cars.map((_, car) => drawnAt(car, tick, part)) };
  }

  /** @type {(car: number, tick: number, part: number) => import("../scene3d/view.js").DrawnCar} */
  function drawnAt(car, tick, part) {
    return /** @type {any} */ (Object.fromEntries(DRAWN.map((name) => [name, recording.value(name, car, tick, part)])));
  }

  // The marks of tyres, in the order in which they are left.
  function skidsOf() {
    const found = [];
    const last = race.cars.map((_, car) => drawnAt(car, 0, 0));
    for (let tick = 1; tick < recording.time.length; tick++) {
      for (let car = 0; car < cars; car++) {
        const [before, after] = [last[car], drawnAt(car, tick, 0)];
        last[car] = after;
        if (view && slides(before, after)) found.push({ time: recording.time[tick], quads: marksBetween(before, after, view.wheels) });
      }
    }
    return found;
  }

  // Dust of cars beside the road, and smoke of those that slide.
  function puffsAt(seconds) {
    return race.cars.flatMap((_, car) => puffsOf((age) => {
      const [now, before] = [seconds - age, seconds - age - 0.1].map((t) => drawnAt(car, ...recording.moment(Math.max(t, 0))));
      return raisedBy(recording, before, now, (now.distance ?? 0) + race.origin);
    }));
  }

  function shotNow() {
    const { followed, now } = state;
    if (calm() && state.playing && held?.followed === followed) return held;
    if (!shots.has(followed)) shots.set(followed, shotsOf(recording, cameras, followed));
    const all = shots.get(followed);
    const i = Math.max(all.findLastIndex((shot) => shot.from <= now), 0);
    held = { ...all[i], followed, before: all[i - 1] };
    return held;
  }

  /**
   * A camera that goes on with other cars turns to them.
   * @param {NonNullable<typeof held>} shot
   * @param {ReturnType<typeof frameAt>} frame
   * @param {number} watched the car
   * @param {number} aspect
   */
  function tracksideCamera(shot, frame, watched, aspect) {
    const { eye } = cameras[shot.camera];
    const aim = (battle) => aimed(eye, [...new Set([watched, ...battle])].map((car) => besideCar(frame.cars[car], 0, 0.6)), aspect);
    const now = aim(shot.cars);
    const turned = (state.now - shot.from) / SHOT.turn;
    if (shot.before?.camera !== shot.camera || turned >= 1 || calm()) return now;
    const [before, part] = [aim(shot.before.cars), turned * turned * (3 - 2 * turned)];
    const between = (a, b) => a + (b - a) * part;
    return { ...now, target: now.target.map((to, i) => between(before.target[i], to)), fov: between(before.fov, now.fov) };
  }

  /**
   * Of the cars that are in the picture.
   * @param {import("./trackside.js").Shot} shot
   * @param {number} tick
   * @param {number} watched the car
   * @param {boolean[]} seen
   */
  function tell(shot, tick, watched, seen) {
    const [first = watched, second] = shot.cars.filter((car) => seen[car]);
    const who = second === undefined ? race.cars[first].name : `${race.cars[first].name}, ${recording.gap(second, first, tick).toFixed(1)} s before ${race.cars[second].name}`;
    return `Camera ${shot.camera + 1} of ${cameras.length}: ${who}`;
  }

  const marksBy = (seconds) => (skids ?? []).reduce((sum, { time, quads }) => sum + (time <= seconds ? quads.length : 0), 0);

  function draw() {
    if (!view) return;
    const tick = recording.tickAt(state.now);
    const watched = watchedCar(recording, tick, state.followed);
    const frame = frameAt(state.now);
    const own = frame.cars[watched];
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const shot = state.camera === "trackside" ? shotNow() : null;
    const camera = shot ? tracksideCamera(shot, frame, watched, width / height)
      : state.camera === "cockpit" ? cockpitCamera(own, view.kind)
        : chaseCamera(own, recording.value("yaw", watched, ...recording.moment(state.now - LAG_S)));
    const within = state.camera === "cockpit" ? watched : -1;
    const matrix = view.render(frame, camera, { inside: within, mirror: within, marks: marksBy(state.now), moving: state.playing });
    const seen = labels.map(() => false);
    for (let car = 0; car < cars; car++) {
      const [x, y, ahead] = projected(matrix, besideCar(frame.cars[car], 0, LABEL_M));
      seen[car] = ahead > 1 && Math.abs(x) < 1 && Math.abs(y) < 1 && !(state.camera === "cockpit" && car === watched);
      labels[car].hidden = !seen[car];
      labels[car].classList.toggle("own", car === watched);
      if (seen[car]) labels[car].style.translate = `${((1 + x) / 2) * width}px ${((1 - y) / 2) * height}px`;
    }
    const words = shot ? tell(shot, tick, watched, seen) : race.cars[watched].name;
    if (told.textContent !== words) told.textContent = words;
  }

  return { node, canvas, open, draw };
}
