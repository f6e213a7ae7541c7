// Traces over the way: the coached lap, the other one, and what was driven with an advice.

import { difference } from "../numbers.js";
import { all, h } from "../race/element.js";

const TRACE_WIDTH = 1000;
const LEFT = 40;

// The value of a trace at a place, or null outside of it.
export function valueAt(traces, name, place) {
  const { place: at } = traces;
  const last = at.length - 1;
  if (place < at[0] || place > at[last]) return null;
  const exact = ((place - at[0]) / (at[last] - at[0])) * last;
  const low = Math.min(Math.floor(exact), last - 1);
  return traces[name][low] + (exact - low) * (traces[name][low + 1] - traces[name][low]);
}

// Seconds that a lap has lost on the other one, at its own places.
const lostOn = (lap, other, from = 0) =>
  lap.place.map((place, i) => from + lap.time_s[i] - (valueAt(other, "time_s", place) - (valueAt(other, "time_s", lap.place[0]) ?? 0)));

function niceStep(span) {
  const rough = span / 3;
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= rough) ?? rough;
}

// Charts one above the other; `show` draws a stretch of the lap, `mark` a place in it.
export function lapTraces(box, { own, other, edited }, onPlace) {
  for (const lap of [own, other]) lap.lost = lostOn(lap, other);
  for (const drive of edited) drive.lost = lostOn(drive, other, valueAt(own, "lost", drive.place[0]));
  const charts = [
    { name: "Time lost, s", key: "lost", height: 130, least: 0.1, words: (v) => difference(v, 3), without: "other" },
    { name: "Speed, km/h", key: "speed", height: 190, least: 20, scale: 3.6, words: (v) => v.toFixed(0) },
    { name: "Throttle and brake, %", key: "pedal", height: 90, range: [-105, 105], scale: 100, words: (v) => v.toFixed(0) },
    { name: "Line, m left of the middle", key: "lateral", height: 110, least: 2, words: (v) => v.toFixed(1) },
  ].map((chart) => {
    const outputs = Object.fromEntries(["own", "other", "edited"].map((who) => [who, h("output", { class: who })]));
    const svg = h("svg:svg", { viewBox: `0 0 ${TRACE_WIDTH} ${chart.height}`, height: chart.height, preserveAspectRatio: "none", role: "img", "aria-label": `${chart.name} over the way` });
    svg.addEventListener("pointermove", (event) => onPlace(placeOf(event), false));
    svg.addEventListener("click", (event) => onPlace(placeOf(event), true));
    const node = h("div", { class: "trace" }, h("p", {}, chart.name, Object.values(outputs)), svg);
    return { ...chart, outputs, svg, node };
  });
  box.append(...charts.map(({ node }) => node));
  let range = [0, own.place.at(-1)];
  let drive = null;

  const across = (place) => LEFT + ((place - range[0]) / (range[1] - range[0])) * (TRACE_WIDTH - LEFT);
  const placeOf = (event) => {
    const { left, width } = event.currentTarget.getBoundingClientRect();
    const x = ((event.clientX - left) / width) * TRACE_WIDTH;
    return range[0] + (Math.max(x - LEFT, 0) / (TRACE_WIDTH - LEFT)) * (range[1] - range[0]);
  };

  function draw(chart) {
    const lines = Object.entries({ other, own, edited: drive }).filter(([who, lap]) => lap && who !== chart.without);
    const inside = lines.map(([who, lap]) => [who, lap.place.map((place, i) => [place, (chart.scale ?? 1) * lap[chart.key][i]]).filter(([place]) => place >= range[0] && place <= range[1])]);
    const values = inside.flatMap(([, points]) => points.map(([, value]) => value));
    let [low, high] = chart.range ?? values.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
    if (!chart.range) {
      const room = Math.max(chart.least - (high - low), 0) / 2 + 0.08 * (high - low);
      [low, high] = [low - room, high + room];
    }
    const up = (value) => chart.height - ((value - low) / (high - low)) * (chart.height - 26) - 2;
    const step = chart.range ? 100 : niceStep(high - low);
    const ticks = [];
    for (let value = Math.ceil(low / step) * step; value <= high; value += step) ticks.push(value);
    chart.svg.replaceChildren(
      ...ticks.flatMap((value) => [
        h("svg:line", { class: Math.abs(value) < 1e-9 && "zero", x1: LEFT, x2: TRACE_WIDTH, y1: up(value), y2: up(value) }),
      ]),
      ...inside.map(([who, points]) => h("svg:path", { class: who, d: points.map(([place, value], i) => `${i ? "L" : "M"}${across(place).toFixed(1)} ${up(value).toFixed(1)}`).join("") })),
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
    mark(place) {
      for (const chart of charts) {
        const [line] = all(".at", chart.svg);
        const x = place === null || place < range[0] || place > range[1] ? -9 : across(place);
        for (const end of ["x1", "x2"]) line.setAttribute(end, String(x));
        for (const [who, lap] of Object.entries({ own, other, edited: drive })) {
          const value = lap && place !== null && who !== chart.without ? valueAt(lap, chart.key, place) : null;
          chart.outputs[who].textContent = value === null ? "" : chart.words((chart.scale ?? 1) * value);
        }
      }
    },
  };
}
