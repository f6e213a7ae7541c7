// The page: connection, inputs and drawing, put together.

import { marksBetween, puffsOf, raisedBy, slides } from "../scene3d/effects.js";
import { all, byId, dataOf } from "../race/element.js";
import { openCircuit, openRecording, unpacked } from "../race/recording.js";
import { raceScene, sized } from "../race/scene.js";
import { chaseCamera, cockpitCamera } from "../scene3d/cameras.js";
import { newView } from "../scene3d/view.js";
import { momentOf, questionsDialog, showBlind } from "./blind.js";
import { newHud, newReference } from "./hud.js";
import { kept, newInputs } from "./inputs.js";
import { connect, newPlayback } from "./link.js";
import { playedAgain } from "./again.js";
import { newMenu, pauseDialog, resultDialog } from "./menu.js";
import { newSound } from "./sound.js";
import { called } from "./words.js";

const SEND_MS = 1000 / 60;
const READY = 3; // pictures after which the countdown may begin: a graphics driver may take seconds for the first ones
const VIEWS = ["chase", "cockpit", "map"];

/**
 * @typedef {object} Driving
 * @property {any} race as the server tells it
 * @property {number} own the person's car
 * @property {Awaited<ReturnType<typeof prepare>>} made
 * @property {ReturnType<typeof newReference>} reference
 * @property {ReturnType<typeof newHud>} hud
 * @property {ReturnType<typeof newMap>} map
 * @property {ReturnType<typeof newMinimap>} small
 * @property {ReturnType<typeof newTrails>} [trails]
 * @property {Record<string, boolean>} aids
 * @property {boolean} paused
 * @property {boolean} started
 * @property {boolean} [finished]
 * @property {number} drawn pictures
 * @property {number} begins s
 */

