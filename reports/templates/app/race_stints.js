// What the cars of a race drove on which tyres, and what their stops took.

import { number, shortened } from "../numbers.js";
import { startNumber } from "../race/recording.js";
import { chart, PLAIN_AXIS, tip } from "./charts.js";
import { nameOf } from "./data.js";
import { d3, Plot } from "./libraries.js";

/** By how soft a compound is. */
const SHADES = { soft: "var(--finalist)", medium: "var(--third)", hard: "var(--survivor)" };

/**
 * The stints of a car, [] of one without a strategist.
 * @param {{ stints: string }} car
 * @returns {{ compound: string, laps: number, stood_s: number | null, lane_s: number | null }[]}
 */
export const stintsOf = ({ stints }) => (stints === null ? [] : JSON.parse(stints));

/**
 * After how many laps a car came back from each of its stops.
 * @param {{ stints: string }} car
 */
export const stopsOf = (car) => Array.from(d3.cumsum(stintsOf(car), ({ laps }) => laps)).slice(0, -1);

/** @param {import("./data.js").Car[]} cars of a race */
export function stintChart(cars) {
  const labels = d3.sort(cars, (one) => one.place).map((one) => ({ ...one, label: `${startNumber(one.slot - 1)} ${nameOf(one.entrant)}` }));
  const rows = labels.flatMap((one) => {
    const own = stintsOf(one);
    const ends = d3.cumsum(own, ({ laps }) => laps);
    return own.map((stint, i) => ({ ...stint, label: one.label, from: ends[i] - stint.laps, to: ends[i] }));
  });
  const end = d3.max(rows, ({ to }) => to) || 1;
  const about = ({ label, compound, laps, stood_s, lane_s }) =>
    `${label}\n${laps} laps on ${compound}${lane_s === null ? "" : `\nstop: ${number(stood_s, 1)} s standing, ${number(lane_s, 1)} s in the lane`}`;
  const longest = d3.max(labels, ({ label }) => label.length) ?? 0;
  const named = (width) => Math.min(longest, Math.floor(width / 20)); // letters, in up to a third of the chart
  const fits = (row, width) => ((width - 36 - 6.4 * named(width)) * row.laps) / end;
  const told = (row, width) => (fits(row, width) > 110 ? `${row.laps} ${row.compound}` : fits(row, width) > 24 ? `${row.laps}` : "");
  return chart(null, (width) => Plot.plot({
    width, height: 46 + 24 * labels.length, marginLeft: 16 + 6.4 * named(width), marginRight: 20, marginTop: 6, marginBottom: 40, ariaLabel: "Stints of every car",
    x: { label: "laps", domain: [0, end], ticks: Math.min(end, 10), tickFormat: "d", ...PLAIN_AXIS },
    y: { domain: labels.map(({ label }) => label), label: null, tickSize: 0, tickFormat: (label) => shortened(label, named(width)) },
    marks: [
      Object.entries(SHADES).map(([kind, fill]) => Plot.barX(rows.filter(({ compound }) => compound.endsWith(kind)), { x1: "from", x2: "to", y: "label", fill, insetLeft: 1, insetRight: 1, insetTop: 3, insetBottom: 3 })),
      Plot.text(rows, { x: (row) => (row.from + row.to) / 2, y: "label", text: (row) => told(row, width), fill: "var(--paper)", fontSize: 11 }),
      Plot.tip(rows, Plot.pointer({ ...tip, x: (row) => (row.from + row.to) / 2, y: "label", title: about })),
    ],
  }));
}
