// The filter's objectives, two at a time: the field in grey, the front labelled.

import { capital, number, percent } from "../numbers.js";
import { h } from "../race/element.js";
import { chart, extent, scaleOf, tip } from "./charts.js";
import { data, entrants, EPISODES, groups, MEETINGS, met, nameOf, objectivesOf, rankingOf, sent, tables } from "./data.js";
import { chip, empty, here, keep, note, plain, section, to } from "./dom.js";
import { limitColumn, limitNote } from "./lap.js";
import { d3, Plot } from "./libraries.js";
import { dataTable, entrantColumn } from "./table.js";

/** How far up or down a label may move from its dot, px. */
const AWAY_PX = [0, -13, 13, -26, 26, -40, 40, -56, 56, -72, 72, -90, -108];
/** Of a label: from its dot; a letter of it; what it stays out of at the left and at the bottom. */
const [BESIDE_PX, LETTER_PX, LEFT_PX, BELOW_PX] = [9, 6.9, 56, 44];
const objectiveNames = [...new Set(tables.objectives.map((row) => row.objective))];
const units = new Map(tables.objectives.map((row) => [row.objective, row]));
/** @param {string} name */
export const objectiveUnit = (name) => units.get(name) ?? { unit: "1", goal: "min", source: "" };
const SHARE = /_share$/; // what is one is told in per cent
const calledIn = (name) => plain(name.replace(/_s$|_m$|_share$/, ""));
export const objectiveTitle = (name) => {
  const { unit, goal } = objectiveUnit(name);
  const title = capital(calledIn(name));
  const measuredBy = SHARE.test(name) ? ", %" : unit === "1" || unit === "1/km" ? "" : `, ${unit}`;
  return `${title}${measuredBy}${goal === "max" ? ", more is better" : ""}`;
};
/**
 * A value of an objective as it is shown: shares are per cent.
 * @param {string} name
 * @param {number | null | undefined} value
 */
const objectiveShown = (name, value) => (value !== null && value !== undefined && SHARE.test(name) ? 100 * value : value ?? null);
/** @param {string} name */
export const objectiveDigits = (name) => (SHARE.test(name) || /_per_km$/.test(name) ? 2 : 3);
const written = (name, value) => number(objectiveShown(name, value), objectiveDigits(name));
/** @type {Record<string, string>} */
const MEASURED_IN = { time_trial: "in the time trials", race: `in the filter's ${EPISODES}` };
export const measuredIn = (name) => MEASURED_IN[objectiveUnit(name).source] ?? "in the filter";
export const objectiveValue = (index, name) => objectiveShown(name, objectivesOf(index).find((row) => row.objective === name)?.value);
/** @param {number} index of an entrant */
export const objectivesTold = (index) => objectivesOf(index).map(({ objective: name, value, unit }) => {
  const after = SHARE.test(name) ? "\u00a0%" : unit === "1" || unit === "1/km" ? "" : `\u00a0${unit}`;
  return `${calledIn(name)} ${written(name, value)}${after} ${measuredIn(name)}`;
});
// Which runs tell what: in the heads there is no room for it.
const sources = () => [...groups(objectiveNames.map((name) => ({ name, source: measuredIn(name) })), "source")]
  .map(([source, own]) => `${own.map(({ name }) => objectiveTitle(name)).join("; ")}: ${source}.`).join(" ");