function start() {
  const session = dataOf("session");
  const playback = newPlayback();
  const sound = newSound();
  const view = newView(byId("scene", HTMLCanvasElement));
  /** @type {ReturnType<typeof newSight>} */
  let seen = newSight("gt3");
  const settings = { kind: view ? "chase" : "map", mirror: true, line: true, minimap: true, sound: true, ...kept.read("view", {}) };
  if (!view) settings.kind = "map";
  /** @type {Driving | null} the race */
  let driving = null;
  const inputs = newInputs(() => send());
  const seconds = () => performance.now() / 1000;
  let heard = Promise.resolve();

  const link = connect(session, {
    onFrame: (frame) => playback.take(frame, seconds()),
    onState(state) {
      const words = { lost: "The server is gone; waiting for it to come back.", taken: "Another window drives. Reload to drive here.", unknown: "This page is of another server. Reload it." };
      notice(words[state] ?? "");
    },
    // In turn: what comes after a race is about it, and unpacking that one takes a while.
    onWords: (words) => (heard = heard.then(() => hear(words))),
  });

  async function hear(words) {
    if (words.type === "choices") showMenu(words);
    if (words.type === "preparing") notice(words.forecast ? "Getting ready: the computer races it a few times first …" : "Getting ready …");
    if (words.type === "race") await begin(words);
    if (words.type === "paused") pause();
    if (words.type === "going on") resume();
    if (words.type === "stewards") driving?.hud.tell(words, driving.own);
    if (words.type === "marked") driving?.hud.tell({ text: `You marked ${momentOf({ ...words, nearest: words.nearest && called(words.nearest) })}`, cars: [driving.own], penalty_s: 0 }, driving.own);
    if (words.type === "questions") ask(words);
    if (words.type === "refused") refused(words.why);
    if (words.type === "result") await finish(words);
  }

  function notice(text) {
    byId("notice").textContent = text;
    for (const waiting of all("#waiting")) waiting.textContent = text;
  }

  function refused(why) {
    leave();
    notice("");
    byId("refused").textContent = why;
  }

  function ask(questions) {
    leave();
    questionsDialog(questions, {
      onAnswer: (answers) => link.say({ type: "answers", answers }),
      onDrop: () => link.say({ type: "drop" }),
    });
  }

  function showMenu(choices) {
    if (choices.blind) showBlind(choices.blind, () => link.say({ type: "cast" }));
    newMenu({ choices, inputs, onGo: (choice) => {
      sound.begin();
      byId("refused").textContent = "";
      link.say({ type: "race", choice });
    } });
  }

  async function begin(words) {
    const made = await prepare(words.scene, words.cars);
    playback.clear();
    for (const id of ["pause", "result"]) byId(id, HTMLDialogElement).close();
    const reference = newReference(made.reference, made.lap);
    driving = {
      race: words, own: words.choice.seat - 1, made, reference, paused: false, started: false, aids: { ...words.choice.aids },
      hud: newHud({ race: words, scene: made, reference }), map: newMap(made, words.cars), small: newMinimap(made, words.cars),
      drawn: 0, begins: Infinity,
    };
    view?.show(made);
    if (view) [seen, driving.trails] = [newSight(view.kind), newTrails(made, view)];
    byId("menu").hidden = true;
    /** @type {HTMLElement | null} */ (document.activeElement)?.blur(); // a button that is hidden would keep the keys until the next picture
    byId("track").hidden = false;
    notice("");
    if (words.field) driving.hud.tell({ text: words.field, cars: [driving.own], penalty_s: 0 }, driving.own, 4);
  }

  function countDown() {
    if (driving && !driving.started) driving.begins = seconds() + driving.race.countdown_s;
  }

  function ready() {
    if (driving?.paused) return;
    link.say({ type: "ready" });
    countDown();
  }

  function pause() {
    if (!driving) return;
    driving.paused = true;
    if (!driving.started) driving.begins = Infinity;
    pauseDialog({
      aids: driving.aids,
      field: driving.race.field,
      onGoOn: () => link.say({ type: "go on" }),
      onRestart: () => link.say({ type: "restart" }),
      onLeave: () => { link.say({ type: "leave" }); leave(); },
      onAids: (aids) => link.say({ type: "aids", aids }),
    });
  }

  function resume() {
    if (driving) driving.paused = false;
    countDown();
    byId("pause", HTMLDialogElement).close();
  }

  function leave() {
    driving = null;
    for (const id of ["pause", "result"]) byId(id, HTMLDialogElement).close();
    byId("menu").hidden = false;
    byId("track").hidden = true;
  }

  async function finish(words) {
    notice("");
    if (!driving) return;
    driving.finished = true;
    const again = words.race && view ? playedAgain(await openRecording(words.race, driving.race.scene.circuit), words.car) : null;
    if (driving) resultDialog(words, again, { onRestart: () => link.say({ type: "restart" }), onLeave: leave, onAsk: ask });
  }

  function send() {
    if (driving && !driving.paused) link.steer(inputs.read());
  }
  setInterval(send, SEND_MS);

  /** @type {Record<string, () => unknown>} */
  const commands = {
    KeyC: () => (settings.kind = VIEWS[(VIEWS.indexOf(settings.kind) + (view ? 1 : 0)) % VIEWS.length]),
    KeyM: () => link.say({ type: "mark" }),
    KeyN: () => (settings.mirror = !settings.mirror),
    KeyL: () => (settings.line = !settings.line),
    KeyG: () => (settings.minimap = !settings.minimap),
    KeyV: () => (settings.sound = !settings.sound),
    KeyB: () => driving?.reference.turn(),
    KeyP: () => link.say({ type: "pause" }),
    Escape: () => link.say({ type: "pause" }),
    KeyR: () => link.say({ type: "restart" }),
  };
  addEventListener("keydown", (event) => {
    if (!driving || !(event.code in commands) || event.repeat || event.ctrlKey || event.metaKey || document.querySelector("dialog[open]")) return;
    event.preventDefault();
    commands[event.code]();
    kept.write("view", settings);
  });

  // Nobody drives what they cannot see.
  document.addEventListener("visibilitychange", () => {
    if (document.hidden && driving) link.say({ type: "pause" });
  });

  function paint() {
    requestAnimationFrame(paint);
    const frame = driving && playback.at(seconds());
    if (!driving || !frame || frame.cars.length <= driving.own) return;
    const map = settings.kind === "map";
    if (frame.phase !== "countdown" && !driving.started) [driving.started, driving.begins] = [true, seconds() - frame.time];
    driving.hud.light(driving.begins - seconds());
    if (frame.phase === "over" && !driving.finished) notice("The others finish …");
    byId("scene").hidden = map;
    byId("map").hidden = !map;
    if (map) driving.map(frame, driving.own);
    else if (!driving.finished) { // behind the result, which plays the race
      frame.cars[driving.own].steering = frame.steering;
      view?.render({ ...frame, puffs: driving.trails?.(frame) }, ...seen(frame, driving.own, settings));
    }
    if (!map && settings.minimap) driving.small(frame, driving.own);
    byId("small").hidden = map || !settings.minimap;
    driving.hud.draw(frame, driving.own, performance.now());
    sound.play(frame, driving.own, settings.sound && !driving.paused);
    driving.drawn += 1;
    if (driving.drawn === READY) ready();
  }
  paint();
}

