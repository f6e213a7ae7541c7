// Figures and parts of the page that several views have.

import { ABSENT, number } from "../numbers.js";
import { h } from "../race/element.js";

/** @param {any} value */
export const absent = (value) => value === null || value === undefined;
export const percent = (share, digits = 0) => (absent(share) ? ABSENT : `${number(100 * share, digits)} %`);
export const when = (stamp) => h("time", { datetime: stamp }, `${stamp.slice(0, 10)} ${stamp.slice(11, 16)} UTC`);
export const chip = (kind, text) => h("span", { class: `chip ${kind}` }, text);
export const empty = (text) => h("p", { class: "empty" }, text);
export const note = (...text) => h("p", { class: "note" }, ...text);
export const scroll = (label, child) => h("div", { class: "scroll", role: "region", "aria-label": label, tabindex: "0" }, child);
export const head = (columns) => h("thead", {}, h("tr", {}, columns.map(([text, kind]) => h("th", { scope: "col", class: kind }, text))));
export const list = (names) => names.join(", ") || "nobody";

// A file of the run: paths are from the folder of its report.
export const fileOf = (state, path) => new URL(path, new URL(state.report, location.origin)).pathname;
export const elsewhere = (href, text) => h("a", { href, target: "_blank", rel: "noopener" }, text);
