// What the page shows: `reports/payload.py` wrote it as columns, here they become rows.

import { capital } from "../numbers.js";
import { dataOf } from "../race/element.js";

/**
 * @typedef {import("page-types/page").Tables} Tables
 * @typedef {import("page-types/page").Cars} CarColumns
 * @typedef {import("page-types/summary").Summary} Summary
 */

/**
 * @template {Record<string, any[]>} Columns
 * @typedef {{ [Name in keyof Columns]: Columns[Name][number] }} Row
 */

/**
 * With all that a schema calls optional, as what has a default is written too.
 * @template T
 * @typedef {T extends (infer One)[] ? Whole<One>[] : T extends object ? { [Name in keyof T]-?: Whole<T[Name]> } : T} Whole
 */

/**
 * @typedef {object} Payload
 * @property {string} title
 * @property {string | null} underWay
 * @property {string} timedOn
 * @property {{ headline: string, sentences: string[] }} verdict
 * @property {Whole<Summary>} summary
 * @property {number} listed entrants; after them stand others that raced
 * @property {import("page-types/page").Cards} entrants
 * @property {Tables} tables
 * @property {Record<string, any[]>} incidentHistory
 * @property {string[]} notes
 * @property {string[]} endings
 * @property {{ key: string[], stage: string[], test: string[] }} matches
 * @property {{ match: number[], race: number[], seed: string[], mirrored: number[], first: number[] }} races
 * @property {CarColumns} cars
 * @property {string} store
 * @property {{ name: string, sent: { name: string }[], known: number[], pool: { entrant: number[], rank: number[], points_per_race: number[] } } | null} previous
 * @property {number | null} limit s
 * @property {import("../race/recording.js").CircuitData} circuit of the recordings
 * @property {import("../race/recording.js").RaceData[]} recordings
 */

/** @typedef {Payload["summary"]["replays"][number]} Replay */

/** @type {Payload} */
export const data = dataOf("data");

/**
 * @template {Record<string, any[]>} Columns
 * @param {Columns} columns
 * @returns {Row<Columns>[]}
 */
export const rowsOf = (columns) => {
  const names = Object.keys(columns);
  return columns[names[0]].map((_, i) => rowOf(columns, names, i));
};

/**
 * @template {Record<string, any[]>} Columns
 * @param {Columns} columns
 * @param {string[]} names
 * @param {number} i
 * @returns {Row<Columns>}
 */
const rowOf = (columns, names, i) => {
  const row = /** @type {any} */ ({});
  for (const name of names) row[name] = columns[name][i];
  return row;
};

/**
 * What a large night has much of and its first view does not show: made when first asked for.
 * @template Made
 * @param {() => Made} make
 * @returns {() => Made}
 */
const once = (make) => {
  /** @type {Made | undefined} */
  let made;
  return () => (made ??= make());
};

export const summary = data.summary;
export const tables = /** @type {{ [Name in keyof Tables]: Row<Tables[Name]>[] }} */ (Object.defineProperties({},
  Object.fromEntries(Object.entries(data.tables).map(([name, columns]) => [name, { get: once(() => rowsOf(columns)) }]))));

// A checkpoint goes by the beginning of its digest, a built-in driver by its id.
export const entrants = rowsOf(data.entrants).map((card, number) => ({
  ...card,
  number,
  key: card.entrant.includes(":") ? card.entrant : card.entrant.slice(0, 12),
}));
export const entrantOf = new Map(entrants.map((entrant) => [entrant.entrant, entrant]));
export const entrantByKey = new Map(entrants.map((entrant) => [entrant.key, entrant]));
/** @param {number} number */
export const nameOf = (number) => entrants[number].name;

/**
 * @template {{ entrant: number }} One
 * @param {One[]} rows
 */
export const byEntrant = (rows) => new Map(rows.map((row) => [row.entrant, row]));
export const rankingOf = byEntrant(tables.ranking);
export const batteryOf = byEntrant(tables.battery);
export const paretoOf = byEntrant(tables.pareto);
/**
 * @template {object} One
 * @template {keyof One} Key
 * @param {One[]} rows
 * @param {Key} key
 */
export const groups = (rows, key) => {
  /** @type {Map<One[Key], One[]>} */
  const found = new Map();
  for (const row of rows) {
    const group = found.get(row[key]);
    if (group) group.push(row);
    else found.set(row[key], [row]);
  }
  return found;
};
export const skillsOf = groups(tables.skills, "entrant");
const objectives = once(() => groups(tables.objectives, "entrant"));
/** @param {number} number of an entrant */
export const objectivesOf = (number) => objectives().get(number) ?? [];
export const tests = [...new Set(tables.skills.map((skill) => skill.test))];

