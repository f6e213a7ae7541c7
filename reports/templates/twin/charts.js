// One car in two races over time.

import { difference } from "../numbers.js";
import { h } from "../race/element.js";
import { penOf, sized } from "../race/scene.js";

export const ORIGINAL = "#7db8ee";
export const TWIN = "#f5b450";
const MARGIN = 8;

// The place of a moment on a canvas that is as wide as the timeline, and back.
export const across = (seconds, end, width, ratio) => MARGIN * ratio + (seconds / (end || 1)) * (width - 2 * MARGIN * ratio);
export const secondsAt = (event, canvas, end) => ((event.offsetX - MARGIN) / Math.max(canvas.clientWidth - 2 * MARGIN, 1)) * end;

// Upright lines: where another policy takes over, and now.
export function upright(pen, at, colour, height, ratio) {
  pen.strokeStyle = colour;
  pen.lineWidth = ratio;
  pen.beginPath();
  pen.moveTo(at, 0);
  pen.lineTo(at, height);
  pen.stroke();
}

// A car's values by tick, null once it is out.
function series(recording, car, value) {
  return Array.from(recording.time, (_, tick) => (recording.drives(car, tick) ? value(tick) : null));
}

// How far the car is ahead of itself in the other race, s: when it came there, and when the other did.
function lead(twin, original, car) {
  const far = twin.samples.distance[car];
  return series(twin, car, (tick) => {
    const there = original.timeAt(car, far[tick]);
    return there === null ? null : there - twin.time[tick];
  });
}

const leader = (recording, tick) => recording.order(tick)[0];
const gapOf = (recording, car) => series(recording, car, (tick) => recording.gap(car, leader(recording, tick), tick));

/**
 * Charts one above the other; each follows the player, and a press on it goes there.
 * @param {import("../race/player.js").Player} player
 * @param {Recording[]} recordings the original and its twin
 * @param {number} car
 * @param {number | null} mark where they part, s
 */
export function twinCharts(player, [original, twin], car, mark) {
  /** @type {(name: string, of: (one: Recording) => (number | null)[]) => { name: string, lines: ChartLine[] }} */
  const both = (name, of) => ({ name, lines: [[original, of(original), ORIGINAL, "original"], [twin, of(twin), TWIN, "twin"]] });
  /** @type {Chart[]} */
  const charts = [
    { ...both("Place", (one) => series(one, car, (tick) => one.samples.place[car][tick])), down: true, least: 2, words: (v) => v.toFixed(0) },
    { ...both("Gap to the first, s", (one) => gapOf(one, car)), down: true, least: 1, words: (v) => `+${v.toFixed(1)}` },
    { name: "Twin ahead of the original, s", lines: [[twin, lead(twin, original, car), TWIN, "twin"]], zero: true, least: 0.5, words: (v) => difference(v, 2) },
  ];
  return charts.map((chart) => chartOf(player, chart, mark));
}

/**
 * @typedef {import("../race/recording.js").Recording} Recording
 * @typedef {[Recording, (number | null)[], string, string]} ChartLine a race, its values by tick, a colour, and which side it is
 * @typedef {{ name: string, lines: ChartLine[], down?: boolean, zero?: boolean, least: number, words: (v: number) => string }} Chart
 */

/**
 * @param {import("../race/player.js").Player} player
 * @param {Chart} chart
 * @param {number | null} mark where the races part, s
 */
function chartOf(player, { name, lines, down, zero, least, words }, mark) {
  const { end, state } = player;
  const known = lines.flatMap(([, values]) => values.filter((v) => v !== null));
  let [low, high] = known.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], zero ? [0, 0] : [Infinity, -Infinity]);
  const room = Math.max(least - (high - low), 0) / 2 + 0.06 * (high - low);
  [low, high] = [low - room, high + room];
  const outputs = lines.map(([, , , side]) => h("output", { class: side }));
  const canvas = h("canvas", {
    role: "img", "aria-label": `${name} over the race`,
    onclick: (event) => player.seek(secondsAt(event, canvas, end)),
  });
  player.on.push(() => {
    const pen = penOf(canvas);
    const [width, height, ratio] = sized(canvas);
    const y = (v) => 4 * ratio + (down ? v - low : high - v) / (high - low || 1) * (height - 8 * ratio);
    const x = (seconds) => across(seconds, end, width, ratio);
    pen.clearRect(0, 0, width, height);
    pen.lineWidth = ratio;
    if (zero) {
      pen.strokeStyle = "#ffffff33";
      pen.beginPath();
      pen.moveTo(x(0), y(0));
      pen.lineTo(x(end), y(0));
      pen.stroke();
    }
    pen.fillStyle = "#99a1ac";
    pen.font = `${10 * ratio}px system-ui, sans-serif`;
    pen.textAlign = "right";
    // Of a line that never moves both ends have one label.
    const ends = new Map([low + room, high - room].map((v) => [words(v), v]));
    for (const v of ends.values()) {
      const at = y(v) + (y(v) < height / 2 ? 10 : -2) * ratio;
      pen.fillText(words(v), width - 2 * ratio, at);
    }
    lines.forEach(([{ time }, values, colour], i) => {
      pen.strokeStyle = colour;
      // Where both are the same, the one below is still to be seen.
      pen.lineWidth = (lines.length > 1 && i === 0 ? 4 : 1.5) * ratio;
      pen.beginPath();
      let before = false;
      for (let k = 0; k < values.length; k++) {
        const v = values[k];
        if (v !== null) pen[before ? "lineTo" : "moveTo"](x(time[k]), y(v));
        before = v !== null;
      }
      pen.stroke();
    });
    if (mark !== null) upright(pen, x(mark), "#f06a6a", height, ratio);
    upright(pen, x(state.now), "#e6e8eb", height, ratio);
    lines.forEach(([recording, values], i) => {
      const v = recording.time.length ? values[recording.tickAt(state.now)] : null;
      outputs[i].textContent = v === null || v === undefined ? "–" : words(v);
    });
  });
  return h("div", { class: "chart" }, h("p", {}, h("b", {}, name), outputs.map((output, i) => [i > 0 && " · ", output])), canvas);
}