// What the driver looks through, and what of it is drawn: arguments of the view.
/** @param {string} model */
function newSight(model) {
  /** @type {number | null} */
  let heading = null;
  /**
   * @param {import("./link.js").Frame} frame
   * @param {number} own
   * @param {{ kind: string, mirror: boolean, line: boolean }} settings
   * @returns {[import("../scene3d/cameras.js").Camera, { inside: number, mirror: number, line: number, moving: boolean }]}
   */
  return (frame, own, { kind, mirror, line }) => {
    const car = frame.cars[own];
    const inside = kind === "cockpit";
    // The camera behind the car turns after it.
    const turn = heading === null ? 0 : Math.atan2(Math.sin(car.yaw - heading), Math.cos(car.yaw - heading));
    heading = heading === null ? car.yaw : heading + turn * 0.12;
    return [inside ? cockpitCamera(car, model) : chaseCamera(car, heading), { inside: inside ? own : -1, mirror: mirror ? own : -1, line: line ? own : -1, moving: true }];
  };
}

// What tyres leave and raise as the race goes on: has marks laid on the road, and tells the puffs of a frame.
function newTrails(made, view) {
  const TRAIL = { apart_s: 0.1, kept: 12 };
  /** @type {[number, import("./link.js").Frame["cars"]][]} */
  let past = []; // with the time of each, the latest last
  return ({ time, cars }) => {
    if (time < (past.at(-1)?.[0] ?? 0)) past = [];
    const before = past.at(-1);
    if (!before || time - before[0] >= TRAIL.apart_s) {
      if (before) view.layMarks(cars.flatMap((car, i) => (slides(before[1][i], car) ? marksBetween(before[1][i], car, view.wheels) : [])));
      past.push([time, cars]);
      past.splice(0, past.length - TRAIL.kept);
    }
    return cars.flatMap((_, i) => puffsOf((age) => {
      const at = past.findLastIndex(([then]) => then <= time - age);
      return at < 1 ? null : raisedBy(made, past[at - 1][1][i], past[at][1][i], past[at][1][i].progress);
    }));
  };
}

// The circuit and the reference lap, unpacked.
async function prepare(scene, cars) {
  const { circuit, reference } = scene;
  const [lines, points, [speed], [time]] = await Promise.all([
    openCircuit(circuit), unpacked(reference.points, circuit.rows), unpacked(reference.speed, circuit.rows), unpacked(reference.time, circuit.rows),
  ]);
  const metres = (row) => Float64Array.from(row, (v) => v * circuit.step);
  return {
    ...scene, ...lines, colours: cars.map(({ colour }) => colour), names: cars.map(({ name }) => name), lap: scene.lap_m,
    reference: {
      x: metres(points[0]), y: metres(points[1]), z: metres(points[2]),
      speed: Float64Array.from(speed, (v) => v * reference.speed_step), time: Float64Array.from(time, (v) => v / 1000),
    },
  };
}

