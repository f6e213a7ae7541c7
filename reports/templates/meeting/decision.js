// A question to the committee: what members are shown, what they have said, and what follows.

import { clock, count, number } from "../numbers.js";
import { h, shown } from "../race/element.js";
import { rankText } from "../rank.js";
import { ballotForm, candidatesOf, comparisonForm, reopenForm } from "./ballot.js";
import { absent, chip, elsewhere, empty, fileOf, head, list, note, percent, scroll, when } from "./figures.js";

const ASKED_FOR = { shortlist: "Who is shortlisted?", selection: "Who is sent?" };
/** Where the figures come from that a question is answered by. */
const FIGURES = { shortlist: "Figures: of the n-athlon.", selection: "Figures: of the round robin." };
/** @type {[string, (one: any, digits: number) => import("../race/element.js").Child][]} */
const EVIDENCE = [
  ["Rank", rankText],
  ["Points", (one, digits) => [number(one.points, digits), absent(one.low) ? null : h("small", {}, `${number(one.low, digits)} to ${number(one.high, digits)}`)]],
  ["Contacts per km", (one) => number(one.contacts_per_km, 2)],
  ["At fault per km", (one) => number(one.at_fault_per_km, 2)],
  ["Off course", (one) => percent(one.off_course_share, 1)],
  ["Faults", (one) => number(one.faults)],
];

// A question's part of the page: `show` brings it up to date and leaves forms as they are.
export function questionView(first, you, longest, say) {
  const [state, people, standings, said, drives] = [h("p", { class: "state" }), h("ul", { class: "people" }), h("div", {}), h("div", {}), h("div", {})];
  const close = h("button", { type: "button", class: "first", onclick: () => say({ type: "decide", question: first.question, decision: first.decision }) }, "Decide");
  const waits = h("span", { class: "note" });
  const ballot = ballotForm(first, longest, say);
  const member = first.members.includes(you);
  const speak = h("div", {}, member ? [ballot.node, comparisonForm(first, longest, say)] : note("You are not on this committee: you can read, but not vote, decide or ask again."));
  const again = reopenForm(first, longest, say);
  const closing = h("div", { class: "buttons" }, close, waits);
  const node = h("section", { class: "question" },
    h("h2", {}, ASKED_FOR[first.question]), state, standings,
    h("div", { class: "halves" }, h("div", {}, h("h3", {}, "The committee"), people, closing, again, said), h("div", {}, drives, speak)));

  function show(decision, room) {
    const ballots = new Map(decision.said.filter(({ event }) => event === "voted").map((one) => [one.member, one]));
    const spoke = new Set(decision.said.map(({ member }) => member));
    state.replaceChildren(decision.open
      ? [count(decision.seats, "seat"), decision.waits_for ? `waits for ${count(decision.waits_for, "more member")}` : "can be decided"].join(" · ")
      : `${count(decision.seats, "seat")} · decided. A run that has waited for it goes on with the command that began it.`);
    people.replaceChildren(...(decision.members.length ? [] : [h("li", {}, "Nobody but its rules.")]), ...decision.members.map((member) => h("li", {}, member, spoke.has(member) ? chip("good", "has voted") : chip("", "not yet"))));
    standings.replaceChildren(note(FIGURES[decision.question]), standingsTable(decision));
    closing.hidden = !decision.open || !member;
    close.disabled = decision.waits_for > 0;
    waits.textContent = decision.waits_for ? `${count(decision.quorum, "member")} must have voted.` : "Closes the question by what has been said.";
    again.hidden = decision.open || !member;
    speak.hidden = !decision.open && member;
    ballot.take(ballots.get(you));
    drives.replaceChildren(...shown([decision.question === "selection" && decision.open && member && !ballots.has(you) && driveCard(room)]));
    said.replaceChildren(...shown([saidView(decision), drivesView(decision, room)]));
  }
  return { node, show };
}

