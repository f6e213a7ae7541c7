// Everybody against everybody, and the races of one matchup.

import { ABSENT, capital, count, number, signed } from "../numbers.js";
import { h } from "../race/element.js";
import { BOTH, shade, shadeKey } from "./charts.js";
import { blames, carsOf, EACH, entrantByKey, entrants, EPISODE, EPISODES, IN_MEETINGS, nameOf, POINT_DIGITS, racesOf, sum, tables, touches, UNIT } from "./data.js";
import { choose, empty, entrantLink, here, link, missing, note, raceHref, scroll, to, units } from "./dom.js";
import { d3 } from "./libraries.js";
import { dataTable } from "./table.js";

export function matchups() {
  const title = h("h1", {}, "Matchups");
  const cells = new Map(tables.matchups.filter((row) => row.difference !== null).map((row) => [`${row.entrant} ${row.opponent}`, row]));
  if (!cells.size) return [title, empty("No two entrants met.")];
  const order = [...tables.ranking].sort((a, b) => (a.rank ?? Infinity) - (b.rank ?? Infinity) || b.points_per_race - a.points_per_race).map((row) => row.entrant);
  const contacts = touches && here().params.get("of") === "contacts";
  const value = (row) => (contacts ? row.contacts_per_km : row.difference);
  const largest = d3.max(cells.values(), (row) => Math.abs(value(row) ?? 0)) ?? 0;
  const radio = (of, text) => h("label", {}, h("input", { type: "radio", name: "of", checked: contacts === (of === "contacts"), onchange: () => choose("of", of) }), ` ${text} `);
  const drawn = (row) => {
    const [from, against] = [entrants[row.entrant], entrants[row.opponent]];
    const decided = !contacts && (row.difference_low > 0 || row.difference_high < 0);
    const about = `${from.name} against ${against.name}: ${signed(row.difference)} points ${EACH} (${signed(row.difference_low)} to ${signed(row.difference_high)}), ${touches ? `${number(row.contacts_per_km, 2)} contacts per km, ` : ""}${count(row.pairs, "unit")}`;
    const shown = contacts ? number(row.contacts_per_km, 2) : signed(row.difference);
    return h("td", { class: `cell ${contacts ? shade(-value(row), largest) : shade(value(row), largest)}${decided ? " decided" : ""}` },
      h("a", { href: to("matchup", [from.key, against.key]), title: about }, shown));
  };
  return [
    title,
    touches && h("fieldset", { class: "controls" }, h("legend", { class: "unseen" }, "What is shown"), radio("", "Points"), radio("contacts", "Contacts")),
    contacts
      ? note(`Contacts per km of the row's cars when racing the column, ${IN_MEETINGS}.`, shadeKey(["h0", "n1", "n2", "n3", "n4", "n5"], "0", number(largest, 2)))
      : note(`Points ${EACH} ${IN_MEETINGS}, row minus column. Bold: the interval excludes zero. Ranks rest on all opponents, and are corrected for the number of comparisons, so they may tell two apart that no cell does. A click opens the ${EPISODES}. ${UNIT}`, shadeKey(BOTH, signed(-largest), signed(largest))),
    scroll("Matchups", h("table", { class: "matrix", id: "matchups" },
      h("thead", {}, h("tr", {}, h("td"), order.map((index) => h("th", { scope: "col" }, h("span", { title: nameOf(index) }, nameOf(index)))))),
      h("tbody", {}, order.map((row) => h("tr", {}, h("th", { scope: "row", class: "name" }, entrantLink(row)),
        order.map((column) => {
          if (row === column) return h("td", { class: "self" });
          const cell = cells.get(`${row} ${column}`);
          return cell && value(cell) !== null ? drawn(cell) : h("td", { class: "unmet", title: "did not meet" }, ABSENT);
        })))))),
  ];
}

export function matchup([first, second]) {
  const two = [first, second].map((key) => entrantByKey.get(key)).filter((one) => one !== undefined);
  if (two.length < 2) return missing("entrant");
  const [a, b] = two.map((one) => one.number);
  const both = tables.matchups.find((row) => row.entrant === a && row.opponent === b);
  const other = tables.matchups.find((row) => row.entrant === b && row.opponent === a);
  const theirs = racesOf(a).filter((race) => race.stage === "tournament" && racesOf(b).includes(race)).map((race) => {
    const cars = carsOf(race);
    const of = (index, name) => sum(cars.filter((car) => car.entrant === index).map((car) => car[name]));
    return { race, seed: race.seed, points: of(a, "points"), against: of(b, "points"), contacts: of(a, "contacts"), touched: of(b, "contacts"), blame: of(a, "contacts_at_fault"), theirs: of(b, "contacts_at_fault") };
  });
  return [
    h("h1", {}, `${two[0].name} against ${two[1].name}`),
    both && h("p", { class: "why" }, `${signed(both.difference)} points ${EACH} for ${two[0].name} (${signed(both.difference_low)} to ${signed(both.difference_high)}) in `, units(both.pairs), `. ${touches ? `Contacts per km there: ${number(both.contacts_per_km, 2)} and ${number(other?.contacts_per_km, 2)}. ` : ""}`, link(to("compare", [first, second]), "Side by side")),
    both && note(`${capital(IN_MEETINGS)}. ${UNIT}`),
    theirs.length ? dataTable("races", [
      { key: "race", head: capital(EPISODE), kind: "name", first: "ascending", value: (row) => row.race.number, cell: (row) => link(raceHref(row.race), `${row.race.test} ${row.race.key.slice(0, 6)}/${row.race.race}`) },
      { key: "seed", head: "Seed", value: (row) => row.seed },
      { key: "mirrored", head: "Mirrored", value: (row) => row.race.mirrored, cell: (row) => (row.race.mirrored ? "yes" : "no") },
      { key: "points", head: `Points ${two[0].name}`, value: (row) => row.points, cell: (row) => number(row.points, POINT_DIGITS) },
      { key: "against", head: `Points ${two[1].name}`, value: (row) => row.against, cell: (row) => number(row.against, POINT_DIGITS) },
      { key: "difference", head: "Difference", value: (row) => row.points - row.against, cell: (row) => h("strong", {}, signed(row.points - row.against, POINT_DIGITS)) },
      touches && { key: "contacts", head: "Contacts, each", title: `of the cars of ${two[0].name} and of ${two[1].name}: one between two cars counts for both`, value: (row) => row.contacts, cell: (row) => `${number(row.contacts)} : ${number(row.touched)}` },
      blames && { key: "blame", head: "At fault, each", value: (row) => row.blame, cell: (row) => `${number(row.blame)} : ${number(row.theirs)}` },
    ], theirs, { sort: "race", label: `${capital(EPISODES)} of the matchup` }) : empty("They did not meet."),
  ];
}
