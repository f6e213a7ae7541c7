// What the page shows: `reports/payload.py` wrote it as columns, here they become rows.

const data = JSON.parse(document.getElementById("data").textContent);

const rowsOf = (columns) => {
  const names = Object.keys(columns);
  const rows = new Array(columns[names[0]].length);
  for (let i = 0; i < rows.length; i++) {
    const row = {};
    for (const name of names) row[name] = columns[name][i];
    rows[i] = row;
  }
  return rows;
};

const summary = data.summary;
const tables = Object.fromEntries(Object.entries(data.tables).map(([name, columns]) => [name, rowsOf(columns)]));

// A checkpoint goes by the beginning of its digest, a built-in driver by its id.
const entrants = rowsOf(data.entrants).map((card, number) => ({
  ...card,
  number,
  key: card.entrant.includes(":") ? card.entrant : card.entrant.slice(0, 12),
}));
const entrantOf = new Map(entrants.map((entrant) => [entrant.entrant, entrant]));
const entrantByKey = new Map(entrants.map((entrant) => [entrant.key, entrant]));
const nameOf = (number) => entrants[number].name;

const byEntrant = (rows) => new Map(rows.map((row) => [row.entrant, row]));
const rankingOf = byEntrant(tables.ranking);
const [rankWritten, poolRank, batteryRank] = [tables.ranking, tables.pool.length ? tables.pool : tables.ranking, tables.battery].map(rankIn);
const batteryOf = byEntrant(tables.battery);
const paretoOf = byEntrant(tables.pareto);
const groups = (rows, key) => {
  const found = new Map();
  for (const row of rows) found.has(row[key]) ? found.get(row[key]).push(row) : found.set(row[key], [row]);
  return found;
};
const skillsOf = groups(tables.skills, "entrant");
const objectivesOf = groups(tables.objectives, "entrant");
const tests = [...new Set(tables.skills.map((skill) => skill.test))];

const onCircuit = summary.circuit !== "";
const matches = rowsOf(data.matches).map((match) => (onCircuit || match.stage !== "pareto" ? match : { ...match, test: "filter" }));
const races = rowsOf(data.races).map((race, number) => ({
  ...race,
  number,
  end: data.races.first[number + 1] ?? data.cars.entrant.length,
  ...(({ key, stage, test }) => ({ key, stage, test }))(matches[race.match]),
}));
const raceByKey = new Map(races.map((race) => [`${race.key.slice(0, 12)}/${race.race}`, race]));

// What the world measures: columns and sections of anything else are left out.
const measured = (name) => data.cars[name]?.some((value) => value !== null) ?? false;
const ranks = (name) => tables.ranking.some((row) => row[name] !== null);
const [lapped, touches, blames] = [measured("best_lap_s"), ranks("contacts_per_km") || (measured("contacts") && measured("distance_m")), ranks("at_fault_per_km") || measured("contacts_at_fault")];
const timed = ranks("action_ms");
const EPISODE = summary.episode;
const EPISODES = /(s|x|ch|sh)$/.test(EPISODE) ? `${EPISODE}es` : `${EPISODE}s`;
const EACH = `${/^[aeiou]/i.test(EPISODE) ? "an" : "a"} ${EPISODE}`;
const capital = (text) => text[0].toUpperCase() + text.slice(1);
const MEETINGS = "Round robin";
const STAGES = { pareto: "Pareto filter", battery: "n-athlon", tournament: MEETINGS, committee: "Committee" };
const stageName = (stage) => STAGES[stage] ?? capital(stage.replaceAll("_", " "));
const met = !("tournament" in summary.stages_set_aside);
// Of whom the means are known: in 4v4 points are a team's, elsewhere the fit says little by itself.
const MEANS = ranks("mean");
const POINTS = MEANS ? ["mean", "mean_low", "mean_high"] : ["points_per_race", "points_low", "points_high"];
const POINTS_HEAD = MEANS ? `Mean ${summary.brings} ${EACH} played` : met ? `Points ${EACH}` : "n-athlon points";
const RANK_DIGITS = MEANS ? 2 : 1;
const POINT_DIGITS = data.cars.points.every(Number.isInteger) ? 0 : 2;
const ownNames = Object.keys(JSON.parse(data.cars.measures?.find((text) => text !== null) ?? "{}"));

const carAt = (index) => {
  const car = {};
  for (const name in data.cars) car[name] = data.cars[name][index];
  car.ending = data.endings[car.ending];
  car.own = ownNames.length ? JSON.parse(car.measures ?? "{}") : {};
  return car;
};
const carsOf = (race) => Array.from({ length: race.end - race.first }, (_, i) => carAt(race.first + i));

// Which races an entrant took part in; made when first asked for.
let racesByEntrant = null;
const racesOf = (number) => {
  if (!racesByEntrant) {
    racesByEntrant = entrants.map(() => []);
    for (const race of races) {
      const there = new Set(data.cars.entrant.slice(race.first, race.end));
      for (const entrant of there) racesByEntrant[entrant].push(race);
    }
  }
  return racesByEntrant[number];
};

const decisions = summary.committee;
const selection = decisions.find((decision) => decision.question === "selection");
const candidates = new Set((selection?.standings ?? []).map((standing) => standing.entrant));
const sent = new Set(summary.sent.map((one) => one.entrant));
const known = new Set(data.previous?.known ?? []);

const sum = (values) => values.reduce((total, value) => total + (value ?? 0), 0);
