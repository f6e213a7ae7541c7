// Traces over the way: the coached lap, the other one, and what was driven with an advice.

import { difference, number } from "../numbers.js";
import { all, h } from "../race/element.js";

const TRACE_WIDTH = 1000;
const LEFT = 40;

/**
 * How a part of a lap was driven, by place on the way; `lost` is what it has lost on the other lap so far, null where that is not known.
 * @typedef {{ place: number[], time_s: number[], speed: number[], pedal: number[], lateral: number[], lost?: (number | null)[] }} Trace
 * @typedef {Exclude<keyof Trace, "place">} Traced
 * @typedef {{
 *   name: string, key: Traced, height: number, least?: number, range?: [number, number], scale?: number, words: (v: number) => string, without?: string,
 * }} Chart `least` that it shows, if it has no `range`
 */

/**
 * The value of a trace at a place, or null outside of it.
 * @param {Trace} traces
 * @param {Traced} name
 * @param {number} place m
 */
export function valueAt(traces, name, place) {
  const { place: at } = traces;
  const last = at.length - 1;
  if (place < at[0] || place > at[last]) return null;
  const exact = ((place - at[0]) / (at[last] - at[0])) * last;
  const low = Math.min(Math.floor(exact), last - 1);
  const [before = null, after = null] = traces[name]?.slice(low, low + 2) ?? [];
  return before === null || after === null ? null : before + (exact - low) * (after - before);
}

/**
 * Seconds that a lap has lost on the other one, at its own places.
 * @param {Trace} lap
 * @param {Trace} other
 */
const lostOn = (lap, other, from = 0) => {
  const began = valueAt(other, "time_s", lap.place[0]) ?? 0;
  return lap.place.map((place, i) => {
    const there = valueAt(other, "time_s", place);
    return there === null ? null : from + lap.time_s[i] - (there - began);
  });
};

/** @param {number} span */
function niceStep(span) {
  const rough = span / 3;
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= rough) ?? rough;
}

/**
 * Charts one above the other; `show` draws a stretch of the lap, `mark` a place in it.
 * @param {Element} box
 * @param {{ own: Trace, other: Trace, edited: Trace[] }} laps
 * @param {(place: number, pressed: boolean) => void} onPlace
 */
export function lapTraces(box, { own, other, edited }, onPlace) {
  for (const lap of [own, other]) lap.lost = lostOn(lap, other);
  for (const drive of edited) drive.lost = lostOn(drive, other, valueAt(own, "lost", drive.place[0]) ?? 0);
  /** @type {Chart[]} */
  const kinds = [
    { name: "Time lost, s", key: "lost", height: 130, least: 0.1, words: (v) => difference(v, 3), without: "other" },
    { name: "Speed, km/h", key: "speed", height: 190, least: 20, scale: 3.6, words: number },
    { name: "Throttle and brake, %", key: "pedal", height: 90, range: [-105, 105], scale: 100, words: number },
    { name: "Line, m left of the middle", key: "lateral", height: 110, least: 2, words: (v) => number(v, 1) },
  ];
  const charts = kinds.map((chart) => {
    /** @type {Record<string, HTMLElement>} */
    const outputs = Object.fromEntries(["own", "other", "edited"].map((who) => [who, h("output", { class: who })]));
    const svg = h("svg:svg", { viewBox: `0 0 ${TRACE_WIDTH} ${chart.height}`, height: chart.height, preserveAspectRatio: "none", role: "img", "aria-label": `${chart.name} over the way` });
    svg.addEventListener("pointermove", (event) => onPlace(placeOf(event), false));
    svg.addEventListener("click", (event) => onPlace(placeOf(event), true));
    const node = h("div", { class: "trace" }, h("p", {}, chart.name, Object.values(outputs)), svg);
    return { ...chart, outputs, svg, node };
  });
  box.append(...charts.map(({ node }) => node));
  let range = [0, own.place.at(-1) ?? 0];
  /** @type {Trace | null} */
  let drive = null;

  /** @param {number} place */
  const across = (place) => LEFT + ((place - range[0]) / (range[1] - range[0])) * (TRACE_WIDTH - LEFT);
  /** @param {MouseEvent} event */
  const placeOf = (event) => {
    const { left, width } = /** @type {Element} */ (event.currentTarget).getBoundingClientRect();
    const x = ((event.clientX - left) / width) * TRACE_WIDTH;
    return range[0] + (Math.max(x - LEFT, 0) / (TRACE_WIDTH - LEFT)) * (range[1] - range[0]);
  };

  /** The laps that a chart shows, by whose they are. */
  const shownIn = (/** @type {Chart} */ { without }) =>
    Object.entries({ other, own, edited: drive }).flatMap(([who, lap]) => (lap && who !== without ? [{ who, lap }] : []));

  /** @param {typeof charts[number]} chart */
  function draw(chart) {
    const { scale = 1 } = chart;
    const inside = shownIn(chart).map(({ who, lap }) => ({
      who,
      points: lap.place.flatMap((place, i) => {
        const value = lap[chart.key]?.[i] ?? null;
        return value !== null && place >= range[0] && place <= range[1] ? [{ place, value: scale * value }] : [];
      }),
    }));
    const values = inside.flatMap(({ points }) => points.map(({ value }) => value));
    let [low, high] = chart.range ?? values.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
    if (!chart.range) {
      const room = Math.max((chart.least ?? 0) - (high - low), 0) / 2 + 0.08 * (high - low);
      [low, high] = [low - room, high + room];
    }
    /** @param {number} value */
    const up = (value) => chart.height - ((value - low) / (high - low)) * (chart.height - 26) - 2;
    const step = chart.range ? 100 : niceStep(high - low);
    const ticks = [];
    for (let value = Math.ceil(low / step) * step; value <= high; value += step) ticks.push(value);
    chart.svg.replaceChildren(
      ...ticks.flatMap((value) => [
        h("svg:line", { class: Math.abs(value) < 1e-9 && "zero", x1: LEFT, x2: TRACE_WIDTH, y1: up(value), y2: up(value) }),
      ]),
      ...inside.map(({ who, points }) => h("svg:path", { class: who, d: points.map(({ place, value }, i) => `${i ? "L" : "M"}${across(place).toFixed(1)} ${up(value).toFixed(1)}`).join("") })),
      h("svg:line", { class: "at", x1: -9, x2: -9, y1: 0, y2: chart.height }));
    for (const tick of all(".tick", chart.node)) tick.remove();
    chart.node.append(...ticks.map((value) => {
      const tick = h("span", { class: "tick" }, `${Number(value.toFixed(3))}`.replace("-", "−"));
      tick.style.top = `${up(value)}px`;
      return tick;
    }));
  }

  return {
    /**
     * @param {number} from m
     * @param {number} to
     * @param {number | null} [driven] the advice
     */
    show(from, to, driven = null) {
      [range, drive] = [[from, to], driven === null ? null : edited[driven]];
      charts.forEach(draw);
    },
    /** @param {number | null} place m */
    mark(place) {
      for (const chart of charts) {
        const [line] = all(".at", chart.svg);
        const x = place === null || place < range[0] || place > range[1] ? -9 : across(place);
        for (const end of ["x1", "x2"]) line.setAttribute(end, String(x));
        for (const output of Object.values(chart.outputs)) output.textContent = "";
        for (const { who, lap } of shownIn(chart)) {
          const value = place === null ? null : valueAt(lap, chart.key, place);
          if (value !== null) chart.outputs[who].textContent = chart.words((chart.scale ?? 1) * value);
        }
      }
    },
  };
}
