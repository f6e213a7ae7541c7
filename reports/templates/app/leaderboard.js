// The meetings: points and contacts with their intervals, and two entrants side by side.

import { rankText } from "../rank.js";
import { ABSENT, capital, number, percent, signed } from "../numbers.js";
import { h } from "../race/element.js";
import { barScale, profile } from "./charts.js";
import {
  batteryOf, blames, data, EACH, entrantByKey, entrants, EPISODES, IN_MEETINGS, MEANS, MEETINGS, met, nameOf, POINTS, POINTS_HEAD, RANK_DIGITS,
  rankingOf, skillsOf, summary, tables, tests, timed, touches, UNIT,
} from "./data.js";
import { empty, entrantLink, here, interval, keep, link, missing, note, plain, scroll, section, to, units } from "./dom.js";
import { limitColumn, limitNote } from "./lap.js";
import { d3 } from "./libraries.js";
import { asked } from "./n_athlon.js";
import { measuredIn, objectiveDigits, objectiveTitle, objectiveUnit, objectiveValue } from "./pareto.js";
import { dataTable, entrantColumn, rankColumn, RANKS } from "./table.js";

/** @typedef {import("./data.js").Figure} Figure */

const GATED = "barred only if the whole interval is above the gate's limit";

export function leaderboard() {
  const rows = tables.ranking.map((row) => ({ ...row, skill: batteryOf.get(row.entrant)?.points ?? null }));
  const title = h("h1", {}, "Leaderboard");
  if (!rows.length) return [title, empty(`No entrant reached the ${MEETINGS.toLowerCase()}.`)];
  const points = barScale(rows, POINTS, d3.mean(rows, (row) => row[POINTS[0]]) ?? 0, "points");
  const contacts = barScale(rows, ["contacts_per_km", "contacts_low", "contacts_high"], 0, "contacts");
  /** @type {(key: string, head: string, digits: number, figures: [Figure, Figure, Figure], extra?: object) => import("./table.js").Column} */
  const figure = (key, head, digits, [value, low, high], extra = {}) => ({
    key, head, value: (row) => row[value],
    cell: (row) => [h("strong", {}, number(row[value], digits)), " ", interval(row[low], row[high], digits)], ...extra,
  });
  return [
    title,
    !met && note(`The entrants did not meet: ${summary.stages_set_aside.tournament}.`),
    note(`${RANKS} Each ${percent(summary.confidence)}\u00a0% interval is of one entrant: two may overlap although one is proven better. Drawn points begin at the mean of all${touches ? ", contacts at 0" : ""}.${met ? ` Points${touches ? " and contacts" : ""}: ${IN_MEETINGS}.` : ""}${limitNote()}`),
    comparison(),
    dataTable("leaderboard", [
      { key: "pick", head: "", unseen: "Compare", kind: "pick", cell: (row) => picker(row.entrant) },
      rankColumn,
      entrantColumn(),
      figure("points", POINTS_HEAD, RANK_DIGITS, POINTS),
      { key: "points-drawn", head: "", unseen: "Points, drawn", kind: "drawn", cell: points },
      ...(MEANS ? ["won", "drawn", "lost"] : []).map((name) => ({ key: name, head: `${capital(name)}, %`, value: (row) => row[name], cell: (row) => percent(row[name]), title: `of the ${EPISODES} that it played` })),
      touches && figure("contacts", "Contacts per km", 2, ["contacts_per_km", "contacts_low", "contacts_high"], { first: "ascending", title: GATED }),
      touches && { key: "contacts-drawn", head: "", unseen: "Contacts, drawn", kind: "drawn", cell: contacts },
      blames && figure("blame", "At fault per km", 2, ["at_fault_per_km", "at_fault_low", "at_fault_high"], { first: "ascending", title: `contacts for which the stewards blame its cars; ${GATED}` }),
      met && { key: "skill", head: "n\u2011athlon", value: (row) => row.skill, cell: (row) => number(row.skill) },
      ...limitColumn(),
      met && { key: "races", head: capital(EPISODES), value: (row) => row.races, cell: (row) => number(row.races) },
      timed && { key: "action", head: "Action, ms", first: "ascending", title: data.timedOn, value: (row) => row.action_p99_ms, cell: (row) => [number(row.action_ms, 3), " ", h("span", { class: "interval" }, `99 %: ${number(row.action_p99_ms, 3)}`)] },
      timed && { key: "model", head: "Model, MB", first: "ascending", title: data.timedOn, value: (row) => row.model_mb, cell: (row) => number(row.model_mb, 2) },
      met && { key: "faults", head: "Faults", value: (row) => row.faults, cell: (row) => (row.faults ? h("span", { class: "fault" }, number(row.faults)) : "0") },
    ], rows, { sort: "rank", text: (row) => nameOf(row.entrant), grouped: { key: "rank" }, label: "Leaderboard" }),
    timed && note(`Action: ${data.timedOn}`),
    strategies(),
    ratings(),
  ];
}

