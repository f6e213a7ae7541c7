// The player: a race from above, with what makes it go.

import { clock, shortened } from "../numbers.js";
import { nearContact, SLOW } from "./battle.js";
import { h } from "./element.js";
import { ALARM, NEWS_S, QUIET, raceScene } from "./scene.js";
import { sightOf } from "./sight.js";
import { calm, spaceScene } from "./space.js";
import { watching } from "./watching.js";

/**
 * @typedef {import("./recording.js").Recording} Recording
 * @typedef {import("./scene.js").SceneState & {
 *   playing: boolean, rate: number, space: boolean, camera: import("./space.js").CameraKind, slow: boolean,
 * }} PlayerState
 * @typedef {ReturnType<typeof racePlayer>} Player
 */

const FOLLOWED = 30; // letters of a name in the menu
const RATES = { 0.25: "¼×", 0.5: "½×", 1: "1×", 2: "2×", 4: "4×", 8: "8×" };

/**
 * Its `node` goes into a page; `on` has functions called with the state whenever the moment or the car changes. With another
 * recording `beside` it, both are shown at the same moment, which may come after the end of one.
 * @param {Recording} recording
 * @param {{ followed?: number, now?: number, scrolls?: boolean, beside?: Recording | null }} [options] `scrolls` where the page does
 */
export function racePlayer(recording, { followed = -1, now = 0, scrolls = false, beside = null } = {}) {
  const { race, cars } = recording;
  const recordings = beside ? [recording, beside] : [recording];
  const end = Math.max(...recordings.map((one) => one.end));
  /** @type {PlayerState} */
  const state = { now: 0, playing: false, rate: 1, followed, zoom: 1, moved: null, scale: 1, centre: [0, 0], space: false, camera: "trackside", slow: false };
  /** @type {((state: PlayerState) => void)[]} */
  const watchers = [];

  const stages = recordings.map((one, i) => {
    const scene = h("canvas", { id: i ? "scene-beside" : "scene", class: "scene", role: "img", "aria-label": "The race from above" });
    const news = h("p", { id: i ? "news-beside" : "news", class: "news", role: "status" });
    // Each has a scale and a middle of its own.
    const own = i ? Object.create(state) : state;
    const map = raceScene(one, scene, own);
    const space = spaceScene(one, own, i ? "space-beside" : "space");
    const sight = sightOf(one.race.sights, () => refresh());
    const draw = () => {
      if (state.space) space.draw();
      else map();
      sight.draw(state);
    };
    return { scene, space, news, own, draw, recording: one, race: one.race, node: h("div", { class: "stage" }, scene, space.node, news, sight.node) };
  });
  const { scene } = stages[0];
  const button = h("button", { id: "play", type: "button", "aria-pressed": "false", onclick: () => play(!state.playing) }, "Play");
  const shownTime = h("output", { id: "clock" }, clock(0));
  const marks = h("svg:svg", { id: "marks", viewBox: `0 0 ${end || 1} 9`, preserveAspectRatio: "none", "aria-hidden": "true" },
    stages.map((stage, i) => stage.race.incidents.map((incident) => h("svg:line", {
      x1: incident.time, x2: incident.time, y1: 1 + 4 * i, y2: 9 - 4 * (stages.length - 1 - i), "stroke-width": 1.5, "vector-effect": "non-scaling-stroke",
      stroke: incident.notice ? QUIET : ALARM,
    }))));
  const scrub = h("input", {
    id: "scrub", type: "range", min: 0, max: end, step: 0.01, value: 0, "aria-label": "Time in the race",
    oninput: () => seek(Number(scrub.value)),
  });
  const rate = h("select", { id: "rate", onchange: () => (state.rate = Number(rate.value)) },
    Object.entries(RATES).sort().map(([value, name]) => h("option", { value, selected: value === "1" }, name)));
  const choice = h("select", { id: "follow", onchange: () => follow(Number(choice.value)) },
    h("option", { value: -1 }, "whole circuit"), race.cars.map(({ name }, car) => h("option", { value: car, title: name }, shortened(name, FOLLOWED))));
  const node = h("div", { class: "player" });
  const watched = watching(stages, state, node, refresh);
  node.append(
    beside ? h("div", { class: "stages" }, stages.map((stage) => stage.node)) : stages[0].node,
    h("div", { class: "transport" }, button, shownTime, h("span", { class: "timeline" }, marks, scrub),
      h("label", {}, "Speed ", rate), h("label", {}, "Follow ", choice), watched.controls, zonesKey(recording)));

  function show() {
    scrub.value = String(state.now);
    scrub.setAttribute("aria-valuetext", clock(state.now));
    shownTime.textContent = clock(state.now);
    for (const { race: { incidents }, news, draw } of stages) {
      const last = incidents.findLast((incident) => incident.time <= state.now && !incident.notice);
      const said = last && state.now - last.time < NEWS_S ? last.text : "";
      if (news.textContent !== said) news.textContent = said;
      draw();
    }
    for (const watcher of watchers) watcher(state);
  }

  let wanted = false;
  function refresh() {
    if (wanted) return;
    wanted = true;
    requestAnimationFrame(() => {
      wanted = false;
      show();
    });
  }

  /** @param {number} seconds */
  function seek(seconds) {
    state.now = Math.min(Math.max(seconds, 0), end);
    refresh();
  }

  /** @param {number} car */
  function choose(car) {
    choice.value = String(car);
    choice.title = race.cars[car]?.name ?? "";
  }

  /** @param {number} car */
  function follow(car) {
    state.followed = car;
    state.zoom = 1;
    state.moved = null;
    choose(car);
    refresh();
  }

  const slowed = () => state.slow && !calm() && recordings.some((one) => nearContact(one, state.now, state.followed));
  const rateNow = () => (slowed() ? Math.min(state.rate, SLOW.rate) : state.rate);

  let before = 0;
  /** @param {number} milliseconds */
  function frame(milliseconds) {
    if (!state.playing) return;
    const passedS = Math.min((milliseconds - before) / 1000, 0.25);
    before = milliseconds;
    if (state.now >= end || !node.isConnected) play(false);
    else seek(state.now + passedS * rateNow());
    requestAnimationFrame(frame);
  }

  /** @param {boolean} on */
  function play(on) {
    if (on && state.now >= end) state.now = 0;
    state.playing = on && end > 0;
    button.textContent = state.playing ? "Pause" : "Play";
    button.setAttribute("aria-pressed", String(state.playing));
    refresh();
    if (state.playing) {
      before = performance.now();
      requestAnimationFrame(frame);
    }
  }

  for (const { scene: canvas, own, node: stage } of stages) {
    new ResizeObserver(refresh).observe(stage);
    canvas.addEventListener("wheel", (event) => {
      // Where the page scrolls, the wheel alone is for that.
      if (scrolls && !event.ctrlKey) return;
      event.preventDefault();
      state.zoom = Math.min(Math.max(state.zoom * Math.exp(-event.deltaY / 600), 0.15), 60);
      refresh();
    }, { passive: false });
    canvas.addEventListener("pointermove", (event) => {
      if (!event.buttons || state.followed >= 0) return;
      const ratio = (window.devicePixelRatio || 1) / own.scale;
      state.moved = [own.centre[0] - event.movementX * ratio, own.centre[1] + event.movementY * ratio];
      refresh();
    });
  }

  /** @param {1 | -1} direction */
  function nextIncident(direction) {
    const times = stages.flatMap((stage) => stage.race.incidents).filter((incident) => !incident.notice)
      .map((incident) => incident.time).sort((a, b) => a - b);
    const there = direction > 0 ? times.find((t) => t > state.now + 0.01) : times.findLast((t) => t < state.now - 0.01);
    if (there !== undefined) seek(there);
  }

  /** @type {{ [key: string]: (event: KeyboardEvent) => void }} */
  const keys = {
    " ": () => play(!state.playing),
    ArrowRight: (event) => seek(state.now + (event.shiftKey ? 10 : 1)),
    ArrowLeft: (event) => seek(state.now - (event.shiftKey ? 10 : 1)),
    ".": () => seek(state.now + 0.1),
    ",": () => seek(state.now - 0.1),
    ArrowDown: () => follow((state.followed + 1) % cars),
    ArrowUp: () => follow((Math.max(state.followed, 0) + cars - 1) % cars),
    "]": () => nextIncident(1),
    "[": () => nextIncident(-1),
    Home: () => seek(0),
    End: () => seek(end),
    m: () => follow(-1),
    ...watched.keys,
  };
  /** @param {KeyboardEvent} event */
  function key(event) {
    const target = /** @type {Element} */ (event.target);
    const elsewhere = target.closest("select, button, [type=checkbox]");
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (event.ctrlKey || event.metaKey || event.altKey || !keys[name]) return;
    if (elsewhere && (name === " " || target.tagName === "SELECT")) return;
    event.preventDefault();
    keys[name](event);
  }

  choose(followed);
  seek(now);
  return { node, scene, state, recording, end, on: watchers, seek, follow, play, key };
}

