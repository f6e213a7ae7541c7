// The n-athlon: entrants and tests, coloured by points; the profiles of some beside each other.

import { ABSENT, count, number, percent } from "../numbers.js";
import { h } from "../race/element.js";
import { BLUES, LINES, measuredAs, profile, shade, shadeKey } from "./charts.js";
import { data, entrantByKey, entrants, groups, nameOf, onCircuit, rowsOf, sent, skillsOf, summary, tables, tests } from "./data.js";
import { chip, empty, entrantLink, here, interval, keep, note, plain, scroll, section } from "./dom.js";
import { d3 } from "./libraries.js";
import { stretches } from "./stretches.js";
import { dataTable, entrantColumn, rankColumn, RANKS } from "./table.js";

export function nAthlon() {
  const title = h("h1", {}, "n-athlon");
  const rows = tables.battery.map((row) => ({ ...row, skills: new Map((skillsOf.get(row.entrant) ?? []).map((skill) => [skill.test, skill])) }));
  if (!rows.length) return [title, empty("No entrant has been through the n-athlon.")];
  const largest = d3.max(tables.skills, (skill) => skill.points) ?? 0;
  const shaded = (row, test) => {
    const skill = row.skills.get(test);
    if (!skill) return h("td", { class: "unmet" }, ABSENT);
    const about = `${nameOf(row.entrant)}, ${plain(test)}: ${number(skill.points)} points (${number(skill.points_low)} to ${number(skill.points_high)}), ${measuredAs(skill)}`;
    return h("td", { class: `cell ${shade(skill.points, largest)}`, title: about }, number(skill.points));
  };
  const lines = h("div");
  const draw = () => lines.replaceChildren(...profile(profiled(rows)));
  draw();
  const box = (row) => h("input", {
    type: "checkbox", "aria-label": `Profile of ${nameOf(row.entrant)}`, checked: profiled(rows).includes(row.entrant),
    onchange: (event) => {
      const others = profiled(rows).filter((one) => one !== row.entrant);
      const next = event.target.checked ? [...others, row.entrant].slice(-LINES.length) : others;
      keep("show", next.map((one) => entrants[one].key).join(",") || "none");
      for (const other of /** @type {NodeListOf<HTMLInputElement>} */ (document.querySelectorAll(".pick input"))) other.checked = next.some((one) => other.getAttribute("aria-label") === `Profile of ${nameOf(one)}`);
      draw();
    },
  });
  return [
    title,
    note(`500 points: ${onCircuit ? "the built-in driver's" : "the baseline's"} mark. 1,000: a mark that is better by what the test asks for. Between them points follow a power curve, not a straight line. ${RANKS}`, shadeKey(BLUES, "0", number(largest))),
    dataTable("n-athlon", [
      { key: "pick", head: "", unseen: "Profile", kind: "pick", cell: box },
      rankColumn,
      entrantColumn((row) => (row.shortlisted ? chip("", "shortlisted") : null)),
      { key: "sum", head: "Sum", value: (row) => row.points, cell: (row) => [h("strong", {}, number(row.points)), " ", interval(row.points_low, row.points_high, 0)] },
      ...tests.map((test) => ({ key: test, head: plain(test), kind: "test", title: asked(test), value: (row) => row.skills.get(test)?.points ?? null, cell: (row) => shaded(row, test) })),
    ], rows, { sort: "rank", text: (row) => nameOf(row.entrant), grouped: { key: "rank" }, label: "n-athlon" }),
    section("Profiles", note("Up to three, picked in the table. Dashed: 500 and 1,000 points."), lines),
    tables.incidents.length > 0 && section("Incidents", frozen()),
    stretches(),
    section("Marks", marks()),
  ];
}

// Incidents of earlier races: who drives them clean, and how they have gone before.
function frozen() {
  const held = [...groups(tables.incidents, "test")];
  const drivers = [...new Set(tables.incidents.map((row) => row.entrant))];
  const before = groups(rowsOf(data.incidentHistory), "test");
  const cell = (rows, entrant) => {
    const own = rows.find((row) => row.entrant === entrant);
    if (!own) return h("td", { class: "number" }, ABSENT);
    return h("td", { class: "number", title: `needs ${percent(own.needed)} % of the runs` }, own.passed ? h("strong", {}, "passed") : "failed", ` ${own.clean}/${own.runs}`);
  };
  const told = (one) => `${one.run}: ${one.passed} of ${count(one.entrants, "entrant")}${one.sent_passed === null ? "" : `, the one sent ${one.sent_passed ? "passed" : "failed"}`}`;
  return [
    note("The same cars some seconds before an incident of an earlier race. They bring no points."),
    scroll("Incidents", h("table", { id: "frozen" },
      h("thead", {}, h("tr", {}, h("th", { scope: "col", class: "name" }, "Incident"), drivers.map((one) => h("th", { scope: "col", class: "number" }, entrantLink(one))))),
      h("tbody", {}, held.map(([test, rows]) => h("tr", {}, h("th", { scope: "row", class: "name", title: rows[0].happened }, plain(test)), drivers.map((one) => cell(rows, one))))))),
    h("ul", {}, held.map(([test, rows]) => h("li", {}, h("strong", {}, plain(test)), `: ${rows[0].happened}`,
      before.has(test) && h("ul", {}, (before.get(test) ?? []).slice(-10).map((one) => h("li", {}, told(one))))))),
  ];
}

// Who is drawn: those of the address, else who is sent and the first of the others.
function profiled(rows) {
  const asked = here().params.get("show");
  if (asked !== null) return asked.split(",").map((key) => entrantByKey.get(key)?.number ?? -1).filter((index) => skillsOf.has(index)).slice(0, LINES.length);
  const first = [...rows].sort((a, b) => a.rank - b.rank || b.points - a.points).map((row) => row.entrant);
  const chosen = first.filter((index) => sent.has(entrants[index].entrant));
  return [...new Set([...chosen, ...first])].slice(0, 2);
}

// What a test asks, in what it is measured, and which way is better.
const unitOf = new Map(tables.skills.map((skill) => [skill.test, skill.unit]));
const better = ({ base, reference }) => (reference < base ? "less" : "more");
export function asked(test) {
  const mark = summary.marks[test];
  return mark && [mark.asks, `Measured in ${unitOf.get(test) ?? "its own unit"}; ${better(mark)} is better.`].filter(Boolean).join(" ");
}

function marks() {
  const set = Object.entries(summary.marks);
  const asks = set.some(([, mark]) => mark.asks); // runs of earlier versions did not keep it
  const aside = Object.entries(summary.tests_set_aside);
  return [
    set.length ? scroll("Marks", h("table", {},
      h("thead", {}, h("tr", {}, ["Test", "500 points", "1,000 points", "Unit", "Better", asks && "What it asks"].filter(Boolean).map((head, i) => h("th", { scope: "col", class: i === 0 ? "name" : i < 4 ? "number" : "text" }, head)))),
      h("tbody", {}, set.map(([test, mark]) => h("tr", {}, h("th", { scope: "row", class: "name" }, plain(test)), h("td", { class: "number" }, number(mark.base, 3)), h("td", { class: "number" }, number(mark.reference, 3)), h("td", { class: "number" }, unitOf.get(test) ?? ""), h("td", { class: "text" }, better(mark)), asks && h("td", { class: "text" }, mark.asks)))))) : empty("No marks were set."),
    aside.length > 0 && [h("h3", {}, "Tests not held"), h("ul", {}, aside.map(([test, reason]) => h("li", {}, `${plain(test)}: ${reason}`)))],
  ];
}
