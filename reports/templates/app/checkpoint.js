// All there is to know about one entrant.

import { rankText } from "../rank.js";
import { ABSENT, capital, count, number, percent, signed } from "../numbers.js";
import { h } from "../race/element.js";
import { barScale, chart, extent, PLAIN_AXIS, profile, tip } from "./charts.js";
import { QUESTIONS } from "./committee.js";
import {
  batteryOf, blames, carsOf, data, decisions, EACH, entrantByKey, entrants, EPISODE, EPISODES, groups, IN_MEETINGS, known, lapped, measured,
  MEETINGS, met, nameOf, onCircuit, ownCars, paretoOf, POINT_DIGITS, POINTS, RANK_DIGITS, rankingOf, skillsOf,
  stageName, summary, tables, touches, UNIT,
} from "./data.js";
import { chip, chips, empty, facts, gained, interval, link, missing, note, plain, raceHref, section, to } from "./dom.js";
import { lapView } from "./lap.js";
import { d3, Plot } from "./libraries.js";
import { objectivesTold } from "./pareto.js";
import { dataTable, ownColumns } from "./table.js";

const curves = groups(tables.curves, "checkpoints");

export function checkpoint([key]) {
  const card = entrantByKey.get(key);
  if (!card) return missing("entrant");
  const index = card.number;
  const [battery, time] = [batteryOf.get(index), rankingOf.get(index)];
  const fresh = data.previous && index < data.listed && !known.has(index);
  return [
    h("p", { class: "over" }, chips(index), fresh && chip("", "newcomer"), battery?.shortlisted ? chip("", "shortlisted") : null),
    h("h1", {}, card.name),
    facts([
      card.algorithm && ["Algorithm", card.algorithm], card.step !== null && ["Training step", number(card.step)],
      card.seed !== null && ["Training seed", String(card.seed)], card.circuit && ["Circuit", card.circuit], card.car && ["Car", card.car],
      time?.action_ms != null && ["Action", h("span", { title: data.timedOn }, `${number(time.action_ms, 3)} ms, 99 % within ${number(time.action_p99_ms, 3)} ms`)],
      card.source && ["Source", h("code", {}, card.source)], ["Id", h("code", { class: "id" }, card.entrant)],
    ]),
    wayThrough(index),
    onCircuit && section("Racing line", lapView(index)),
    trained(card),
    skillsOf.has(index) && section("n-athlon", profile([index])),
    met && rankingOf.has(index) && section("Matchups", note(`${capital(IN_MEETINGS)}. ${UNIT}`), ownMatchups(index)),
    ballotsOn(card),
    lapped && section("Best laps", bestLaps(index)),
    section(capital(EPISODES), ownRaces(index)),
  ];
}

// How far it came: a box for every stage.
function wayThrough(index) {
  const [filter, battery, ranking] = [paretoOf.get(index), batteryOf.get(index), rankingOf.get(index)];
  const box = (view, title, reached, headline, ...details) => h("li", {},
    link(to(view), title), h("span", { class: "counts" }, reached ? headline : ABSENT), h("span", { class: "cost" }, reached ? details : "did not take part"));
  const between = (low, high, digits) => `${number(low, digits)} to ${number(high, digits)}`;
  return h("ol", { class: "funnel" },
    box("pareto", "Filter", filter, filter?.survives ? "survives" : "left out",
      objectivesTold(index).map((told) => `${told}; `), `non-dominated in ${percent(filter?.nondominated_probability)}\u00a0% of the draws`),
    box("n-athlon", "n-athlon", battery, [`rank ${rankText(battery)}`], `${number(battery?.points)} points (${between(battery?.points_low, battery?.points_high, 0)}), `, battery?.shortlisted ? "shortlisted" : "not shortlisted"),
    met && box("leaderboard", MEETINGS, ranking, [`rank ${rankText(ranking)}`], `${number(ranking?.[POINTS[0]], RANK_DIGITS)} ${summary.brings} ${EACH} (${between(ranking?.[POINTS[1]], ranking?.[POINTS[2]], RANK_DIGITS)}), `,
      touches && `${number(ranking?.contacts_per_km, 2)} contacts per km, `, blames && `${number(ranking?.at_fault_per_km, 2)} at fault, `, `${count(ranking?.faults ?? 0, "fault")}`));
}

