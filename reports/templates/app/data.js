// What the page shows: `reports/payload.py` wrote it as columns, here they become rows.

import { rankIn } from "../rank.js";

export const data = JSON.parse(document.getElementById("data").textContent);

export const rowsOf = (columns) => {
  const names = Object.keys(columns);
  const rows = new Array(columns[names[0]].length);
  for (let i = 0; i < rows.length; i++) {
    const row = {};
    for (const name of names) row[name] = columns[name][i];
    rows[i] = row;
  }
  return rows;
};

export const summary = data.summary;
export const tables = Object.fromEntries(Object.entries(data.tables).map(([name, columns]) => [name, rowsOf(columns)]));

// A checkpoint goes by the beginning of its digest, a built-in driver by its id.
export const entrants = rowsOf(data.entrants).map((card, number) => ({
  ...card,
  number,
  key: card.entrant.includes(":") ? card.entrant : card.entrant.slice(0, 12),
}));
export const entrantOf = new Map(entrants.map((entrant) => [entrant.entrant, entrant]));
export const entrantByKey = new Map(entrants.map((entrant) => [entrant.key, entrant]));
export const nameOf = (number) => entrants[number].name;

export const byEntrant = (rows) => new Map(rows.map((row) => [row.entrant, row]));
export const rankingOf = byEntrant(tables.ranking);
export const rankWritten = rankIn(tables.ranking);
export const poolRank = rankIn(tables.pool.length ? tables.pool : tables.ranking);
export const batteryRank = rankIn(tables.battery);
export const batteryOf = byEntrant(tables.battery);
export const paretoOf = byEntrant(tables.pareto);
export const groups = (rows, key) => {
  const found = new Map();
  for (const row of rows) found.has(row[key]) ? found.get(row[key]).push(row) : found.set(row[key], [row]);
  return found;
};
export const skillsOf = groups(tables.skills, "entrant");
export const objectivesOf = groups(tables.objectives, "entrant");
export const tests = [...new Set(tables.skills.map((skill) => skill.test))];

export const onCircuit = summary.circuit !== "";
const matches = rowsOf(data.matches).map((match) => (onCircuit || match.stage !== "pareto" ? match : { ...match, test: "filter" }));
const races = rowsOf(data.races).map((race, number) => ({
  ...race,
  number,
  end: data.races.first[number + 1] ?? data.cars.entrant.length,
  ...(({ key, stage, test }) => ({ key, stage, test }))(matches[race.match]),
}));
export const raceByKey = new Map(races.map((race) => [`${race.key.slice(0, 12)}/${race.race}`, race]));

// What the world measures: columns and sections of anything else are left out.
export const measured = (name) => data.cars[name]?.some((value) => value !== null) ?? false;
const ranks = (name) => tables.ranking.some((row) => row[name] !== null);
export const lapped = measured("best_lap_s");
export const touches = ranks("contacts_per_km") || (measured("contacts") && measured("distance_m"));
export const blames = ranks("at_fault_per_km") || measured("contacts_at_fault");
export const EPISODE = summary.episode;
export const EPISODES = /(s|x|ch|sh)$/.test(EPISODE) ? `${EPISODE}es` : `${EPISODE}s`;
export const EACH = `${/^[aeiou]/i.test(EPISODE) ? "an" : "a"} ${EPISODE}`;
export const capital = (text) => text[0].toUpperCase() + text.slice(1);
export const MEETINGS = "Round robin";
const STAGES = { pareto: "Pareto filter", battery: "n-athlon", tournament: MEETINGS, committee: "Committee" };
export const stageName = (stage) => STAGES[stage] ?? capital(stage.replaceAll("_", " "));
export const met = !("tournament" in summary.stages_set_aside);
// Of whom the means are known: in 4v4 points are a team's, elsewhere the fit says little by itself.
export const MEANS = ranks("mean");
export const POINTS = MEANS ? ["mean", "mean_low", "mean_high"] : ["points_per_race", "points_low", "points_high"];
export const POINTS_HEAD = MEANS ? `Mean ${summary.brings} ${EACH} played` : met ? `Points ${EACH}` : "n-athlon points";
export const RANK_DIGITS = MEANS ? 2 : 1;
export const POINT_DIGITS = data.cars.points.every(Number.isInteger) ? 0 : 2;
export const ownNames = Object.keys(JSON.parse(data.cars.measures?.find((text) => text !== null) ?? "{}"));

const carAt = (index) => {
  const car = {};
  for (const name in data.cars) car[name] = data.cars[name][index];
  car.ending = data.endings[car.ending];
  car.own = ownNames.length ? JSON.parse(car.measures ?? "{}") : {};
  return car;
};
export const carsOf = (race) => Array.from({ length: race.end - race.first }, (_, i) => carAt(race.first + i));

// Which races an entrant took part in; made when first asked for.
let racesByEntrant = null;
export const racesOf = (number) => {
  if (!racesByEntrant) {
    racesByEntrant = entrants.map(() => []);
    for (const race of races) {
      const there = new Set(data.cars.entrant.slice(race.first, race.end));
      for (const entrant of there) racesByEntrant[entrant].push(race);
    }
  }
  return racesByEntrant[number];
};

export function ownCars(index) {
  return racesOf(index).flatMap((race) => carsOf(race).filter((car) => car.entrant === index).map((car) => ({ ...car, race })));
}

export const decisions = summary.committee;
export const selection = decisions.find((decision) => decision.question === "selection");
export const candidates = new Set((selection?.standings ?? []).map((standing) => standing.entrant));
export const sent = new Set(summary.sent.map((one) => one.entrant));
export const known = new Set(data.previous?.known ?? []);

export const sum = (values) => values.reduce((total, value) => total + (value ?? 0), 0);