export function pareto() {
  const title = h("h1", {}, "Pareto filter");
  const rows = tables.pareto.map((row) => ({
    ...row,
    ...Object.fromEntries(objectivesOf(row.entrant).map((one) => [`= ${one.objective}`, one.value])),
    finalist: rankingOf.has(row.entrant),
  }));
  if (!rows.length) return [title, empty("No entrant has been through the filter.")];
  const front = rows.filter((row) => row.survives);
  const { params } = here();
  /** @type {(name: string, otherwise: number) => string} */
  const axis = (name, otherwise) => objectiveNames.find((one) => one === params.get(name)) ?? objectiveNames[otherwise];
  const host = h("div");
  const show = () => {
    const [x, y] = [axis("x", 0), axis("y", Math.min(1, objectiveNames.length - 1))];
    host.replaceChildren(...front2d(rows, x, y));
  };
  const choice = (name, label, otherwise) =>
    h("label", {}, `${label} `, h("select", { onchange: (event) => { keep(name, event.target.value); params.set(name, event.target.value); show(); } },
      objectiveNames.map((one) => h("option", { value: one, selected: one === axis(name, otherwise) }, objectiveTitle(one)))));
  if (objectiveNames.length > 1) show();
  return [
    title,
    note(`${number(front.length)} of ${number(rows.length)} survive: non-dominated in at least 5\u00a0% of the draws from the objectives' uncertainty.${objectiveNames.length > 2 ? " The chart has only two of the objectives, so a survivor may lie behind the front." : ""}`),
    objectiveNames.length > 1 && [h("div", { class: "controls" }, choice("x", "Across", 0), choice("y", "Upwards", 1)), host],
    section("All entrants", note(sources(), data.limit !== null && limitNote()), dataTable("pareto", [
      entrantColumn((row) => (row.finalist ? chip("", "finalist") : null)),
      ...objectiveNames.map((name) => ({
        key: name, head: objectiveTitle(name), first: objectiveUnit(name).goal === "max" ? "descending" : "ascending",
        title: capital(measuredIn(name)), value: (row) => row[`= ${name}`], cell: (row) => written(name, row[`= ${name}`]),
      })),
      ...limitColumn(),
      { key: "nondominated", head: "Non-dominated, %", title: "share of the draws in which no other entrant was better in every objective", value: (row) => row.nondominated_probability, cell: (row) => percent(row.nondominated_probability) },
      { key: "survives", head: "Survives", value: (row) => row.survives, cell: (row) => (row.survives ? "yes" : "no") },
      { key: "races", head: capital(EPISODES), value: (row) => row.races, cell: (row) => number(row.races) },
    ], rows, { sort: "-nondominated", text: (row) => nameOf(row.entrant), label: "Pareto filter" })),
  ];
}

function front2d(rows, x, y) {
  const points = rows
    .map((row) => ({ ...row, name: nameOf(row.entrant), sent: sent.has(entrants[row.entrant].entrant), x: objectiveShown(x, row[`= ${x}`]), y: objectiveShown(y, row[`= ${y}`]) }))
    .map((row) => ({ ...row, label: row.sent ? `${row.name}, sent` : row.name }))
    .filter((row) => row.x !== null && row.y !== null);
  const unseen = rows.length - points.length;
  if (!points.length) return [empty("Nobody has both.")];
  const kinds = [points.filter((p) => !p.survives), points.filter((p) => p.survives && !p.finalist), points.filter((p) => p.finalist)];
  const labels = [...points.filter((p) => p.sent), ...[...kinds[2], ...kinds[1]].filter((p) => !p.sent)];
  // Those that are far off lie on the edge, or the front would be a speck in a corner.
  const range = (axis) => {
    const values = points.map((p) => p[axis]);
    const [least, most] = extent(labels.length ? labels : points, (p) => p[axis]);
    const reach = labels.length > 1 ? most - least : Infinity;
    const [low, high] = [0.05, 0.95].map((share) => d3.quantile(values, share) ?? 0);
    return /** @type {[number, number]} */ ([Math.min(least, Math.max(low, least - reach)), Math.max(most, Math.min(high, most + reach))]);
  };
  const [across, upwards] = [range("x"), range("y")];
  const beyond = points.filter((p) => p.x < across[0] || p.x > across[1] || p.y < upwards[0] || p.y > upwards[1]).length;
  const describe = (p) => [p.name, ...objectiveNames.map((name) => `${objectiveTitle(name)} ${written(name, p[`= ${name}`])} ${measuredIn(name)}`), p.finalist ? `reached the ${MEETINGS.toLowerCase()}` : p.survives ? "survives" : "left out"].join("\n");
  const draw = (width) => Plot.plot({
    width, height: Math.round(Math.min(560, Math.max(340, width * 0.6))), marginLeft: LEFT_PX, marginRight: 20, marginBottom: 44, inset: 10,
    ariaLabel: `${objectiveTitle(x)} against ${objectiveTitle(y)}`,
    x: { label: objectiveTitle(x), labelAnchor: "center", labelArrow: "none", nice: true, ticks: width / 90, domain: across, clamp: true },
    y: { label: objectiveTitle(y), labelArrow: "none", grid: true, nice: true, ticks: 7, domain: upwards, clamp: true },
    marks: [
      Plot.dot(kinds[0], { x: "x", y: "y", r: 2.6, stroke: "var(--field)", strokeWidth: 1.4 }),
      Plot.dot(kinds[1], { x: "x", y: "y", r: 4, fill: "var(--survivor)" }),
      Plot.dot(kinds[2], { x: "x", y: "y", r: 5, fill: "var(--finalist)", symbol: "diamond" }),
      Plot.tip(points, Plot.pointer({ ...tip, x: "x", y: "y", title: describe })),
    ],
  });
  return [
    chart(null, (width) => {
      const plot = draw(width);
      plot.insertBefore(labelled(plot, labels, width), plot.lastChild);
      plot.addEventListener("click", () => { if (plot.value) location.hash = to("checkpoint", [entrants[plot.value.entrant].key]); });
      return plot;
    }),
    h("p", { class: "key" }, h("i", { class: "field" }), "left out ", h("i", { class: "survivor" }), "survives ", h("i", { class: "finalist" }), `${met ? `reached the ${MEETINGS.toLowerCase()}` : "shortlisted"}. A click opens the checkpoint.`,
      beyond > 0 && ` ${number(beyond)} lie outside of the axes and are drawn at the edge.`,
      unseen > 0 && ` ${number(unseen)} without ${unseen === 1 ? "a value is" : "values are"} not drawn.`),
  ];
}

