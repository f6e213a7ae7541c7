// What the committee was asked, what its members said, and what followed.

import { count, number, percent } from "../numbers.js";
import { h } from "../race/element.js";
import { rankText } from "../rank.js";
import { blames, decisions, entrantOf, measured, MEETINGS, met, touches } from "./data.js";
import { chip, empty, entrantLink, facts, note, scroll, section, time } from "./dom.js";

/** @type {Record<string, string>} */
export const QUESTIONS = { shortlist: met ? `Who goes on to the ${MEETINGS.toLowerCase()}?` : "Who is shortlisted?", selection: "Who is sent?" };

/** Where the figures come from that a question is answered by. */
const FIGURES = { shortlist: "Figures: of the n-athlon.", selection: met ? `Figures: of the ${MEETINGS.toLowerCase()}.` : "Figures: of the n-athlon." };

// What members are shown of a candidate, as far as the world measures it.
/** @type {[string, (one: any, digits: number) => string][]} */
const SHOWN = /** @type {any[]} */ ([
  ["Rank", rankText],
  ["Points", (one, digits) => number(one.points, digits)],
  touches && ["Contacts per km", (one) => number(one.contacts_per_km, 2)],
  touches && blames && ["At fault per km", (one) => number(one.at_fault_per_km, 2)],
  measured("off_course_s") && ["Off course, %", (one) => percent(one.off_course_share, 1)],
  ["Faults", (one) => number(one.faults)],
]).filter(Boolean);

export function committee() {
  return [
    h("h1", {}, "Committee"),
    note("Fit: approved on at least half of the ballots. Schulze's method orders those who are fit; favour breaks ties. Members named “rule:…” are automatic."),
    decisions.length ? decisions.map(decisionView) : empty("No question was put to the committee."),
  ];
}

function decisionView(decision) {
  /** @param {string} entrant */
  const named = (entrant) => {
    const card = entrantOf.get(entrant);
    return card ? entrantLink(card.number) : entrant.slice(0, 12);
  };
  const list = (ids) => (ids.length ? ids.map((entrant, i) => [i > 0 && ", ", named(entrant)]) : "nobody");
  const row = new Map(decision.evidence.rows.map((one) => [one.entrant, one]));
  const late = new Set(decision.late);
  const digits = met && decision.question === "selection" ? 1 : 0; // of points: those of the n-athlon are thousands
  const state = decision.open ? (decision.waits_for ? `open, waits for ${count(decision.waits_for, "member")}` : "open, asked again") : "decided";
  return section(QUESTIONS[decision.question],
    facts([
      ["State", state], ["Ballots", number(decision.ballots)], ["Seats", number(decision.seats)],
      ["Agreement", number(decision.agreement, 2), "1: all rankings are the same; −1: two rankings are opposite"],
    ]),
    note(FIGURES[decision.question]),
    decision.standings.length ? scroll("Standings", h("table", { class: "standings" },
      h("thead", {}, h("tr", {}, ["Entrant", "Approved by", "Fit", "Favour, %", ...SHOWN.map(([head]) => head)].map((head, i) => h("th", { scope: "col", class: i ? "number" : "name" }, head)))),
      h("tbody", {}, decision.standings.map((standing) => {
        const shown = row.get(standing.entrant);
        return h("tr", { class: standing.chosen ? "chosen" : null },
          h("th", { scope: "row", class: "name" }, named(standing.entrant), " ", standing.chosen && chip("sent", decision.question === "selection" ? "sent" : "chosen"), shown?.barred ? chip("barred", "barred") : null),
          [`${standing.approved_by} of ${decision.ballots}`, standing.fit ? "yes" : "no", percent(standing.favour), ...SHOWN.map(([, cell]) => cell(shown, digits))].map((text) => h("td", { class: "number" }, text)));
      })))) : empty("There were no candidates."),
    h("ol", { class: "ballots" }, decision.said.map((said) => h("li", {},
      h("p", {}, h("strong", {}, said.member), " ", h("span", { class: "interval" }, time(said.at)), late.has(said.id) && chip("barred", "too late, not counted")),
      h("blockquote", {}, said.reason.split("; ").map((part, i) => [i > 0 && h("br"), part])),
      said.event === "voted"
        ? [h("p", {}, "Approves ", list(said.approve), "."), h("p", {}, "Ranks ", list(said.rank), ".")]
        : h("p", {}, "Prefers ", named(said.better), " to ", named(said.worse), ".")))),
    drivesView(decision.drives ?? [], named),
  );
}

const ASKED = [["again", "Race it again"], ["fair", "Fair in contact"], ["room", "Left room"], ["beatable", "Beatable"]];

// Blind test drives: what the members answered after each.
function drivesView(drives, named) {
  if (!drives.length) return null;
  const near = ({ time_s: at, nearest }) => [`${at.toFixed(1)} s`, nearest && [" near ", named(nearest)]];
  return [
    h("h3", {}, "Blind test drives"),
    note("Members raced the finalists under letters. Scores go from 1, not at all, to 5, very much."),
    scroll("Blind test drives", h("table", { class: "standings" },
      h("thead", {}, h("tr", {}, ["Raced", ...ASKED.map(([, head]) => head), "By"].map((head, i) => h("th", { scope: "col", class: i > 0 && i < 5 ? "number" : "name" }, head)))),
      h("tbody", {}, drives.flatMap((drive) => drive.answers.map((answer) => h("tr", {},
        h("th", { scope: "row", class: "name" }, `${answer.letter}: `, named(answer.entrant)),
        ASKED.map(([name]) => h("td", { class: "number" }, String(answer[name]))),
        h("td", { class: "name" }, drive.member, drive.better === answer.entrant && [" ", chip("", "preferred")]))))))),
    h("ol", { class: "ballots" }, drives.map((drive) => h("li", {},
      h("p", {}, h("strong", {}, drive.member), " ", h("span", { class: "interval" }, time(drive.at)), " ", h("a", { href: `../${encodeURI(drive.recording)}` }, "recording")),
      drive.text && h("blockquote", {}, drive.text),
      drive.moments.length > 0 && h("p", {}, "Marked ", drive.moments.map((moment, i) => [i > 0 && ", ", near(moment)]), ".")))),
  ];
}