// Where it stands in its training run, if the run left a curve.
function trained(card) {
  const starts = card.step === null ? [] : [...curves.keys()].filter((start) => card.source.startsWith(start));
  const start = d3.greatest(starts, (one) => one.length);
  if (start === undefined) return null;
  const curve = curves.get(start) ?? [];
  const laps = curve.filter((row) => row.lap_s !== null);
  const kin = entrants.filter((one) => one.step !== null && one.source?.startsWith(start));
  const label = { ...PLAIN_AXIS, domain: extent(curve, (row) => row.updates), tickFormat: "~s" };
  const line = (title, y, rows, height, extra) => chart(title, (width) => Plot.plot({
    width, height, marginLeft: 52, marginRight: 16, marginBottom: 38, ariaLabel: title, x: { ...label, label: "updates", ticks: width / 110, inset: 6 }, y: { label: null, grid: true, ...extra },
    marks: [
      Plot.ruleX(kin, { x: "step", stroke: "var(--rule)", strokeDasharray: "2 3" }),
      Plot.ruleX([card.step], { stroke: "var(--finalist)", strokeWidth: 2 }),
      Plot.line(curve, { x: "updates", y, stroke: "var(--survivor)", strokeWidth: 1.6, clip: true }),
      Plot.dot(rows, { x: "updates", y, r: 2.6, fill: "var(--survivor)", clip: true }),
      Plot.tip(rows, Plot.pointer({ ...tip, x: "updates", y, title: (row) => `${number(row.updates)} updates\nlap ${number(row.lap_s, 3)} s\noff course ${percent(row.off_course_share, 1)} %` })),
    ],
  }));
  const [best, slowest] = extent(laps, (row) => row.lap_s);
  return section("Training",
    note(`Its training run was evaluated ${count(curve.length, "time")}. Solid line: this checkpoint. Dotted lines: others of the run in this report. Gaps: laps not completed.`),
    h("div", { class: "charts" },
      laps.length ? line("Mean flying lap, s", "lap_s", laps, 240, { domain: [best - 0.5, Math.max(best + 1, Math.min(1.15 * best, slowest))] }) : empty("No lap was completed."),
      line("Time off course, %", (row) => 100 * row.off_course_share, curve, 240, { zero: true })));
}

function ownMatchups(index) {
  const rows = tables.matchups.filter((row) => row.entrant === index && row.difference !== null);
  if (!rows.length) return empty("It met nobody.");
  const bars = barScale(rows, ["difference", "difference_low", "difference_high"], 0, "points");
  return dataTable("own-matchups", [
    { key: "name", head: "Opponent", kind: "name", first: "ascending", value: (row) => nameOf(row.opponent), cell: (row) => link(to("matchup", [entrants[index].key, entrants[row.opponent].key]), nameOf(row.opponent)) },
    { key: "difference", head: `Points difference, ${EACH}`, value: (row) => row.difference, cell: (row) => [h("strong", {}, signed(row.difference)), " ", interval(row.difference_low, row.difference_high, 1)] },
    { key: "drawn", head: "", unseen: "Difference, drawn", kind: "drawn", cell: bars },
    touches && { key: "contacts", head: "Contacts per km", title: `of its cars, ${IN_MEETINGS}`, value: (row) => row.contacts_per_km, cell: (row) => number(row.contacts_per_km, 2) },
    { key: "units", head: "Units", title: UNIT, value: (row) => row.pairs },
  ], rows, { sort: "-difference", prefix: "matchups-", label: "Matchups" });
}