/**
 * Names beside their dots, the first come first: where one would cover another it moves away, with a line to its dot. A name that
 * finds no room is left to the tip, but for who is sent.
 * @param {ReturnType<typeof Plot.plot>} plot
 * @param {{ x: number, y: number, label: string, sent: boolean }[]} points
 * @param {number} width
 */
function labelled(plot, points, width) {
  const [across, upwards] = [scaleOf(plot, "x"), scaleOf(plot, "y")];
  const spots = points.map((point) => ({ ...point, at: [across.apply(point.x), upwards.apply(point.y)] }));
  const taken = spots.map(({ at: [px, py] }) => [px - 5, py - 5, 10, 10]);
  const bottom = Number(plot.getAttribute("height")) - BELOW_PX;
  /** @param {number[]} box left, top, width, height */
  const clear = ([left, top, wide, high]) => left > LEFT_PX && left + wide < width && top > 0 && top + high < bottom
    && taken.every((box) => box[0] > left + wide || left > box[0] + box[2] || box[1] > top + high || top > box[1] + box[3]);
  return h("svg:g", { "aria-label": "text" }, spots.map(({ label, sent, at: [px, py] }) => {
    const wide = LETTER_PX * label.length;
    const places = AWAY_PX.flatMap((away) => [px + BESIDE_PX, px - BESIDE_PX - wide].map((left) => ({ away, box: [left, py + away - 7, wide, 14] })));
    const place = places.find(({ box }) => clear(box)) ?? (sent ? places[px + BESIDE_PX + wide < width ? 0 : 1] : undefined);
    if (!place) return null;
    const { away, box: [left] } = place;
    taken.push(place.box);
    const end = left > px ? left - 2 : left + wide + 2;
    return [
      away !== 0 && h("svg:line", { x1: px, y1: py, x2: end, y2: py + away, stroke: "var(--muted)", "stroke-width": 0.8 }),
      h("svg:text", {
        x: left > px ? left : left + wide, y: py + away, dy: "0.32em", "text-anchor": left > px ? "start" : "end",
        fill: "currentColor", stroke: "var(--paper)", "stroke-width": 4, "paint-order": "stroke", "stroke-linejoin": "round",
      }, label),
    ];
  }));
}
