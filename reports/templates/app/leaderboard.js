// The meetings: points and contacts with their intervals, and two entrants side by side.

const GATED = "barred only if the whole interval is above the gate's limit";

function leaderboard() {
  const rows = tables.ranking.map((row) => ({ ...row, skill: batteryOf.get(row.entrant)?.points ?? null }));
  const title = h("h1", {}, "Leaderboard");
  if (!rows.length) return [title, empty(`No entrant reached the ${MEETINGS.toLowerCase()}.`)];
  const points = barScale(rows, POINTS, d3.mean(rows, (row) => row[POINTS[0]]) ?? 0, "points");
  const contacts = barScale(rows, ["contacts_per_km", "contacts_low", "contacts_high"], 0, "contacts");
  const figure = (key, head, digits, [value, low, high], extra = {}) => ({
    key, head, value: (row) => row[value],
    cell: (row) => [h("strong", {}, number(row[value], digits)), " ", interval(row[low], row[high], digits)], ...extra,
  });
  return [
    title,
    !met && note(`The entrants did not meet: ${summary.stages_set_aside.tournament}.`),
    note(`Rank: 1 + the number of entrants proven better, after Holm's correction. = marks a statistical tie. Each ${percent(summary.confidence)}\u00a0% interval is of one entrant: two may overlap although one is proven better.${limitNote()}`),
    comparison(),
    dataTable("leaderboard", [
      { key: "pick", head: "", unseen: "Compare", kind: "pick", cell: (row) => picker(row.entrant) },
      rankColumn(rows),
      entrantColumn(),
      figure("points", POINTS_HEAD, RANK_DIGITS, POINTS),
      { key: "points-drawn", head: "", unseen: "Points, drawn", kind: "drawn", cell: points },
      ...(MEANS ? ["won", "drawn", "lost"] : []).map((name) => ({ key: name, head: `${capital(name)}, %`, value: (row) => row[name], cell: (row) => percent(row[name]), title: `of the ${EPISODES} that it played` })),
      touches && figure("contacts", "Contacts per km", 2, ["contacts_per_km", "contacts_low", "contacts_high"], { first: "ascending", title: GATED }),
      touches && { key: "contacts-drawn", head: "", unseen: "Contacts, drawn", kind: "drawn", cell: contacts },
      blames && figure("blame", "At fault per km", 2, ["at_fault_per_km", "at_fault_low", "at_fault_high"], { first: "ascending", title: `contacts for which the stewards blame its cars; ${GATED}` }),
      met && { key: "skill", head: "n-athlon", value: (row) => row.skill, cell: (row) => number(row.skill) },
      ...limitColumn(),
      met && { key: "races", head: capital(EPISODES), value: (row) => row.races, cell: (row) => number(row.races) },
      timed && { key: "action", head: "Action, ms", first: "ascending", title: data.timedOn, value: (row) => row.action_p99_ms, cell: (row) => [number(row.action_ms, 3), " ", h("span", { class: "interval" }, `99 %: ${number(row.action_p99_ms, 3)}`)] },
      timed && { key: "memory", head: "Memory, MB", first: "ascending", title: data.timedOn, value: (row) => row.memory_mb, cell: (row) => number(row.memory_mb, 1) },
      met && { key: "faults", head: "Faults", value: (row) => row.faults, cell: (row) => (row.faults ? h("span", { class: "fault" }, number(row.faults)) : "0") },
    ], rows, { sort: "rank", text: (row) => nameOf(row.entrant), grouped: { key: "rank" }, label: "Leaderboard" }),
    timed && note(`Action: ${data.timedOn}`),
    ratings(),
  ];
}

function ratings() {
  if (!met || (!tables.ratings.length && !data.notes.length)) return null;
  const rows = [...tables.ratings].sort((a, b) => a.bradley_terry_rank - b.bradley_terry_rank);
  return section("Ratings",
    note("A check on the points, not a second ranking."),
    data.notes.length ? h("ul", {}, data.notes.map((text) => h("li", {}, text))) : h("p", {}, "They agree with the points, and one rating for each entrant explains the matchups."),
    rows.length > 0 && h("details", {}, h("summary", {}, "All ratings"), scroll("Ratings", h("table", {},
      h("thead", {}, h("tr", {}, ["Entrant", "Bradley–Terry", "rank", "Plackett–Luce", "rank"].map((head, i) => h("th", { scope: "col", class: i ? "number" : "name" }, head)))),
      h("tbody", {}, rows.map((row) => h("tr", {}, h("th", { scope: "row", class: "name" }, entrantLink(row.entrant)),
        [signed(row.bradley_terry, 2), number(row.bradley_terry_rank), signed(row.plackett_luce, 2), number(row.plackett_luce_rank)].map((text) => h("td", { class: "number" }, text)))))))));
}

// Two that are picked, kept in the address as ?pick=a,b.
const picked = () => (here().params.get("pick") ?? "").split(",").filter((key) => entrantByKey.has(key));
function picker(index) {
  const { key, name } = entrants[index];
  return h("input", {
    type: "checkbox", "aria-label": `Compare ${name}`, checked: picked().includes(key),
    onchange: (event) => {
      const others = picked().filter((one) => one !== key);
      keep("pick", (event.target.checked ? [...others, key].slice(-2) : others).join(","));
      const left = picked();
      for (const box of document.querySelectorAll(".pick input")) box.checked = left.some((one) => box.getAttribute("aria-label") === `Compare ${entrantByKey.get(one).name}`);
      document.querySelector(".comparison").replaceWith(comparison());
    },
  });
}
function comparison() {
  const keys = picked();
  const host = (...children) => h("p", { class: "comparison", "aria-live": "polite" }, ...children);
  if (keys.length < 2) return host(keys.length ? "Pick one more to compare." : "Pick two to compare them.");
  return host(link(to("compare", keys), `Compare ${entrantByKey.get(keys[0]).name} and ${entrantByKey.get(keys[1]).name}`));
}

