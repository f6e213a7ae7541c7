// All there is to know about one entrant.

function checkpoint([key]) {
  const card = entrantByKey.get(key);
  if (!card) return missing("entrant");
  const index = card.number;
  const [filter, battery, ranking] = [paretoOf.get(index), batteryOf.get(index), rankingOf.get(index)];
  const fresh = data.previous && index < data.listed && !known.has(index);
  return [
    h("p", { class: "over" }, chips(index), fresh && chip("", "newcomer"), battery?.shortlisted ? chip("", "shortlisted") : null),
    h("h1", {}, card.name),
    facts([
      card.algorithm && ["Algorithm", card.algorithm], card.step !== null && ["Training step", number(card.step)],
      card.seed !== null && ["Training seed", String(card.seed)], card.circuit && ["Circuit", card.circuit], card.car && ["Car", card.car],
      card.source && ["Source", h("code", {}, card.source)], ["Id", h("code", { class: "id" }, card.entrant)],
    ]),
    section("How far it came", h("ul", { class: "path" },
      h("li", {}, filter ? [link(to("pareto"), "Filter"), `: ${filter.survives ? "survives" : "left out"}, not dominated in ${percent(filter.nondominated_probability)} % of the draws; `,
        (objectivesOf.get(index) ?? []).map((row, i) => `${i ? ", " : ""}${objectiveTitle(row.objective)} ${number(row.value, 3)}`)] : "Filter: was not in it."),
      h("li", {}, battery ? [link(to("n-athlon"), "n-athlon"), `: rank ${battery.rank}, ${number(battery.points)} points (${number(battery.points_low)} to ${number(battery.points_high)})`] : "n-athlon: was not in it."),
      h("li", {}, ranking ? [link(to("leaderboard"), "Team races"), `: rank ${ranking.rank ?? ABSENT}, ${number(ranking.points_per_race, 1)} points a race (${number(ranking.points_low, 1)} to ${number(ranking.points_high, 1)}), ${number(ranking.contacts_per_km, 2)} contacts per km, ${number(ranking.at_fault_per_km, 2)} at fault, ${count(ranking.faults, "fault")}`] : "Team races: was not in them."))),
    skillsOf.has(index) && section("n-athlon", profile([index])),
    ranking && section("Matchups", ownMatchups(index)),
    ballotsOn(card),
    section("Best laps", laps(index)),
    section("Races", ownRaces(index)),
  ];
}

function ownMatchups(index) {
  const rows = tables.matchups.filter((row) => row.entrant === index && row.difference !== null);
  if (!rows.length) return empty("It met nobody.");
  const bars = barScale(rows, ["difference", "difference_low", "difference_high"], 0, "points");
  return dataTable("own-matchups", [
    { key: "name", head: "Opponent", kind: "name", first: "ascending", value: (row) => nameOf(row.opponent), cell: (row) => link(to("matchup", [entrants[index].key, entrants[row.opponent].key]), nameOf(row.opponent)) },
    { key: "difference", head: "Points more, a race", value: (row) => row.difference, cell: (row) => [h("strong", {}, signed(row.difference)), " ", interval(row.difference_low, row.difference_high, 1)] },
    { key: "drawn", head: "", unseen: "Difference, drawn", kind: "drawn", cell: bars },
    { key: "contacts", head: "Contacts per km", value: (row) => row.contacts_per_km, cell: (row) => number(row.contacts_per_km, 2) },
    { key: "units", head: "Units", value: (row) => row.pairs },
  ], rows, { sort: "-difference", prefix: "matchups-", label: "Matchups" });
}