// Policies crossed with strategies: points of both, and what each of them adds.
function strategies() {
  if (!tables.strategies.length) return null;
  const [policies, plans, both] = [
    tables.strategies.filter((row) => row.strategy === ""), tables.strategies.filter((row) => row.policy === ""), tables.strategies.filter((row) => row.policy !== "" && row.strategy !== ""),
  ];
  const between = (low, high) => h("span", { class: "interval" }, low === null ? "" : `${signed(low, 2)} to ${signed(high, 2)}`);
  const effect = (row) => h("td", { class: "number" }, h("strong", {}, signed(row.effect, 2)), " ", between(row.effect_low, row.effect_high));
  const best = d3.max(both, (row) => row.points);
  const cell = (row) => h("td", { class: "number", title: `beside both effects: ${signed(row.effect, 2)}` },
    h("a", { href: to("checkpoint", [entrants[row.entrant].key]) }, row.points === best ? h("strong", {}, number(row.points, 2)) : number(row.points, 2)), " ",
    h("span", { class: "interval" }, row.points_low === null ? "" : `${number(row.points_low, 2)} to ${number(row.points_high, 2)}`));
  return section("Policies and strategies",
    note(`Mean points ${EACH} played of every policy with every strategy, with intervals over ${number(both[0].units)} units; bold: the most. Effects: what a policy, or a strategy, adds to the mean of all. ${UNIT}`),
    scroll("Policies and strategies", h("table", { id: "strategies" },
      h("thead", {}, h("tr", {}, h("th", { scope: "col", class: "name" }, "Policy"), plans.map((row) => h("th", { scope: "col", class: "number" }, row.strategy)), h("th", { scope: "col", class: "number" }, "Effect of the policy"))),
      h("tbody", {},
        policies.map((row) => h("tr", {}, h("th", { scope: "row", class: "name" }, row.policy), plans.map((plan) => cell(both.find((one) => one.policy === row.policy && one.strategy === plan.strategy))), effect(row))),
        h("tr", {}, h("th", { scope: "row", class: "name" }, "Effect of the strategy"), plans.map(effect), h("td", {}))))));
}

function ratings() {
  if (!met || (!tables.ratings.length && !data.notes.length)) return null;
  const rows = [...tables.ratings].sort((a, b) => a.bradley_terry_rank - b.bradley_terry_rank);
  return section("Ratings",
    note("A check on the points, not a second ranking."),
    data.notes.length ? h("ul", {}, data.notes.map((text) => h("li", {}, text))) : h("p", {}, "Nothing proves them to differ from the points, and one rating for each entrant explains the matchups."),
    rows.length > 0 && h("details", {}, h("summary", {}, "All ratings"), scroll("Ratings", h("table", {},
      h("thead", {}, h("tr", {}, ["Entrant", "Bradley–Terry", "rank", "Plackett–Luce", "rank"].map((head, i) => h("th", { scope: "col", class: i ? "number" : "name" }, head)))),
      h("tbody", {}, rows.map((row) => h("tr", {}, h("th", { scope: "row", class: "name" }, entrantLink(row.entrant)),
        [signed(row.bradley_terry, 2), number(row.bradley_terry_rank), signed(row.plackett_luce, 2), number(row.plackett_luce_rank)].map((text) => h("td", { class: "number" }, text)))))))));
}

