// The page: connection, inputs and drawing, put together.

import { all, byId, dataOf } from "../race/element.js";
import { openCircuit, unpacked } from "../race/recording.js";
import { raceScene } from "../race/scene.js";
import { chaseCamera, cockpitCamera } from "../scene3d/cameras.js";
import { newView } from "../scene3d/view.js";
import { momentOf, questionsDialog, showBlind } from "./blind.js";
import { newHud, newReference } from "./hud.js";
import { kept, newInputs } from "./inputs.js";
import { connect, newPlayback } from "./link.js";
import { newMenu, pauseDialog, resultDialog } from "./menu.js";
import { newSound } from "./sound.js";

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
  let seen = newSight();
  const settings = { kind: view ? "chase" : "map", mirror: true, line: true, sound: true, ...kept.read("view", {}) };
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
    if (words.type === "marked") driving?.hud.tell({ text: `You marked ${momentOf(words)}`, cars: [driving.own], penalty_s: 0 }, driving.own);
    if (words.type === "questions") ask(words);
    if (words.type === "refused") refused(words.why);
    if (words.type === "result") finish(words);
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
    const made = await prepare(words.scene, words.cars.map(({ colour }) => colour));
    playback.clear();
    for (const id of ["pause", "result"]) byId(id, HTMLDialogElement).close();
    const reference = newReference(made.reference, made.lap);
    driving = {
      race: words, own: words.choice.seat - 1, made, reference, paused: false, started: false, aids: { ...words.choice.aids },
      hud: newHud({ race: words, scene: made, reference }), map: newMap(made, words.cars),
      drawn: 0, begins: Infinity,
    };
    view?.show(made);
    seen = newSight();
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

  function finish(words) {
    notice("");
    if (!driving) return;
    driving.finished = true;
    resultDialog(words, { onRestart: () => link.say({ type: "restart" }), onLeave: leave, onAsk: ask });
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
    else view?.render(frame, ...seen(frame, driving.own, settings));
    driving.hud.draw(frame, driving.own, performance.now());
    sound.play(frame, driving.own, settings.sound && !driving.paused);
    driving.drawn += 1;
    if (driving.drawn === READY) ready();
  }
  paint();
}

// What the driver looks through, and what of it is drawn: arguments of the view.
function newSight() {
  /** @type {number | null} */
  let heading = null;
  /**
   * @param {import("./link.js").Frame} frame
   * @param {number} own
   * @param {{ kind: string, mirror: boolean, line: boolean }} settings
   * @returns {[import("../scene3d/cameras.js").Camera, { inside: number, mirror: number, line: number }]}
   */
  return (frame, own, { kind, mirror, line }) => {
    const car = frame.cars[own];
    const inside = kind === "cockpit";
    // The camera behind the car turns after it.
    const turn = heading === null ? 0 : Math.atan2(Math.sin(car.yaw - heading), Math.cos(car.yaw - heading));
    heading = heading === null ? car.yaw : heading + turn * 0.12;
    return [inside ? cockpitCamera(car) : chaseCamera(car, heading), { inside: inside ? own : -1, mirror: mirror ? own : -1, line: line ? own : -1 }];
  };
}

// The circuit and the reference lap, unpacked.
async function prepare(scene, colours) {
  const { circuit, reference } = scene;
  const [lines, points, [speed], [time]] = await Promise.all([
    openCircuit(circuit), unpacked(reference.points, circuit.rows), unpacked(reference.speed, circuit.rows), unpacked(reference.time, circuit.rows),
  ]);
  const metres = (row) => Float64Array.from(row, (v) => v * circuit.step);
  return {
    ...scene, ...lines, colours, lap: scene.lap_m,
    reference: {
      x: metres(points[0]), y: metres(points[1]), z: metres(points[2]),
      speed: Float64Array.from(speed, (v) => v * reference.speed_step), time: Float64Array.from(time, (v) => v / 1000),
    },
  };
}

const TRAIL_EVERY = 6; // ticks between two points of a trail
const TRAIL_POINTS = 40;

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
