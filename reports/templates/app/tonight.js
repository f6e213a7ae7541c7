// Tonight: whom to send and why, what became of the field, and whether the run can be trusted.

import { ABSENT, capital, count, number } from "../numbers.js";
import { h } from "../race/element.js";
import { rankText } from "../rank.js";
import {
  byEntrant, data, decisions, EACH, entrantOf, entrants, EPISODE, EPISODES, known, met, onCircuit, paretoOf, rowsOf, stageName,
  summary, tables,
} from "./data.js";
import { chip, duration, empty, entrantLink, facts, fileHref, link, note, plain, scroll, section, to } from "./dom.js";
import { clipsOf, replay } from "./recorded.js";

export function tonight() {
  const decided = entrantOf.get(summary.sent[0]?.entrant);
  return [
    h("p", { class: "over" }, data.title, data.underWay && [" · ", chip("barred", data.underWay)]),
    h("h1", {}, data.verdict.headline),
    h("div", { class: "why" }, data.verdict.sentences.map((sentence) => h("p", {}, sentence))),
    h("p", { class: "next" },
      decided && [link(to("checkpoint", [decided.key]), "The checkpoint"), " "],
      tables.ranking.length > 0 && [link(to("leaderboard"), "The leaderboard"), " "],
      decisions.length > 0 && [link(to("committee"), "The committee's reasons"), " "],
      link("ranking.xlsx", "The spreadsheet")),
    funnel(),
    h("div", { class: "halves" }, section("What changed", changes()), section("Run health", health())),
    (onCircuit || summary.replays.length > 0) && section(`${capital(EPISODES)} to look at`,
      summary.replays.length ? h("ul", {}, summary.replays.map((one) => h("li", {}, replay(one), clipsOf(one)))) : empty("No race was recorded."),
      [...new Set(summary.replays.flatMap((one) => one.notes))].map((text) => note(text))),
    summary.forecast && summary.stages.length > 0 && section("Forecast and outcome", foreseen()),
    section("The run", facts([
      onCircuit ? ["Circuit", summary.circuit] : ["World", summary.world], onCircuit && ["Car", summary.car], ["Seed", String(summary.seed ?? ABSENT)],
      ...Object.entries(summary.versions),
    ]), note("All tables of this report are also in the folder ", h("code", {}, "tables"), " as CSV and Parquet.")),
  ];
}

function funnel() {
  const view = { pareto: "pareto", battery: "n-athlon", tournament: "leaderboard", committee: "committee" };
  return summary.stages.length > 0 && h("ol", { class: "funnel" }, summary.stages.map((stage) =>
    h("li", {},
      link(to(view[stage.name] ?? "tonight"), stageName(stage.name)),
      h("span", { class: "counts" }, number(stage.in), h("span", { class: "arrow" }, "→"), number(stage.out)),
      h("span", { class: "cost" }, stage.races ? `${count(stage.races, EPISODE)}, ${duration(stage.wall_s)}` : `no ${EPISODES}`))));
}

function health() {
  const endings = new Map();
  const faulty = new Map();
  data.cars.ending.forEach((index, row) => {
    const ending = data.endings[index];
    endings.set(ending, (endings.get(ending) ?? 0) + 1);
    if (["policy_raised", "illegal_action", "timed_out"].includes(ending)) {
      faulty.set(data.cars.entrant[row], (faulty.get(data.cars.entrant[row]) ?? 0) + 1);
    }
  });
  const of = (names) => names.filter((name) => endings.get(name)).map((name) => `${plain(name)} ${number(endings.get(name))}`).join(", ");
  const worst = [...faulty].sort((a, b) => b[1] - a[1]).slice(0, 5);
  const set = Object.entries(summary.tests_set_aside);
  const kinds = Object.entries(summary.processors);
  const aside = Object.entries(summary.stages_set_aside);
  return [
    facts([
      [onCircuit ? "Car runs" : "Runs of a seat", number(summary.car_runs)],
      ["Ended by a policy's fault", [number(summary.faults), h("small", {}, of(["policy_raised", "illegal_action", "timed_out"]))]],
      ["Void", [number(summary.void), h("small", {}, of(["simulator_fault", "interrupted"]))], `ended by a fault of the simulator; the ${EPISODE} does not count`],
      ["Files set aside", number(summary.excluded.length)],
      kinds.length > 0 && [kinds.length > 1 ? "Kinds of processors" : "Processor", kinds.map(([kind, matches]) => (kinds.length > 1 ? `${kind} ${number(matches)} matches` : kind)).join(", "), "what ran on one can differ in the last digits on another"],
      met && ["Correlation in mirrored pairs", number(summary.pair_correlation, 2), `the more negative, the more ${EPISODES} mirroring saves`],
    ]),
    worst.length > 0 && h("p", {}, "Most faults: ", worst.map(([entrant, faults], i) => [i > 0 && ", ", entrantLink(entrant), ` ${number(faults)}`])),
    aside.length > 0 && h("ul", {}, aside.map(([stage, reason]) => h("li", {}, `${stageName(stage)} was not held: ${reason}`))),
    set.length > 0 && h("ul", {}, set.map(([test, reason]) => h("li", {}, `${plain(test)} was not held: ${reason}`))),
    summary.excluded.length > 0 && h("details", { open: summary.excluded.length < 6 }, h("summary", {}, "Files set aside"),
      h("ul", {}, summary.excluded.map((file) => h("li", {}, h("code", {}, file.source), " ", file.reason.replace(`${file.source}: `, ""))))),
    summary.gone.length > 0 && h("ul", {}, summary.gone.map((file) => h("li", {}, h("code", {}, file.source), ` ${file.reason}.`))),
    Object.entries(summary.also).map(([name, others]) => h("p", {}, `${name} has the same contents as `, others.map((source, i) => [i > 0 && ", ", h("code", {}, source)]), ".")),
    summary.notes.length > 0 && h("ul", {}, summary.notes.map((text) => h("li", {}, text))),
    summary.log && h("p", {}, link(fileHref(summary.log), "What policies printed")),
    data.notes.length > 0 && h("ul", {}, data.notes.map((text) => h("li", {}, text))),
  ];
}