// Two that are picked, kept in the address as ?pick=a,b.
const picked = () => (here().params.get("pick") ?? "").split(",").map((key) => entrantByKey.get(key)).filter((one) => one !== undefined);
function picker(index) {
  const { key, name } = entrants[index];
  return h("input", {
    type: "checkbox", "aria-label": `Compare ${name}`, checked: picked().some((one) => one.key === key),
    onchange: (event) => {
      const others = picked().map((one) => one.key).filter((one) => one !== key);
      keep("pick", (event.target.checked ? [...others, key].slice(-2) : others).join(","));
      const left = picked();
      for (const box of /** @type {NodeListOf<HTMLInputElement>} */ (document.querySelectorAll(".pick input"))) box.checked = left.some((one) => box.getAttribute("aria-label") === `Compare ${one.name}`);
      document.querySelector(".comparison")?.replaceWith(comparison());
    },
  });
}
function comparison() {
  const two = picked();
  const host = (...children) => h("p", { class: "comparison", "aria-live": "polite" }, ...children);
  if (two.length < 2) return host(two.length ? "Pick one more to compare." : "Pick two to compare them.");
  return host(link(to("compare", two.map((one) => one.key)), `Compare ${two[0].name} and ${two[1].name}`));
}

export function compare([first, second]) {
  const two = [first, second].map((key) => entrantByKey.get(key)).filter((one) => one !== undefined);
  if (two.length < 2) return missing("entrant");
  const numbers = two.map((one) => one.number);
  const shown = (table, name, digits, low, high) => numbers.map((index) => {
    const row = table.get(index);
    return { value: row?.[name] ?? null, low: row?.[low] ?? null, high: row?.[high] ?? null, digits };
  });
  const rankOf = (table) => numbers.map((index) => ({ value: table.get(index)?.rank ?? null, low: null, high: null, digits: 0, text: rankText(table.get(index)) }));
  const skill = (test) => numbers.map((index) => {
    const own = (skillsOf.get(index) ?? []).find((one) => one.test === test);
    return { value: own?.points ?? null, low: own?.points_low ?? null, high: own?.points_high ?? null, digits: 0 };
  });
  const both = tables.matchups.find((row) => row.entrant === numbers[0] && row.opponent === numbers[1]);
  const objectives = [...new Set(tables.objectives.map((row) => row.objective))];
  /** @type {[string | null, (Pair | false)[]][]} */
  const groups = [
    [met ? MEETINGS : null, [
      { label: "Rank", title: RANKS, two: rankOf(rankingOf) },
      { label: POINTS_HEAD, two: shown(rankingOf, POINTS[0], RANK_DIGITS, POINTS[1], POINTS[2]), goal: "max", sure: both && [both.difference_low, both.difference_high] },
      touches && { label: "Contacts per km", two: shown(rankingOf, "contacts_per_km", 2, "contacts_low", "contacts_high"), goal: "min" },
      blames && { label: "At fault per km", two: shown(rankingOf, "at_fault_per_km", 2, "at_fault_low", "at_fault_high"), goal: "min" },
      { label: "Faults", two: shown(rankingOf, "faults", 0), goal: "min" },
    ]],
    ["n-athlon", [
      { label: "Rank", title: RANKS, two: rankOf(batteryOf) },
      { label: "Sum", two: shown(batteryOf, "points", 0, "points_low", "points_high"), goal: "max", apart: true },
      ...tests.map((test) => ({ label: plain(test), title: asked(test), two: skill(test), goal: "max", apart: true })),
    ]],
    ["Pareto filter", objectives.map((name) => ({
      label: `${objectiveTitle(name)}, ${measuredIn(name)}`, goal: objectiveUnit(name).goal,
      two: numbers.map((index) => ({ value: objectiveValue(index, name), low: null, high: null, digits: objectiveDigits(name) })),
    }))],
  ];
  return [
    h("h1", {}, `${two[0].name} and ${two[1].name}`),
    both
      ? h("p", { class: "why" }, `Against each other: ${signed(both.difference)} points ${EACH} for ${two[0].name} (${signed(both.difference_low)} to ${signed(both.difference_high)}) in `, units(both.pairs), ". ", link(to("matchup", [first, second]), `Their ${EPISODES}`))
      : note(`They did not meet in the ${MEETINGS.toLowerCase()}.`),
    scroll("Side by side", h("table", { class: "sides" },
      h("thead", {}, h("tr", {}, h("th", { scope: "col", class: "name" }, "Figure"), numbers.map((index) => h("th", { scope: "col", class: "number" }, entrantLink(index))),
        h("th", { scope: "col", class: "number" }, "Difference"), h("th", { scope: "col", class: "text" }, "Better"))),
      groups.map(([stage, rows]) => h("tbody", {},
        stage && h("tr", {}, h("th", { scope: "rowgroup", class: "name stage", colspan: 5 }, stage)),
        rows.filter((row) => row !== false).map((row) => sideBySide(row, two.map((one) => one.name))))))),
    note(`Intervals of differences: ${percent(summary.confidence)}\u00a0%, of one figure alone. Points and contacts of the ${MEETINGS.toLowerCase()} rest on the same ${EPISODES}: their differences have no interval of their own. Nothing is proven where there is none. Differences are of figures that are not rounded; the points ${EACH} in the table are of all opponents, not of these two alone. ${both ? UNIT : ""}`),
    numbers.every((index) => skillsOf.has(index)) && section("Their n-athlon", profile(numbers)),
  ];
}

