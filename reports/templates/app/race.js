// One race: its grid and result, what the stewards saw, and how to run it again.

function raceView([key, index]) {
  const race = raceByKey.get(`${key}/${index}`);
  if (!race) return missing("race");
  const cars = carsOf(race);
  const teams = [...groups(cars.filter((one) => one.team >= 0), "team")].sort(([a], [b]) => a - b);
  const flagged = (value) => (value ? h("span", { class: "fault" }, number(value)) : "0");
  return [
    h("p", { class: "over" }, `${plain(race.stage)} · ${plain(race.test)}`),
    h("h1", {}, `Race ${race.race + 1} of match ${race.key.slice(0, 12)}`),
    teams.length === 2 && h("p", { class: "why" }, teams.map(([, own], i) => [i > 0 && " : ", entrantLink(own[0].entrant), ` ${number(sum(own.map((one) => one.points)))}`])),
    facts([
      ["Seed", race.seed], ["Grid", race.mirrored ? "mirrored" : "as drawn"],
      ["Contacts", number(sum(cars.map((one) => one.contacts)) / 2, 1), "each is counted by both cars"],
      ["Penalties", number(sum(cars.map((one) => one.penalties)))],
    ]),
    dataTable("result", [
      { key: "place", head: "Place", kind: "rank", first: "ascending", value: (row) => row.place },
      { key: "grid", head: "Grid", first: "ascending", value: (row) => row.slot, cell: (row) => [number(row.slot), " ", gained(row.slot - row.place)] },
      { ...entrantColumn(), cell: (row) => [row.team >= 0 && h("i", { class: `team team${row.team}`, title: `team ${row.team + 1}` }), entrantLink(row.entrant)] },
      { key: "points", head: "Points", value: (row) => row.points, cell: (row) => number(row.points) },
      { key: "time", head: "Time, s", first: "ascending", value: (row) => row.race_time_s, cell: (row) => (row.race_time_s === null ? plain(row.ending) : number(row.race_time_s, 3)) },
      { key: "lap", head: "Best lap, s", first: "ascending", value: (row) => row.best_lap_s, cell: (row) => number(row.best_lap_s, 3) },
      { key: "laps", head: "Laps", value: (row) => row.laps },
      { key: "contacts", head: "Contacts", value: (row) => row.contacts },
      { key: "blame", head: "At fault", value: (row) => row.contacts_at_fault, cell: (row) => flagged(row.contacts_at_fault) },
      { key: "penalties", head: "Penalties", value: (row) => row.penalties, cell: (row) => flagged(row.penalties) },
      { key: "off", head: "Off course, s", value: (row) => row.off_course_s, cell: (row) => number(row.off_course_s, 1) },
      { key: "wall", head: "Wall, s", value: (row) => row.wall_s, cell: (row) => number(row.wall_s, 1) },
      { key: "ending", head: "Ending", kind: "text", first: "ascending", value: (row) => plain(row.ending) },
    ], cars, { sort: "place", label: "Result" }),
    section("Watch it",
      summary.replays.filter((one) => one.match === race.key && one.race === race.race).map((one) => h("p", {}, replay(one))),
      h("p", {}, "This runs it again as it was, and shows it:"),
      command(["nathlon", "replay", data.store, `${race.key.slice(0, 12)}:${race.race}`])),
  ];
}

const gained = (places) => (places === 0 ? h("span", { class: "same" }, "=") : h("span", { class: places > 0 ? "gain" : "loss" }, `${places > 0 ? "▲" : "▼"}${Math.abs(places)}`));