function ballotsOn(card) {
  const found = decisions.flatMap((decision) => {
    const standing = decision.standings.find((one) => one.entrant === card.entrant);
    return standing ? [[decision, standing]] : [];
  });
  if (!found.length) return null;
  return section("Committee", found.map(([decision, standing]) => [
    h("p", {}, h("strong", {}, QUESTIONS[decision.question]), ` approved on ${standing.approved_by} of ${count(decision.ballots, "ballot")}, `,
      decision.open ? "not decided yet." : standing.chosen ? "chosen." : standing.fit ? "fit, but not chosen." : "not fit."),
    h("ul", {}, decision.said.filter((said) => said.event === "voted").map((ballot) => h("li", {},
      h("strong", {}, ballot.member), ballot.approve.includes(card.entrant) ? " approves" : " does not approve",
      ballot.rank.includes(card.entrant) && `, place ${ballot.rank.indexOf(card.entrant) + 1} of ${ballot.rank.length}`, `: “${ballot.reason}”`))),
  ]));
}

function ownCars(index) {
  return racesOf(index).flatMap((race) => carsOf(race).filter((car) => car.entrant === index).map((car) => ({ ...car, race })));
}

function laps(index) {
  const timed = ownCars(index).filter((car) => car.best_lap_s !== null).map((car) => ({ ...car, test: plain(car.race.test) }));
  if (!timed.length) return empty("It completed no flying lap.");
  const kinds = [...new Set(timed.map((car) => car.test))];
  return chart(null, (width) => Plot.plot({
    width, height: 60 + 26 * kinds.length, marginLeft: width < 500 ? 126 : 150, marginBottom: 40, inset: 6, ariaLabel: "Best lap of every run",
    x: { label: "best lap of each run, and their median, s", labelAnchor: "center", labelArrow: "none", grid: true, nice: true }, y: { type: "point", domain: kinds, label: null },
    marks: [
      Plot.dot(timed, { x: "best_lap_s", y: "test", r: 3, fill: "var(--survivor)", fillOpacity: 0.35 }),
      Plot.dot(timed, Plot.groupY({ x: "median" }, { x: "best_lap_s", y: "test", symbol: "diamond", r: 5, fill: "var(--finalist)", stroke: "var(--paper)" })),
      Plot.tip(timed, Plot.pointer({ ...tip, x: "best_lap_s", y: "test", title: (car) => `${car.test}, race ${car.race.race + 1}\n${number(car.best_lap_s, 3)} s` })),
    ],
  }));
}

function ownRaces(index) {
  const own = ownCars(index);
  if (!own.length) return empty("It has not raced.");
  return dataTable("own-races", [
    { key: "race", head: "Race", kind: "name", first: "ascending", value: (row) => row.race.number, cell: (row) => link(raceHref(row.race), `${plain(row.race.test)} ${row.race.key.slice(0, 6)}/${row.race.race}`) },
    { key: "stage", head: "Stage", kind: "text", first: "ascending", value: (row) => plain(row.race.stage) },
    { key: "grid", head: "Grid", first: "ascending", value: (row) => row.slot },
    { key: "place", head: "Place", first: "ascending", value: (row) => row.place, cell: (row) => [number(row.place), " ", gained(row.slot - row.place)] },
    { key: "points", head: "Points", value: (row) => row.points, cell: (row) => number(row.points) },
    { key: "lap", head: "Best lap, s", first: "ascending", value: (row) => row.best_lap_s, cell: (row) => number(row.best_lap_s, 3) },
    { key: "contacts", head: "Contacts", value: (row) => row.contacts },
    { key: "blame", head: "At fault", value: (row) => row.contacts_at_fault },
    { key: "penalties", head: "Penalties", value: (row) => row.penalties },
    { key: "off", head: "Off course, s", value: (row) => row.off_course_s, cell: (row) => number(row.off_course_s, 1) },
    { key: "ending", head: "Ending", kind: "text", first: "ascending", value: (row) => plain(row.ending) },
  ], own, { sort: "-race", prefix: "races-", text: (row) => `${plain(row.race.test)} ${row.race.stage} ${plain(row.ending)}`, label: "Races", shown: 50 });
}
