// The filter's objectives, two at a time: the field in grey, the front labelled.

import { capital, number, percent } from "../numbers.js";
import { h } from "../race/element.js";
import { chart, tip } from "./charts.js";
import { data, entrants, EPISODES, MEETINGS, met, nameOf, objectivesOf, rankingOf, sent, tables } from "./data.js";
import { chip, empty, here, keep, note, plain, section, to } from "./dom.js";
import { limitColumn, limitNote } from "./lap.js";
import { d3, Plot } from "./libraries.js";
import { dataTable, entrantColumn } from "./table.js";

const objectiveNames = [...new Set(tables.objectives.map((row) => row.objective))];
const units = new Map(tables.objectives.map((row) => [row.objective, row]));
/** @param {string} name */
export const objectiveUnit = (name) => units.get(name) ?? { unit: "1", goal: "min", source: "" };
export const objectiveTitle = (name) => {
  const { unit, goal } = objectiveUnit(name);
  const title = plain(name.replace(/_per_km$|_s$|_m$/, ""));
  return `${title}${unit === "1" ? "" : ` [${unit}]`}${goal === "max" ? ", more is better" : ""}`;
};
/** @type {Record<string, string>} */
const MEASURED_IN = { time_trial: "in the time trials", race: `in the filter's ${EPISODES}` };
export const measuredIn = (name) => MEASURED_IN[objectiveUnit(name).source] ?? "in the filter";
export const objectiveValue = (index, name) => objectivesOf(index).find((row) => row.objective === name)?.value ?? null;

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
    section("All entrants", data.limit !== null && note(limitNote().trim()), dataTable("pareto", [
      entrantColumn((row) => (row.finalist ? chip("", "finalist") : null)),
      ...objectiveNames.map((name) => ({
        key: name, head: objectiveTitle(name), first: objectiveUnit(name).goal === "max" ? "descending" : "ascending",
        value: (row) => row[`= ${name}`], cell: (row) => number(row[`= ${name}`], 3),
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
    .map((row) => ({ ...row, name: nameOf(row.entrant), sent: sent.has(entrants[row.entrant].entrant), x: row[`= ${x}`], y: row[`= ${y}`] }))
    .map((row) => ({ ...row, label: row.sent ? `${row.name}, sent` : row.name }))
    .filter((row) => row.x !== null && row.x !== undefined && row.y !== null && row.y !== undefined);
  const unseen = rows.length - points.length;
  if (!points.length) return [empty("Nobody has both.")];
  const kinds = [points.filter((p) => !p.survives), points.filter((p) => p.survives && !p.finalist), points.filter((p) => p.finalist)];
  const labels = [...points.filter((p) => p.sent), ...[...kinds[2], ...kinds[1]].filter((p) => !p.sent)];
  // The few that are far off lie on the edge, or the front would be a speck in a corner.
  const range = (axis) => {
    const values = points.map((p) => p[axis]);
    const shown = labels.map((p) => p[axis]);
    return [d3.min([d3.quantile(values, 0.05), ...shown]), d3.max([d3.quantile(values, 0.95), ...shown])];
  };
  const [across, upwards] = [range("x"), range("y")];
  const beyond = points.filter((p) => p.x < across[0] || p.x > across[1] || p.y < upwards[0] || p.y > upwards[1]).length;
  const describe = (p) => [p.name, ...objectiveNames.map((name) => `${objectiveTitle(name)} ${number(p[`= ${name}`], 3)}`), p.finalist ? `reached the ${MEETINGS.toLowerCase()}` : p.survives ? "survives" : "left out"].join("\n");
  const draw = (width, texts) => Plot.plot({
    width, height: Math.round(Math.min(560, Math.max(340, width * 0.6))), marginLeft: 56, marginRight: 20, marginBottom: 44, inset: 10,
    ariaLabel: `${objectiveTitle(x)} against ${objectiveTitle(y)}`,
    x: { label: objectiveTitle(x), labelAnchor: "center", labelArrow: "none", nice: true, ticks: width / 90, domain: across, clamp: true },
    y: { label: objectiveTitle(y), labelArrow: "none", grid: true, nice: true, ticks: 7, domain: upwards, clamp: true },
    marks: [
      Plot.dot(kinds[0], { x: "x", y: "y", r: 2.2, fill: "var(--field)", fillOpacity: 0.6 }),
      Plot.dot(kinds[1], { x: "x", y: "y", r: 4, fill: "var(--survivor)" }),
      Plot.dot(kinds[2], { x: "x", y: "y", r: 5, fill: "var(--finalist)", symbol: "diamond" }),
      /** @type {("start" | "end")[]} */ (["start", "end"]).map((anchor) => Plot.text(texts.filter((text) => text.anchor === anchor), {
        x: "x", y: "y", text: "label", textAnchor: anchor, dx: anchor === "start" ? 9 : -9, fill: "currentColor", stroke: "var(--paper)", strokeWidth: 4,
      })),
      Plot.tip(points, Plot.pointer({ ...tip, x: "x", y: "y", title: describe })),
    ],
  });
  return [
    chart(null, (width) => {
      const plot = draw(width, placed(draw(width, []), labels, width));
      plot.addEventListener("click", () => { if (plot.value) location.hash = to("checkpoint", [entrants[plot.value.entrant].key]); });
      return plot;
    }),
    h("p", { class: "key" }, h("i", { class: "field" }), "left out ", h("i", { class: "survivor" }), "survives ", h("i", { class: "finalist" }), `${met ? `reached the ${MEETINGS.toLowerCase()}` : "shortlisted"}. A click opens the checkpoint.`,
      beyond > 0 && ` ${number(beyond)} lie outside of the axes and are drawn at the edge.`,
      unseen > 0 && ` ${number(unseen)} without ${unseen === 1 ? "a value is" : "values are"} not drawn.`),
  ];
}

// Labels beside their dots, the first come first; one that would cover another is left to the tip, but for who is sent.
function placed(plot, points, width) {
  const [x, y] = [plot.scale("x"), plot.scale("y")];
  const taken = points.map((p) => [x.apply(p.x) - 5, y.apply(p.y) - 5, 10, 10]);
  const clear = (box) => taken.every(([left, top, w, height]) => box[0] > left + w || left > box[0] + box[2] || box[1] > top + height || top > box[1] + box[3]);
  return points.flatMap((point) => {
    const w = 6.6 * point.label.length;
    const [px, py] = [x.apply(point.x), y.apply(point.y)];
    for (const [anchor, left] of [["start", px + 9], ["end", px - 9 - w]]) {
      const box = [left, py - 7, w, 14];
      if (left > 56 && left + w < width && (point.sent || clear(box))) {
        taken.push(box);
        return [{ ...point, anchor }];
      }
    }
    return [];
  });
}