export const onCircuit = summary.circuit !== "";
const races = once(() => {
  const matches = rowsOf(data.matches).map((match) => (onCircuit || match.stage !== "pareto" ? match : { ...match, test: "filter" }));
  return rowsOf(data.races).map((race, number) => ({
    ...race,
    number,
    end: data.races.first[number + 1] ?? data.cars.entrant.length,
    ...(({ key, stage, test }) => ({ key, stage, test }))(matches[race.match]),
  }));
});
const byKey = once(() => new Map(races().map((race) => [`${race.key.slice(0, 12)}/${race.race}`, race])));
/** @param {string} key `MATCH/RACE`, with the first twelve letters of the match's */
export const raceByKey = (key) => byKey().get(key);

/**
 * @typedef {ReturnType<typeof races>[number]} Race
 * @typedef {Omit<Row<CarColumns>, "ending"> & { ending: string, own: Record<string, number> }} Car
 */

/**
 * What the world measures: columns and sections of anything else are left out.
 * @param {keyof CarColumns} name
 */
export const measured = (name) => data.cars[name]?.some((value) => value !== null) ?? false;
/** @param {keyof Tables["ranking"]} name */
const ranks = (name) => tables.ranking.some((row) => row[name] !== null);
export const lapped = measured("best_lap_s");
export const touches = ranks("contacts_per_km") || (measured("contacts") && measured("distance_m"));
export const blames = ranks("at_fault_per_km") || measured("contacts_at_fault");
export const timed = ranks("action_ms");
export const EPISODE = summary.episode;
export const EPISODES = /(s|x|ch|sh)$/.test(EPISODE) ? `${EPISODE}es` : `${EPISODE}s`;
export const EACH = `${/^[aeiou]/i.test(EPISODE) ? "an" : "a"} ${EPISODE}`;
export const MEETINGS = "Round robin";
export const IN_MEETINGS = `in the ${MEETINGS.toLowerCase()}`;
export const UNIT = `A unit is the ${EPISODES} of one seed, in which all take turns on the ${onCircuit ? "places of the grid: in 4v4 a race and the same mirrored" : "seats"}.`;
/** @type {Record<string, string>} */
const STAGES = { pareto: "Pareto filter", battery: "n-athlon", tournament: MEETINGS, committee: "Committee" };
/** @param {string} stage */
export const stageName = (stage) => STAGES[stage] ?? capital(stage.replaceAll("_", " "));
export const met = !("tournament" in summary.stages_set_aside);
// Of whom the means are known: in 4v4 points are a team's, elsewhere the fit says little by itself.
export const MEANS = ranks("mean");
/** @typedef {keyof Row<Tables["ranking"]>} Figure */

/** @type {[Figure, Figure, Figure]} value, low, high */
export const POINTS = MEANS ? ["mean", "mean_low", "mean_high"] : ["points_per_race", "points_low", "points_high"];
export const POINTS_HEAD = MEANS ? `Mean ${summary.brings} ${EACH} played` : met ? `Points ${EACH}` : "n-athlon points";
export const RANK_DIGITS = MEANS ? 2 : 1;
export const POINT_DIGITS = data.cars.points.every(Number.isInteger) ? 0 : 2;
export const ownNames = Object.keys(JSON.parse(data.cars.measures?.find((text) => text !== null) ?? "{}"));

const carColumns = Object.keys(data.cars);

/**
 * @param {number} index
 * @returns {Car}
 */
const carAt = (index) => {
  const car = rowOf(data.cars, carColumns, index);
  return { ...car, ending: data.endings[car.ending], own: ownNames.length ? JSON.parse(car.measures ?? "{}") : {} };
};
/** @param {Race} race */
export const carsOf = (race) => Array.from({ length: race.end - race.first }, (_, i) => carAt(race.first + i));

const racesByEntrant = once(() => {
  const found = /** @type {Race[][]} */ (entrants.map(() => []));
  for (const race of races()) {
    const there = new Set(data.cars.entrant.slice(race.first, race.end));
    for (const entrant of there) found[entrant].push(race);
  }
  return found;
});
/** @param {number} number of an entrant; the races that it took part in */
export const racesOf = (number) => racesByEntrant()[number];

/** @param {number} index of an entrant */
export function ownCars(index) {
  return racesOf(index).flatMap((race) => carsOf(race).filter((car) => car.entrant === index).map((car) => ({ ...car, race })));
}

export const decisions = summary.committee;
export const selection = decisions.find((decision) => decision.question === "selection");
export const candidates = new Set((selection?.standings ?? []).map((standing) => standing.entrant));
export const sent = new Set(summary.sent.map((one) => one.entrant));
export const known = new Set(data.previous?.known ?? []);

export const sum = (values) => values.reduce((total, value) => total + (value ?? 0), 0);
