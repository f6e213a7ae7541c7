// Bars with intervals, shades, and charts that are drawn anew when their width changes.

import { count, number } from "../numbers.js";
import { all, h } from "../race/element.js";
import { entrants, nameOf, skillsOf, summary, tests } from "./data.js";
import { entrantLink, plain } from "./dom.js";
import { d3, Plot } from "./libraries.js";

/**
 * The least and the greatest of some numbers; 0 where there are none.
 * @template One
 * @param {Iterable<One>} rows
 * @param {(row: One) => number | null} of
 * @returns {[number, number]}
 */
export const extent = (rows, of) => {
  const [low = 0, high = 0] = d3.extent(rows, of);
  return [low, high];
};

/**
 * A function that draws bars of one column on a common axis from `origin`.
 * @param {any[]} rows
 * @param {string[]} columns value, low, high
 * @param {number} origin
 * @param {string} kind
 * @param {number | null} [reference]
 */
export function barScale(rows, [value, low, high], origin, kind, reference = null) {
  const [width, margin] = [112, 3];
  const known = rows.flatMap((row) => [row[value], row[low], row[high]]).filter((x) => x !== null && x !== undefined);
  const at = d3.scaleLinear([Math.min(origin, ...known), Math.max(origin, ...known)], [margin, width - margin]);
  return (row) => {
    const svg = h("svg:svg", { class: `bar ${kind}`, viewBox: `0 0 ${width} 18`, width, height: 18, "aria-hidden": "true" });
    if (row[value] === null || row[value] === undefined) return svg;
    const [end, start] = [at(row[value]), at(origin)];
    if (reference !== null) svg.append(h("svg:line", { class: "reference", x1: at(reference), x2: at(reference), y1: 0, y2: 18 }));
    svg.append(h("svg:line", { class: "origin", x1: start, x2: start, y1: 2, y2: 16 }));
    svg.append(h("svg:rect", { x: Math.min(start, end), y: 5, width: Math.abs(end - start), height: 8 }));
    if (row[low] !== null && row[high] !== null) {
      svg.append(h("svg:path", { class: "whisker", d: `M${at(row[low])} 9H${at(row[high])}M${at(row[low])} 5v8M${at(row[high])} 5v8` }));
    }
    svg.append(h("svg:circle", { cx: end, cy: 9, r: 2.6 }));
    return svg;
  };
}

// The shade of a heat map's cell: p1..p5 up to `largest`, n1..n5 down to its negative.
const LEVELS = 5;
/**
 * @param {number} value
 * @param {number} largest
 */
export const shade = (value, largest) => {
  const level = largest > 0 ? Math.min(LEVELS, Math.ceil((LEVELS * Math.abs(value)) / largest)) : 0;
  return level === 0 ? "h0" : `${value > 0 ? "p" : "n"}${level}`;
};
/** @type {(shades: string[], low: string, high: string) => HTMLElement} */
export const shadeKey = (shades, low, high) =>
  h("span", { class: "scale" }, h("span", {}, low), shades.map((one) => h("i", { class: one })), h("span", {}, high));
export const BLUES = ["h0", "p1", "p2", "p3", "p4", "p5"];
export const BOTH = ["n5", "n4", "n3", "n2", "n1", ...BLUES];

/** What axes of charts have in common. */
export const PLAIN_AXIS = /** @type {const} */ ({ labelAnchor: "center", labelArrow: "none" });

// A figure whose chart `draw(width)` makes; the page's own style sheet has the rules of Plot's.
const LEAST_PX = 200; // Narrower is only what is still being laid out.
/**
 * @param {string | null} title
 * @param {(width: number) => HTMLElement | SVGElement} draw
 */
export function chart(title, draw) {
  const host = h("figure", {}, title && h("figcaption", {}, title));
  let drawn = 0;
  new ResizeObserver(() => {
    const width = Math.floor(host.clientWidth);
    if (width < LEAST_PX || width === drawn) return;
    drawn = width;
    host.querySelector("svg")?.remove();
    const plot = draw(width);
    plot.querySelector("style")?.remove();
    // A picture with one label: the names that Plot gives its groups tell nobody anything.
    plot.setAttribute("role", "img");
    for (const group of all("g[aria-label]", plot)) {
      group.dataset.mark = group.getAttribute("aria-label") ?? "";
      group.removeAttribute("aria-label");
    }
    host.append(plot);
  }).observe(host);
  return host;
}