/** @typedef {{ value: number | null, low: number | null, high: number | null, digits: number, text?: string }} Estimate */

/**
 * Of two estimates that know nothing of each other: Zou and Donner's interval of their difference.
 * @param {Estimate} a
 * @param {Estimate} b
 * @returns {[number, number] | [null, null]}
 */
const apartBy = (a, b) => {
  if (a.value === null || a.low === null || a.high === null || b.value === null || b.low === null || b.high === null) return [null, null];
  const difference = a.value - b.value;
  return [difference - Math.hypot(a.value - a.low, b.high - b.value), difference + Math.hypot(a.high - a.value, b.value - b.low)];
};

/**
 * @typedef {object} Pair a figure of two entrants
 * @property {string} label
 * @property {string} [title]
 * @property {Estimate[]} two
 * @property {string} [goal] "max" or "min"
 * @property {boolean} [apart] whether the two know nothing of each other
 * @property {[number, number]} [sure] what their difference lies within, where something else tells it
 */

/**
 * A figure of two entrants, what they differ by, and who is better.
 * @param {Pair} pair
 * @param {string[]} names
 */
function sideBySide({ label, title, two: [a, b], goal, apart = false, sure }, names) {
  const difference = a.value === null || b.value === null ? null : a.value - b.value;
  const [low, high] = difference !== null && apart ? apartBy(a, b) : [null, null];
  const [least, most] = sure ?? [low, high];
  const overlap = least === null && a.low !== null && b.low !== null && a.low <= (b.high ?? b.low) && b.low <= (a.high ?? a.low);
  const first = difference !== null && (goal === "min" ? difference < 0 : difference > 0);
  const alone = least === null && a.low === null && b.low === null ? ", as measured" : "";
  const told = !goal || difference === null ? "" : !/[1-9]/.test(number(difference, a.digits)) ? "alike"
    : overlap || (least !== null && most !== null && least <= 0 && most >= 0) ? "not told apart" : names[first ? 0 : 1] + alone;
  return h("tr", {}, h("th", { scope: "row", class: "name", title }, label),
    [a, b].map(({ value, low: least, high: most, digits, text }) => h("td", { class: "number" }, h("strong", {}, text ?? number(value, digits)), " ", interval(least, most, digits))),
    h("td", { class: "number" }, a.text || difference === null ? ABSENT : [signed(difference, a.digits), " ", interval(low, high, a.digits)]),
    h("td", { class: "text" }, told));
}
