// Numbers and addresses, and elements that many views have.

import { typed } from "../command.js";
import { ABSENT, count, number } from "../numbers.js";
import { h } from "../race/element.js";
import { candidates, entrants, nameOf, rankingOf, selection, sent, UNIT } from "./data.js";

/** @typedef {import("../race/element.js").Child} Child */

/** @param {string} name */
export const plain = (name) => name.replaceAll("_", " ");
/** @param {number} seconds */
export const duration = (seconds) => {
  if (seconds < 59.95) return `${number(seconds, 1)} s`;
  const minutes = Math.floor(Math.round(seconds) / 60);
  if (minutes < 60) return `${minutes} min ${Math.round(seconds) % 60} s`;
  return `${number(Math.floor(minutes / 60))} h ${minutes % 60} min`;
};
/** @param {string | null | undefined} stamp */
export const time = (stamp) => (stamp ? `${stamp.slice(0, 10)} ${stamp.slice(11, 16)} UTC` : ABSENT);

// An address is #/view/argument/...?key=value: what is chosen can be kept, sent and gone back to.
export const here = () => {
  const [path, query] = location.hash.replace(/^#\/?/, "").split("?");
  const [view, ...rest] = path.split("/").map(decodeURIComponent);
  return { view: view || "tonight", rest, params: new URLSearchParams(query ?? "") };
};
/**
 * @param {string} view
 * @param {string[]} [rest]
 * @param {URLSearchParams | Record<string, string>} [params]
 */
export const to = (view, rest = [], params = {}) => {
  const query = new URLSearchParams(params).toString();
  return `#/${[view, ...rest].map(encodeURIComponent).join("/")}${query && `?${query}`}`;
};
/** @type {(name: string, value: string | null) => void} */
export const keep = (name, value) => {
  const { view, rest, params } = here();
  if (value === "" || value === null) params.delete(name);
  else params.set(name, value);
  history.replaceState(null, "", to(view, rest, params));
};
/**
 * Keeps what is chosen, and has the view drawn anew.
 * @type {(name: string, value: string | null) => void}
 */
export const choose = (name, value) => {
  keep(name, value);
  dispatchEvent(new Event("chosen"));
};
/** @param {string} path */
export const fileHref = (path) => path.split("/").map(encodeURIComponent).join("/");

/** @type {(href: string, ...text: Child[]) => HTMLAnchorElement} */
export const link = (href, ...text) => h("a", { href }, ...text);
/** @param {number} number */
export const entrantLink = (number) => link(to("checkpoint", [entrants[number].key]), nameOf(number));
/** @param {{ key: string, race: number }} race */
export const raceHref = (race) => to("race", [race.key.slice(0, 12), String(race.race)]);
/** @param {Child[]} text */
export const note = (...text) => h("p", { class: "note" }, ...text);
/** @param {number} many how many units, with what they are */
export const units = (many) => h("abbr", { title: UNIT }, count(many, "unit"));
/** @param {Child} text */
export const empty = (text) => h("p", { class: "empty" }, text);
/** @type {(title: Child, ...children: Child[]) => HTMLElement} */
export const section = (title, ...children) => h("section", {}, h("h2", {}, title), ...children);
/** @param {([term: string, value: Child, title?: string] | false | null | undefined | "")[]} pairs */
export const facts = (pairs) =>
  h("dl", { class: "facts" }, pairs.filter((pair) => !!pair).map(([term, value, title]) => h("div", {}, h("dt", { title }, term), h("dd", {}, value))));
/** @type {(low: number | null | undefined, high: number | null | undefined, digits: number) => HTMLElement} */
export const interval = (low, high, digits) =>
  h("span", { class: "interval" }, low === null || high === null ? "" : `${number(low, digits)} to ${number(high, digits)}`);
/** @type {(label: string, child: Child) => HTMLElement} */
export const scroll = (label, child) => h("div", { class: "scroll", role: "region", "aria-label": label, tabindex: "0", onkeydown: walk }, child);
/** @param {string} what */
export const missing = (what) => [h("h1", {}, "Not found"), h("p", {}, `This report has no such ${what}. `, link(to("tonight"), "Back to tonight"))];
/** @param {string[]} words */
export const command = (words) => h("pre", { tabindex: "0" }, h("code", {}, typed(words)));
/** @param {number} places */
export const gained = (places) => (places === 0 ? h("span", { class: "same" }, "=") : h("span", { class: places > 0 ? "gain" : "loss" }, `${places > 0 ? "▲" : "▼"}${Math.abs(places)}`));
/** @type {(kind: string, text: Child, title?: string) => HTMLElement} */
export const chip = (kind, text, title) => h("span", { class: `chip ${kind}`, title }, text);

/**
 * What became of an entrant, in words beside its name.
 * @param {number} index
 */
export const chips = (index) => {
  const { entrant } = entrants[index];
  return [
    sent.has(entrant) && chip("sent", "sent", "the committee sends it"),
    rankingOf.get(index)?.barred ? chip("barred", "barred", "the whole interval of a contact rate is above the gate's limit") : null,
    rankingOf.has(index) && selection && !candidates.has(entrant) && chip("anchor", "anchor", "takes part every night for comparison; cannot be sent"),
  ];
};

// Arrow keys go from what can be used in one cell of a table to that in the next, past cells without any.
/** @type {Record<string, [number, number]>} */
const STEPS = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };
/** @param {KeyboardEvent} event */
function walk(event) {
  const cell = /** @type {HTMLElement} */ (event.target).closest("td, th");
  const step = STEPS[event.key];
  const line = cell?.closest("tr");
  const table = cell?.closest("table");
  if (!step || !(cell instanceof HTMLTableCellElement) || !line || !table) return;
  const rows = [...table.rows];
  let [row, column] = [line.rowIndex, cell.cellIndex];
  for (;;) {
    row += step[0];
    column += step[1];
    const next = rows[row]?.cells[column];
    if (!next) return;
    const usable = /** @type {HTMLElement | null} */ (next.querySelector("a, button, input"));
    if (usable) {
      event.preventDefault();
      usable.focus();
      return;
    }
  }
}