const TRAIL_EVERY = 6; // ticks between two points of a trail
const TRAIL_POINTS = 40;

// The whole circuit in small, with a dot for every car.
function newMinimap({ line, circuit }, cars) {
  const canvas = byId("small", HTMLCanvasElement);
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const middle = (part) => Array.from(line.left[part], (value, i) => (value + line.right[part][i]) / 2);
  const [xs, ys] = [middle("x"), middle("y")];
  const [[west, east], [south, north]] = [xs, ys].map((values) => [Math.min(...values), Math.max(...values)]);
  return (frame, own) => {
    const [width, height, ratio] = sized(canvas);
    const room = 10 * ratio;
    const scale = Math.min((width - 2 * room) / (east - west), (height - 2 * room) / (north - south));
    const at = (x, y) => [width / 2 + (x - (west + east) / 2) * scale, height / 2 - (y - (south + north) / 2) * scale];
    pen.clearRect(0, 0, width, height);
    pen.lineJoin = "round";
    for (const [colour, wide] of /** @type {[string, number][]} */ ([["#12151acc", 7], ["#e6e8eb", 3]])) {
      pen.beginPath();
      for (let i = 0; i <= circuit.rows; i++) {
        const [x, y] = at(xs[i % circuit.rows], ys[i % circuit.rows]);
        pen.lineTo(x, y);
      }
      [pen.strokeStyle, pen.lineWidth] = [colour, wide * ratio];
      pen.stroke();
    }
    const others = [...frame.cars.keys()].filter((car) => car !== own);
    for (const car of [...others, own]) {
      pen.beginPath();
      const [x, y] = at(frame.cars[car].x, frame.cars[car].y);
      pen.arc(x, y, (car === own ? 6 : 4) * ratio, 0, 7);
      [pen.fillStyle, pen.strokeStyle, pen.lineWidth] = [cars[car].colour, car === own ? "#fff" : "#12151a", 1.5 * ratio];
      pen.fill();
      pen.stroke();
    }
  };
}

// The map, drawn by the scene of recorded races, which is given the present and a short past.
function newMap(made, cars) {
  /** @type {number[]} */
  const time = [];
  /** @type {{ x: number[][], y: number[][] }} */
  const samples = { x: cars.map(() => []), y: cars.map(() => []) };
  /** @type {import("./link.js").Frame} */
  let frame;
  /** @type {import("../race/scene.js").Drawable} */
  const recording = {
    race: { cars, length: made.length, width: made.width, incidents: [] }, circuit: made.circuit, cars: cars.length,
    time, samples, line: made.line, ground: made.ground,
    moment: () => [time.length - 1, 0],
    value: (name, car) => Number(frame.cars[car][/** @type {keyof import("./link.js").FrameCar} */ (name)] ?? 0),
    drives: (car) => frame.cars[car].doing === "driving",
  };
  /** @type {import("../race/scene.js").SceneState} */
  const state = { now: 0, followed: 0, zoom: 1, moved: null, scale: 1, centre: [0, 0] };
  const draw = raceScene(recording, byId("map", HTMLCanvasElement), state);
  /**
   * @param {import("./link.js").Frame} now
   * @param {number} own
   */
  return (now, own) => {
    frame = now;
    if (frame.tick - TRAIL_EVERY >= (time.at(-1) ?? -Infinity) * 60) {
      time.push(frame.time);
      frame.cars.forEach(({ x, y }, car) => { samples.x[car].push(x); samples.y[car].push(y); });
      if (time.length > TRAIL_POINTS) for (const column of [time, ...samples.x, ...samples.y]) column.shift();
    }
    [state.now, state.followed] = [frame.time, own];
    draw();
  };
}

start();
