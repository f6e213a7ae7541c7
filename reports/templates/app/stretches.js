// Where on the lap tests are held: a small map for each stretch.

import { number } from "../numbers.js";
import { h } from "../race/element.js";
import { extent } from "./charts.js";
import { summary, tables } from "./data.js";
import { note, plain, section } from "./dom.js";
import { d3 } from "./libraries.js";

const LINE_M = 24; // between two points of what is drawn

export function stretches() {
  const held = Object.entries(summary.marks).filter(([, mark]) => mark.stretch_m);
  if (!held.length || !tables.course.length) return null;
  const elsewhere = Object.keys(summary.marks).filter((test) => !summary.marks[test].stretch_m);
  const groups = d3.groups(held, ([, mark]) => mark.stretch_m?.join());
  return section("Where they are held",
    note("From the farthest start of an entrant to the dot, where the run ends. ", elsewhere.length > 0 && `On whole laps: ${elsewhere.map(plain).join(", ")}.`),
    h("div", { class: "stretches" }, groups.map(([, tests]) => stretch(tests.map(([test]) => plain(test)), tests[0][1].stretch_m ?? [0, 0]))));
}

/**
 * @param {string[]} names of the tests
 * @param {number[]} range m
 */
function stretch(names, [begin, end]) {
  const lap = tables.course[tables.course.length - 1].distance_m;
  const rows = tables.course.slice(0, -1).map((row) => ({ x: (row.left_x_m + row.right_x_m) / 2, y: -(row.left_y_m + row.right_y_m) / 2 }));
  const at = (metres) => rows[((Math.round((metres / lap) * rows.length) % rows.length) + rows.length) % rows.length];
  const line = (from, to) => `M${d3.range(from, to, LINE_M).concat(to).map((metres) => `${at(metres).x.toFixed(0)} ${at(metres).y.toFixed(0)}`).join("L")}`;
  const [[left, right], [top, bottom]] = [extent(rows, (row) => row.x), extent(rows, (row) => row.y)];
  const margin = 0.05 * Math.max(right - left, bottom - top);
  const where = `from ${number(begin)} m to ${number(end)} m`;
  return h("figure", {},
    h("figcaption", {}, names.join(", "), h("small", {}, where)),
    h("svg:svg", { class: "map", viewBox: [left - margin, top - margin, right - left + 2 * margin, bottom - top + 2 * margin].join(" "), role: "img", "aria-label": `${names.join(", ")}: ${where}` },
      h("svg:path", { class: "lap", d: `${line(0, lap)}Z` }), h("svg:path", { class: "held", d: line(begin, end) }),
      h("svg:path", { class: "ends", d: `M${at(end).x.toFixed(0)} ${at(end).y.toFixed(0)}h0` })));
}