function compare([first, second]) {
  const two = [first, second].map((key) => entrantByKey.get(key));
  if (two.includes(undefined)) return missing("entrant");
  const numbers = two.map((one) => one.number);
  const shown = (table, name, digits, low, high) => numbers.map((index) => {
    const row = table.get(index);
    return { value: row?.[name] ?? null, low: row?.[low] ?? null, high: row?.[high] ?? null, digits };
  });
  const skill = (test) => numbers.map((index) => {
    const own = (skillsOf.get(index) ?? []).find((one) => one.test === test);
    return { value: own?.points ?? null, low: own?.points_low ?? null, high: own?.points_high ?? null, digits: 0 };
  });
  const both = tables.matchups.find((row) => row.entrant === numbers[0] && row.opponent === numbers[1]);
  const objectives = [...new Set(tables.objectives.map((row) => row.objective))];
  const groups = [
    [met ? MEETINGS : null, [
      { label: "Rank", two: shown(rankingOf, "rank", 0), written: rankWritten },
      { label: POINTS_HEAD, two: shown(rankingOf, POINTS[0], RANK_DIGITS, POINTS[1], POINTS[2]), goal: "max", sure: both && [both.difference_low, both.difference_high] },
      touches && { label: "Contacts per km", two: shown(rankingOf, "contacts_per_km", 2, "contacts_low", "contacts_high"), goal: "min" },
      blames && { label: "At fault per km", two: shown(rankingOf, "at_fault_per_km", 2, "at_fault_low", "at_fault_high"), goal: "min" },
      { label: "Faults", two: shown(rankingOf, "faults", 0), goal: "min" },
    ]],
    ["n-athlon", [
      { label: "Rank", two: shown(batteryOf, "rank", 0), written: batteryRank },
      { label: "Sum", two: shown(batteryOf, "points", 0, "points_low", "points_high"), goal: "max", apart: true },
      ...tests.map((test) => ({ label: plain(test), title: asked(test), two: skill(test), goal: "max", apart: true })),
    ]],
    ["Pareto filter", objectives.map((name) => ({
      label: `${objectiveTitle(name)} ${measuredIn(name)}`, goal: objectiveUnit.get(name).goal,
      two: numbers.map((index) => ({ value: objectiveValue(index, name), low: null, high: null, digits: 3 })),
    }))],
  ];
  return [
    h("h1", {}, `${two[0].name} and ${two[1].name}`),
    both
      ? h("p", { class: "why" }, `Against each other: ${signed(both.difference)} points ${EACH} for ${two[0].name} (${signed(both.difference_low)} to ${signed(both.difference_high)}) in ${count(both.pairs, "unit")}. `, link(to("matchup", [first, second]), `Their ${EPISODES}`))
      : note(`They did not meet in the ${MEETINGS.toLowerCase()}.`),
    scroll("Side by side", h("table", { class: "sides" },
      h("thead", {}, h("tr", {}, h("th", { scope: "col", class: "name" }, "Figure"), numbers.map((index) => h("th", { scope: "col", class: "number" }, entrantLink(index))),
        h("th", { scope: "col", class: "number" }, "Difference"), h("th", { scope: "col", class: "text" }, "Better"))),
      groups.map(([stage, rows]) => h("tbody", {},
        stage && h("tr", {}, h("th", { scope: "rowgroup", class: "name stage", colspan: 5 }, stage)),
        rows.filter(Boolean).map((row) => sideBySide(row, two.map((one) => one.name))))))),
    note(`Intervals of differences: ${percent(summary.confidence)}\u00a0%, of one figure alone. Points and contacts of the ${MEETINGS.toLowerCase()} rest on the same ${EPISODES}: their differences have no interval of their own. Nothing is proven where there is none.`),
    numbers.every((index) => skillsOf.has(index)) && section("Their n-athlon", profile(numbers)),
  ];
}

// Of two estimates that know nothing of each other: Zou and Donner's interval of their difference.
const apartBy = (a, b) => (a.low === null || b.low === null ? [null, null] : [
  a.value - b.value - Math.hypot(a.value - a.low, b.high - b.value), a.value - b.value + Math.hypot(a.high - a.value, b.value - b.low)]);

// A figure of two entrants, what they differ by, and who is better; `goal` is "max" or "min", `apart` where the two are independent,
// and `sure` what their difference lies within where something else tells it.
function sideBySide({ label, title, two: [a, b], written = null, goal = null, apart = false, sure = null }, names) {
  const known = a.value !== null && b.value !== null;
  const difference = known ? a.value - b.value : null;
  const [low, high] = known && apart ? apartBy(a, b) : [null, null];
  const [least, most] = sure ?? [low, high];
  const overlap = least === null && a.low !== null && b.low !== null && a.low <= b.high && b.low <= a.high;
  const first = goal === "min" ? difference < 0 : difference > 0;
  const told = !goal || !known ? "" : difference === 0 ? "alike" : overlap || (least !== null && least <= 0 && most >= 0) ? "not told apart" : names[first ? 0 : 1];
  return h("tr", {}, h("th", { scope: "row", class: "name", title }, label),
    [a, b].map(({ value, low: least, high: most, digits }) => h("td", { class: "number" }, h("strong", {}, written ? written(value) : number(value, digits)), " ", interval(least, most, digits))),
    h("td", { class: "number" }, written || !known ? ABSENT : [signed(difference, a.digits), " ", interval(low, high, a.digits)]),
    h("td", { class: "text" }, told));
}
