// What stands over the picture: place, times, gaps, the car's instruments, and what the stewards say.

import { difference } from "../numbers.js";
import { byId, h } from "../race/element.js";
import { called, lapTime } from "./words.js";

const NEWS_MS = 7000;
const REFRESH_MS = 80;
const IN_SIGHT_M = 250; // before a bend or a crest hides it

/** @typedef {import("./link.js").Frame} Frame */

/**
 * The row of the circuit at which a car is.
 * @param {number} progress m
 * @param {number} lapM
 * @param {number} rows
 */
const rowAt = (progress, lapM, rows) => Math.floor(((((progress % lapM) + lapM) % lapM) / lapM) * rows) % rows;

/**
 * Metres to the next penalty zone, 0 inside one; infinitely many on a circuit that has none.
 * @param {ArrayLike<number>} zones which rows of the circuit lie in one
 * @param {number} lapM
 * @param {number} progress m
 */
function toZone(zones, lapM, progress) {
  const first = rowAt(progress, lapM, zones.length);
  for (let i = 0; i < zones.length; i++) if (zones[(first + i) % zones.length]) return (i * lapM) / zones.length;
  return Infinity;
}

/**
 * The lap to compare your own with: time since the line at each row of the circuit.
 * @param {{ time: Float64Array }} driver
 * @param {number} lapM
 */
export function newReference(driver, lapM) {
  const rows = driver.time.length;
  /** @type {Float64Array | null} */
  let own = null;
  let running = new Float64Array(rows).fill(NaN);
  /** @type {number | null} */
  let laps = null;
  return {
    own: false,
    /** To the driver's lap, and back to one's own. */
    turn() {
      this.own = !this.own;
    },
    get has() {
      return own !== null;
    },
    /**
     * Seconds behind it at this moment; null where there is nothing to compare.
     * @param {Frame} frame
     * @param {number} progress
     */
    delta(frame, progress) {
      const row = rowAt(progress, lapM, rows);
      if (laps !== null && frame.laps > laps) {
        // It was whole if it began at the line.
        if (frame.lastLap === frame.bestLap && running.filter(Number.isFinite).length > rows * 0.5) own = running;
        running = new Float64Array(rows).fill(NaN);
      }
      laps = frame.laps;
      if (!Number.isFinite(frame.lap)) return null;
      running[row] = frame.lap;
      const there = this.own && own ? own[row] : driver.time[row];
      return Number.isFinite(there) ? frame.lap - there : null;
    },
  };
}