// What was expected before the run, beside what came.
function foreseen() {
  const expected = summary.forecast;
  if (!expected) return null;
  const rows = expected.stages.flatMap((stage) => summary.stages.filter((one) => one.name === stage.name).map((came) => ({ stage, came })));
  const pair = (before, after) => [before, after].map((text) => h("td", { class: "number" }, text));
  return [
    scroll("Forecast and outcome", h("table", { id: "forecast" },
      h("thead", {},
        h("tr", {}, h("th", { rowspan: 2 }, "Stage"), ["Entrants", capital(EPISODES), "Core time"].map((name) => h("th", { colspan: 2, class: "number" }, name))),
        h("tr", {}, [1, 2, 3].map(() => ["forecast", "outcome"].map((text) => h("th", { class: "number" }, text))))),
      h("tbody", {}, rows.map(({ stage, came }) => h("tr", {}, h("th", { scope: "row" }, stageName(stage.name)),
        pair(number(stage.entrants), number(came.in)),
        pair(number(stage.races), number(came.races)),
        pair(stage.core_s === null ? ABSENT : duration(stage.core_s), came.ran ? duration(came.core_s) : ABSENT)))))),
    met && summary.effect !== null && expected.budgets.length > 0 && h("p", {},
      `Two finalists had to differ by ${number(summary.effect, 1)} points ${EACH} to be told apart in ${number(100 * expected.power)} of 100 such runs; ${number(expected.budgets[0].effect, 1)} were forecast.`),
    note(expected.earlier ? `The forecast rests on ${count(expected.earlier, "earlier run")} in this store.` : "The forecast rests on figures of the bundled ladders: no earlier run was in this store."),
  ];
}

function changes() {
  const before = data.previous;
  if (!before) return empty("There is no earlier run in this store to compare with.");
  const fresh = entrants.filter((one) => one.number < data.listed && !known.has(one.number));
  const pooled = rowsOf(before.pool);
  const places = byEntrant(pooled);
  const pool = tables.pool.length ? tables.pool : tables.ranking;
  const moved = pool
    .map((row) => ({ ...row, before: places.get(row.entrant) ?? row }))
    .filter((row) => row.before.rank !== row.rank)
    .sort((a, b) => a.rank - b.rank);
  const arrived = pool.filter((row) => !places.has(row.entrant)).sort((a, b) => a.rank - b.rank);
  const survive = fresh.filter((one) => paretoOf.get(one.number)?.survives).length;
  const names = (people) => people.map((one) => one.name).join(", ") || "nobody";
  return [
    facts([
      [`Sent in ${before.name}`, names(before.sent)],
      ["Sent now", names(summary.sent)],
      ["Newcomers", `${number(fresh.length)}, ${number(survive)} through the filter`],
    ]),
    arrived.length > 0 && h("p", {}, "New in the pool: ", arrived.slice(0, 8).map((row, i) => [i > 0 && ", ", entrantLink(row.entrant), ` (rank ${rankText(row)})`]),
      arrived.length > 8 && `, and ${number(arrived.length - 8)} more`, "."),
    !pool.length ? null : moved.length > 0
      ? h("ul", { class: "moves" }, moved.slice(0, 10).map((row) => h("li", {},
          h("span", { class: row.rank < row.before.rank ? "gain" : "loss" }, row.rank < row.before.rank ? "▲" : "▼"), " ", entrantLink(row.entrant), ` ${rankText(row.before)} → ${rankText(row)}`)))
      : h("p", {}, "No rank in the pool has changed."),
    note(`Ranks in the pool of all nights. Newcomers can push others down; more ${EPISODES} can break ties.`),
  ];
}