/**
 * How a chart that is drawn places values across or upwards, and back.
 * @param {{ scale: (name: "x" | "y") => import("@observablehq/plot").Scale | undefined }} plot
 * @param {"x" | "y"} [axis]
 */
export const scaleOf = (plot, axis = "x") => /** @type {{ apply: (value: number) => number, invert: (x: number) => number }} */ (plot.scale(axis));

export const tip = { lineHeight: 1.35, fontSize: 12, stroke: "var(--strong-rule)", maxRadius: 30 };

/**
 * The mark of an entrant in a test: its mean has other points than the mean of the points that the runs have.
 * @param {{ entrant: number, test: string, measure: number, unit: string, runs: number }} skill
 */
export const measuredAs = ({ entrant, test, measure, unit, runs }) => {
  const mean = `mean mark ${number(measure, 3)} ${unit}`;
  const scored = `mean over ${count(runs, "run")}, each scored by itself`;
  const failed = summary.marks[test]?.failed; // runs of earlier versions did not keep it
  if (!failed) return `${scored}; ${mean} of the runs that set one`;
  const own = failed[entrants[entrant].entrant] ?? 0;
  return own ? `${scored}; ${number(own)} of ${number(runs)} failed and have 0 points; ${mean} of the others` : `${scored}; ${mean}; none failed`;
};

// The points of some entrants in every test, as one line each.
export const LINES = [["var(--survivor)", "circle"], ["var(--finalist)", "diamond2"], ["var(--third)", "triangle"]];
/** @param {number[]} chosen entrants */
export function profile(chosen) {
  const points = chosen.flatMap((index, line) =>
    tests.flatMap((test) => (skillsOf.get(index) ?? []).filter((one) => one.test === test))
      .map((skill) => ({ ...skill, line, test: plain(skill.test), name: nameOf(index), told: measuredAs(skill) })),
  );
  const shown = tests.map(plain);
  const figure = chart(null, (width) =>
    Plot.plot({
      width, height: 60 + 30 * shown.length, marginLeft: 16 + 7 * Math.max(...shown.map((test) => test.length)), marginRight: 20, marginTop: 20, marginBottom: 40,
      ariaLabel: "Points in every test",
      x: { label: "points", ...PLAIN_AXIS, grid: true, domain: [0, 1.05 * Math.max(1000, ...points.map((point) => point.points))] },
      y: { type: "point", domain: shown, label: null },
      marks: [
        Plot.ruleX([500, 1000], { stroke: "var(--strong-rule)", strokeDasharray: "3 3" }),
        chosen.map((_, line) => {
          const own = points.filter((point) => point.line === line);
          const at = { y: "test", stroke: LINES[line][0] };
          return [
            Plot.ruleY(own, { y: "test", x1: "points_low", x2: "points_high", stroke: LINES[line][0], strokeOpacity: 0.35, strokeWidth: 4, clip: true }),
            Plot.line(own, { ...at, x: "points", strokeWidth: 2 }),
            Plot.dot(own, { ...at, x: "points", fill: "var(--paper)", symbol: LINES[line][1], r: 4 }),
          ];
        }),
        Plot.tip(points, Plot.pointer({ ...tip, x: "points", y: "test", title: (p) => `${p.name}\n${p.test}\n${number(p.points)} points (${number(p.points_low)} to ${number(p.points_high)})\n${p.told}` })),
      ],
    }),
  );
  const key = h("p", { class: "key" }, chosen.map((index, line) => [
    h("svg:svg", { width: 26, height: 12, "aria-hidden": "true", class: `line${line}` },
      h("svg:line", { x1: 0, x2: 26, y1: 6, y2: 6 }),
      h("svg:path", { d: d3.symbol(d3[{ circle: "symbolCircle", diamond2: "symbolDiamond2", triangle: "symbolTriangle" }[LINES[line][1]]], 40)(), transform: "translate(13,6)" })),
    " ", entrantLink(index), "  ",
  ]));
  return [key, figure];
}