/**
 * What the coloured stretches of the road are, on a circuit that has them.
 * @param {Recording} recording
 */
const zonesKey = ({ ground }) => ground[2].some(Boolean) && h("span", {
  class: "zones", title: "Where penalties are served: a car that has one is slowed down here until its seconds are over.",
}, "penalty zone");

// The keys that `key` knows, to be shown beside a player.
const KEYS = [["Space"], " play", ["←"], ["→"], " 1 s, with ", ["Shift"], " 10 s", [","], ["."], " 0.1 s", ["↑"], ["↓"], " next car", ["["], ["]"], " incidents", ["M"], " whole circuit, wheel zooms", ["V"], " 3-D", ["C"], " camera", ["F"], " full screen"];
export const keyHints = (before = "") => h("p", { class: "keys" }, before, KEYS.map((part) => (Array.isArray(part) ? h("kbd", {}, part[0]) : `${part}\u2002`)));

const KEPT_MS = 300;

/**
 * Have the moment and the car written down, where they are others than at first, when the player has stood still.
 * @param {Player} player
 * @param {(moment: { at: string, car: string }) => void} write
 */
export function keepMoment(player, write) {
  const first = { ...player.state };
  let timer = 0;
  player.on.push(({ now, followed, playing }) => {
    clearTimeout(timer);
    if (playing || (now === first.now && followed === first.followed)) return;
    timer = setTimeout(() => player.node.isConnected && write({ at: now.toFixed(1), car: String(followed) }), KEPT_MS);
  });
}

/**
 * The moment and the car that a query names, if it does.
 * @param {URLSearchParams} params
 * @returns {{ now?: number, followed?: number }}
 */
export const momentOf = (params) => ({
  ...(params.has("at") && { now: Number(params.get("at")) || 0 }),
  ...(params.has("car") && { followed: Number(params.get("car")) }),
});