export function newHud({ race, scene, reference }) {
  const [place, times, order, instruments, news, lights] = ["place", "times", "order", "car", "news", "lights"].map((id) => byId(id));
  news.replaceChildren();
  let last = 0;
  const row = (name, value, kind) => h("div", { class: "row" }, h("span", {}, name), h("span", { class: kind }, value));
  const speed = h("b", {}, "0");
  const gear = h("span", { class: "gear" }, "1");
  const bar = (y, colour) => h("svg:rect", { x: 0, y, width: 0, height: 8, rx: 2, fill: colour });
  const back = (y) => h("svg:rect", { x: 0, y, width: 200, height: 8, rx: 2, fill: "#2b3139" });
  const [rpm, throttle, brake] = [bar(2, "#7db8ee"), bar(18, "#7fe0a0"), bar(30, "#f06a6a")];
  const wheel = h("svg:rect", { x: 98, y: 44, width: 4, height: 14, rx: 2, fill: "#e6e8eb" });
  instruments.replaceChildren(
    h("div", { class: "speed" }, speed, h("span", {}, "km/h"), gear),
    h("svg:svg", { viewBox: "0 0 200 62", role: "img", "aria-label": "Engine speed, throttle, brake, steering", preserveAspectRatio: "none" },
      back(2), rpm, back(18), throttle, back(30), brake, h("svg:rect", { x: 0, y: 50, width: 200, height: 2, fill: "#2b3139" }), wheel),
  );

  // What the brown stretches of the road are, while one is in sight or is to be driven to.
  /** @type {(frame: Frame, progress: number) => HTMLElement[]} */
  const zoneKey = (frame, progress) => {
    const away = toZone(scene.ground[2], scene.lap, progress);
    if (away > (frame.penalty > 0 ? Number.MAX_VALUE : IN_SIGHT_M)) return [];
    return [row("Penalty zone", away === 0 ? "here" : `in ${Math.round(away)} m`, "zone")];
  };

  // Seconds between two cars on the road, by the speed of the one behind.
  /** @type {(ahead: Frame["cars"][0], behind: Frame["cars"][0]) => number} */
  const apart = (ahead, behind) => (ahead.progress - behind.progress) / Math.max(behind.speed, 15);

  /**
   * What the stewards say, with the cars called as in the order; the longest first, as "1 driver" is part of "11 driver:pace=0.9".
   * @param {string} text
   * @param {number[]} cars
   */
  function plain(text, cars) {
    const names = cars.map((i) => race.cars[i].name).sort((one, other) => other.length - one.length);
    return names.reduce((words, name) => words.replace(name, called(name)), text);
  }

  /**
   * @param {Frame} frame
   * @param {number} own
   * @param {number | null} delta s
   */
  function draw(frame, own, delta) {
    const car = frame.cars[own];
    speed.textContent = String(Math.round(car.speed * 3.6));
    gear.textContent = String(frame.gear || "R");
    rpm.setAttribute("width", String(200 * Math.min(Math.max(frame.rpm / scene.rpm, 0), 1)));
    throttle.setAttribute("width", String(200 * car.throttle));
    brake.setAttribute("width", String(200 * car.brake));
    wheel.setAttribute("x", String(98 - 98 * Math.min(Math.max(frame.steering, -1), 1)));
    place.replaceChildren(
      h("b", {}, `${car.place}`), h("span", {}, ` of ${frame.cars.length}`),
      h("div", {}, `Lap ${Math.min(frame.laps + 1, race.choice.laps)} of ${race.choice.laps}`),
    );
    times.replaceChildren(
      row("Lap", lapTime(frame.lap)),
      row(reference.own && reference.has ? "To my best" : "To the driver", delta === null ? "–" : difference(delta, 2), delta === null ? "" : delta < 0 ? "better" : "worse"),
      row("Last", lapTime(frame.lastLap)),
      row("Best", lapTime(frame.bestLap)),
      ...(frame.penalty > 0 ? [row("Penalty to serve", `${frame.penalty.toFixed(1)} s`, "worse")] : []),
      ...zoneKey(frame, car.progress),
      ...(frame.warnings ? [row("Warnings", String(frame.warnings))] : []),
    );
    const standing = [...frame.cars.keys()].sort((a, b) => frame.cars[a].place - frame.cars[b].place);
    const mine = standing.indexOf(own);
    const near = standing.length <= 10 ? standing : standing.filter((_, i) => i < 3 || Math.abs(i - mine) < 4);
    order.replaceChildren(
      ...near.map((i) => {
        const other = frame.cars[i];
        const gap = i === own ? "" : difference(other.place < car.place ? -apart(other, car) : apart(car, other), 2);
        const square = h("i", { "data-colour": i });
        // The policy of the page allows no style in markup.
        square.style.background = race.cars[i].colour;
        const name = h("span", {}, square, `${other.place}. ${called(race.cars[i].name)}`);
        return h("div", { class: `row ${i === own ? "own" : ""} ${other.doing}` }, name, h("span", {}, other.doing === "driving" ? gap : other.doing));
      }),
    );
  }

  return {
    /**
     * @param {Frame} frame
     * @param {number} own
     * @param {number} now ms
     */
    draw(frame, own, now) {
      const delta = reference.delta(frame, frame.cars[own].progress);
      if (now - last < REFRESH_MS) return;
      last = now;
      draw(frame, own, delta);
    },
    /** @param {number} left s */
    light(left) {
      lights.classList.toggle("go", left <= 0);
      lights.textContent = left > 3 || left < -1 ? "" : left <= 0 ? "GO" : "●".repeat(4 - Math.ceil(left));
    },
    /**
     * @param {{ text: string, cars: number[], penalty_s: number }} words
     * @param {number} own
     */
    tell({ text, cars, penalty_s: penalty }, own, times = 1) {
      const kind = `${cars.includes(own) ? "own" : ""} ${penalty > 0 ? "penalty" : ""}`;
      const item = h("li", { class: kind }, plain(text, cars));
      news.append(item);
      while (news.children.length > 4) news.children[0].remove();
      setTimeout(() => item.remove(), NEWS_MS * times);
    },
  };
}
