// A table that sorts by its heads and filters by a field; both are kept in the address.

import { ABSENT, number } from "../numbers.js";
import { h } from "../race/element.js";
import { rankText } from "../rank.js";
import { measured, nameOf, onCircuit, ownNames } from "./data.js";
import { chips, entrantLink, here, keep, plain, scroll } from "./dom.js";

/**
 * @typedef {object} Column without `value` it does not sort
 * @property {string} key
 * @property {string} head
 * @property {string} [unseen] what stands instead of a head for those who do not see
 * @property {string} [kind] class
 * @property {string} [title]
 * @property {(row: any) => string | number | null | undefined} [value] what it sorts by
 * @property {(row: any) => import("../race/element.js").Child} [cell] what is shown
 * @property {string} [first] order: "descending" unless said otherwise
 */

/**
 * @param {Column} one
 * @returns {one is Column & { value: (row: any) => string | number | null | undefined }}
 */
const sorts = (one) => one.value !== undefined;

/**
 * @param {string} id
 * @param {(Column | false | null | undefined)[]} columns of which those that are false are left out
 * @param {any[]} rows
 * @param {object} options
 * @param {string} options.sort the key of a column, after - if descending
 * @param {(row: any) => string} [options.text] by which rows are filtered
 * @param {string} [options.prefix] of what the address says of the table
 * @param {{ key: string }} [options.grouped] the column whose values part rows
 * @param {string} [options.label]
 * @param {number} [options.shown] rows, at first
 */
export function dataTable(id, columns, rows, { sort, text, prefix = "", grouped, label = id, shown = 200 }) {
  const { params } = here();
  const sorted = params.get(`${prefix}sort`) ?? sort;
  let [descending, by] = sorted.startsWith("-") ? ["-", sorted.slice(1)] : ["", sorted];
  let query = params.get(`${prefix}q`) ?? "";
  let limit = shown;
  const kept = columns.filter((one) => one !== false && one !== null && one !== undefined);
  const sorting = kept.filter(sorts);
  const column = () => sorting.find((one) => one.key === by) ?? sorting[0];
  const compare = (a, b) => (typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true }));
  /** @param {any} value */
  const absent = (value) => value === null || value === undefined;

  const body = h("tbody");
  const heads = kept.map((one) => {
    const button = one.value && h("button", { type: "button", title: one.title, onclick: () => order(one) }, one.head);
    return h("th", { scope: "col", class: one.kind ?? "number" }, button ?? (one.head ? one.head : h("span", { class: "unseen" }, one.unseen ?? "")));
  });
  const table = h("table", { id, class: "sortable" }, h("thead", {}, h("tr", {}, heads)), body);
  const said = h("p", { class: "note", "aria-live": "polite" });
  const more = h("button", { type: "button", class: "more", onclick: () => { limit = Infinity; fill(); } });

  /** @param {Column} one */
  function order(one) {
    if (one === column()) descending = descending ? "" : "-";
    else [by, descending] = [one.key, one.first === "ascending" ? "" : "-"];
    keep(`${prefix}sort`, descending + by === sort ? "" : descending + by);
    fill();
  }

  function fill() {
    const { value, key } = column();
    const sign = descending ? -1 : 1;
    const wanted = query.trim().toLowerCase();
    const found = wanted && text ? rows.filter((row) => text(row).toLowerCase().includes(wanted)) : rows;
    const sorted = [...found].sort((a, b) => {
      const [x, y] = [value(a), value(b)];
      return Number(absent(x)) - Number(absent(y)) || (absent(x) ? 0 : sign * compare(x, y));
    });
    body.replaceChildren(
      ...sorted.slice(0, limit).map((row, i) => {
        const opens = grouped && key === grouped.key && i > 0 && value(sorted[i - 1]) !== value(row);
        return h("tr", { class: opens ? "opens" : null }, kept.map((one) => cell(one, row)));
      }),
    );
    table.classList.toggle("grouped", Boolean(grouped && key === grouped.key));
    heads.forEach((head, i) => {
      if (kept[i].key === key && kept[i].value) head.setAttribute("aria-sort", descending ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    });
    more.hidden = sorted.length <= limit;
    more.textContent = `Show all ${number(sorted.length)}`;
    said.textContent = wanted ? `${number(found.length)} of ${number(rows.length)}` : "";
  }

  /**
   * @param {Column} one
   * @param {any} row
   */
  function cell(one, row) {
    const shown = one.cell ? one.cell(row) : one.value?.(row);
    if (shown instanceof HTMLTableCellElement) return shown;
    const heading = (one.kind ?? "").split(" ")[0] === "name";
    return h(heading ? "th" : "td", { class: one.kind ?? "number", scope: heading ? "row" : null }, shown ?? ABSENT);
  }

  const filter =
    text &&
    h("label", { class: "filter" }, "Filter ", h("input", {
      type: "search", value: query, placeholder: "name", "aria-label": `Filter ${label}`,
      oninput: (event) => { query = event.target.value; keep(`${prefix}q`, query); fill(); },
    }));
  fill();
  return [filter && h("div", { class: "controls" }, filter, said), scroll(label, table), more];
}

// What another world measures of a seat.
export const ownColumns = () => [
  measured("score") && { key: "score", head: "Score", value: (row) => row.score, cell: (row) => number(row.score, 2) },
  ...ownNames.map((name) => ({ key: `own-${name}`, head: plain(name), value: (row) => row.own[name] ?? null, cell: (row) => number(row.own[name] ?? null, 2) })),
  !onCircuit && measured("distance_m") && { key: "distance", head: "Distance, m", value: (row) => row.distance_m, cell: (row) => number(row.distance_m, 1) },
];

/**
 * @param {(row: any) => import("../race/element.js").Child} [extra] beside the name
 * @returns {Column}
 */
export const entrantColumn = (extra = () => null) => ({
  key: "name", head: "Entrant", kind: "name", first: "ascending",
  value: (row) => nameOf(row.entrant),
  cell: (row) => [entrantLink(row.entrant), " ", chips(row.entrant), extra(row)],
});
export const RANKS = "Ranks that are possible: the best is 1 + the number of entrants proven better, the worst is just ahead of those proven worse (Holm's correction for many comparisons).";
/** @type {Column} */
export const rankColumn = {
  key: "rank", head: "Rank", kind: "rank", first: "ascending", title: RANKS,
  value: (row) => row.rank,
  cell: rankText,
};