function ballotsOn(card) {
  const found = decisions.flatMap((decision) => {
    const standing = decision.standings.find((one) => one.entrant === card.entrant);
    return standing ? [{ decision, standing }] : [];
  });
  if (!found.length) return null;
  return section("Committee", found.map(({ decision, standing }) => [
    h("p", {}, h("strong", {}, QUESTIONS[decision.question]), ` approved on ${standing.approved_by} of ${count(decision.ballots, "ballot")}, `,
      decision.open ? "not decided yet." : standing.chosen ? "chosen." : standing.fit ? "fit, but not chosen." : "not fit."),
    h("ul", {}, decision.said.filter((said) => said.event === "voted").map((ballot) => h("li", {},
      h("strong", {}, ballot.member), ballot.approve.includes(card.entrant) ? " approves" : " does not approve",
      ballot.rank.includes(card.entrant) && `, place ${ballot.rank.indexOf(card.entrant) + 1} of ${ballot.rank.length}`, `: “${ballot.reason}”`))),
  ]));
}

function bestLaps(index) {
  const timed = ownCars(index).filter((car) => car.best_lap_s !== null).map((car) => ({ ...car, test: plain(car.race.test) }));
  if (!timed.length) return empty("It completed no flying lap.");
  const kinds = [...new Set(timed.map((car) => car.test))];
  return chart(null, (width) => Plot.plot({
    width, height: 60 + 26 * kinds.length, marginLeft: 16 + 7 * Math.max(...kinds.map((kind) => kind.length)), marginBottom: 40, inset: 6, ariaLabel: "Best lap of every run",
    x: { label: "best lap of each run, and their median, s", ...PLAIN_AXIS, grid: true, nice: true }, y: { type: "point", domain: kinds, label: null },
    marks: [
      Plot.dot(timed, { x: "best_lap_s", y: "test", r: 3, fill: "var(--survivor)", fillOpacity: 0.35 }),
      Plot.dot(timed, Plot.groupY({ x: "median" }, { x: "best_lap_s", y: "test", symbol: "diamond", r: 5, fill: "var(--finalist)", stroke: "var(--paper)" })),
      Plot.tip(timed, Plot.pointer({ ...tip, x: "best_lap_s", y: "test", title: (car) => `${car.test} ${car.race.key.slice(0, 6)}/${car.race.race}\n${number(car.best_lap_s, 3)} s` })),
    ],
  }));
}

function ownRaces(index) {
  const driven = ownCars(index);
  if (!driven.length) return empty(`It has been in no ${EPISODE}.`);
  // Whom it met: the other entrants of the race.
  const against = ({ race }) => [...new Set(carsOf(race).map((car) => car.entrant))].filter((other) => other !== index).map(nameOf).join(", ");
  return dataTable("own-races", [
    { key: "race", head: capital(EPISODE), kind: "name", first: "ascending", value: (row) => row.race.number, cell: (row) => link(raceHref(row.race), `${plain(row.race.test)} ${row.race.key.slice(0, 6)}/${row.race.race}`) },
    { key: "stage", head: "Stage", kind: "text", first: "ascending", value: (row) => stageName(row.race.stage) },
    { key: "against", head: "Against", kind: "text", first: "ascending", value: against },
    { key: "grid", head: onCircuit ? "Grid" : "Seat", first: "ascending", value: (row) => row.slot },
    { key: "place", head: "Place", first: "ascending", value: (row) => row.place, cell: (row) => [number(row.place), " ", onCircuit && gained(row.slot - row.place)] },
    { key: "points", head: "Points", value: (row) => row.points, cell: (row) => number(row.points, POINT_DIGITS) },
    ...ownColumns(),
    lapped && { key: "lap", head: "Best lap, s", first: "ascending", value: (row) => row.best_lap_s, cell: (row) => number(row.best_lap_s, 3) },
    measured("contacts") && { key: "contacts", head: "Contacts", value: (row) => row.contacts },
    blames && { key: "blame", head: "At fault", value: (row) => row.contacts_at_fault },
    measured("penalties") && { key: "penalties", head: "Penalties", value: (row) => row.penalties },
    measured("off_course_s") && { key: "off", head: "Off course, s", value: (row) => row.off_course_s, cell: (row) => number(row.off_course_s, 1) },
    { key: "ending", head: "Ending", kind: "text", first: "ascending", value: (row) => plain(row.ending) },
  ], driven, { sort: "-race", prefix: "races-", text: (row) => `${plain(row.race.test)} ${stageName(row.race.stage)} ${against(row)} ${plain(row.ending)}`, label: capital(EPISODES), shown: 50 });
}