function standingsTable(decision) {
  const evidence = new Map(decision.evidence.rows.map((row) => [row.entrant, row]));
  const chosen = decision.question === "selection" ? "sent" : "shortlisted";
  const digits = decision.question === "selection" ? 1 : 0; // of points: those of the n-athlon are thousands
  return scroll(`Standings: ${ASKED_FOR[decision.question]}`, h("table", {},
    head([["Entrant"], ...EVIDENCE.map(([text]) => [text, "number"]), ["Approved by", "number"], ["Favour", "number"]]),
    h("tbody", {}, decision.standings.map((one) => {
      const row = evidence.get(one.entrant);
      return h("tr", { class: one.chosen && "chosen" },
        h("th", { scope: "row" }, one.name, one.chosen && chip("good", decision.open ? `would be ${chosen}` : chosen), !one.fit && chip("", "not fit"), row.barred && chip("alarm", "barred")),
        EVIDENCE.map(([, cell]) => h("td", { class: "number" }, cell(row, digits))),
        h("td", { class: "number" }, `${one.approved_by} of ${decision.ballots}`), h("td", { class: "number" }, percent(one.favour)));
    }))));
}

const reasonLines = (reason) => h("blockquote", {}, reason.split("; ").map((part) => h("p", {}, part)));

function saidView(decision) {
  const names = new Map(candidatesOf(decision));
  const called = (ids) => list(ids.map((entrant) => names.get(entrant)));
  const late = new Set(decision.late);
  return [
    h("h3", {}, "What was said"),
    decision.said.length ? h("ol", { class: "said" }, decision.said.map((one) => h("li", {},
      h("p", {}, h("strong", {}, one.member), when(one.at), late.has(one.id) && chip("alarm", "too late, not counted")),
      one.event === "voted"
        ? h("p", {}, "Approves ", called(one.approve), one.rank.length > 0 && [". Order: ", one.rank.map((entrant) => names.get(entrant)).join(" > ")], ".")
        : h("p", {}, "Prefers ", names.get(one.better), " to ", names.get(one.worse), "."),
      reasonLines(one.reason)))) : empty("Nothing yet."),
    !absent(decision.agreement) && note(`Agreement ${number(decision.agreement, 2)}: 1 where all order alike, −1 where two order the other way round.`),
  ];
}

const QUESTIONNAIRE = [["again", "race again"], ["fair", "fair"], ["room", "left room"], ["beatable", "beatable"]];

// Blind test drives of those who have voted, with the moments that they marked.
function drivesView(decision, room) {
  if (!decision.drives.length) return [];
  const names = new Map(candidatesOf(decision));
  const at = (drive, moment) => `${fileOf(room, `../watch/${drive.recording}`)}.html#${new URLSearchParams({ at: Math.max(0, moment.time_s - 4).toFixed(1) })}`;
  return [
    h("h3", {}, "Blind test drives"),
    h("ol", { class: "said" }, decision.drives.map((drive) => h("li", {},
      h("p", {}, h("strong", {}, drive.member), when(drive.at), " ", elsewhere(`${fileOf(room, `../watch/${drive.recording}`)}.html`, "watch the race")),
      drive.answers.map((answer) => h("p", {}, `${names.get(answer.entrant)} (${answer.letter})`, drive.better === answer.entrant && chip("good", "preferred"), ": ",
        QUESTIONNAIRE.map(([key, text]) => `${text} ${answer[key]}`).join(", "), " of 5")),
      drive.text && h("blockquote", {}, drive.text),
      drive.moments.length > 0 && h("ul", { class: "moments" }, drive.moments.map((moment) => h("li", {},
        elsewhere(at(drive, moment), clock(moment.time_s)), moment.nearest && ` near ${names.get(moment.nearest)}`)))))),
  ];
}

function driveCard(room) {
  return h("div", { class: "card" },
    h("h3", {}, "Drive against them first"),
    room.drive
      ? [note("The finalists stand under letters, and your ballot follows from your answers. Who has voted cannot drive blind."), h("div", { class: "buttons" }, h("a", { href: room.drive }, "Begin a blind test drive"))]
      : note("The server has no folder of this run, or it is no race of nathlon's own world, so there are no test drives here."));
}
