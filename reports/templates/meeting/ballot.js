// What a member says of a question: a ballot, or which of two is preferred.

import { h } from "../race/element.js";
import { head, note } from "./figures.js";

// The candidates' names by id, in the order of the evidence.
export const candidatesOf = (decision) => decision.evidence.rows.map(({ entrant, name }) => [entrant, name]);

// A form for a ballot; `take` fills in the member's ballot, once: it may be from elsewhere.
export function ballotForm(decision, longest, say) {
  const candidates = candidatesOf(decision);
  /** @type {string | null} */
  let taken = null;
  const rows = candidates.map(([entrant, name]) => {
    const fit = h("input", { type: "checkbox", "aria-label": `${name} is fit` });
    const place = h("input", { type: "number", min: 1, max: candidates.length, step: 1, "aria-label": `Place of ${name}` });
    // Whom one ranks one mostly approves.
    place.addEventListener("input", () => { if (place.value) fit.checked = true; });
    return { entrant, name, fit, place };
  });
  const reason = h("input", { type: "text", required: true, maxlength: longest });
  const refused = h("p", { class: "note", role: "alert" });
  const form = h("form", { class: "ballot" },
    h("h3", {}, "Your ballot"),
    note("Tick those that are fit to go on. Number them, the best 1; you need not number all."),
    h("table", {}, head([["Entrant"], ["Fit"], ["Place"]]),
      h("tbody", {}, rows.map(({ name, fit, place }) => h("tr", {}, h("th", { scope: "row" }, name), h("td", {}, fit), h("td", {}, place))))),
    h("label", { class: "field" }, h("span", {}, "Why, in a sentence"), reason),
    refused,
    h("div", { class: "buttons" }, h("button", { class: "first" }, "Cast my ballot"), h("span", { class: "note" }, "It replaces what you said before.")));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const ranked = rows.filter(({ place }) => place.value).sort((a, b) => Number(a.place.value) - Number(b.place.value));
    const twice = ranked.find(({ place }, i) => i && place.value === ranked[i - 1].place.value);
    refused.textContent = twice ? `Two have place ${twice.place.value}.` : "";
    if (twice) return;
    say({
      type: "vote", question: decision.question, decision: decision.decision,
      approve: rows.filter(({ fit }) => fit.checked).map(({ entrant }) => entrant),
      rank: ranked.map(({ entrant }) => entrant), reason: reason.value,
    });
  });
  return {
    node: form,
    take(ballot) {
      if (!ballot || ballot.id === taken) return;
      taken = ballot.id;
      for (const { entrant, fit, place } of rows) {
        fit.checked = ballot.approve.includes(entrant);
        place.value = ballot.rank.includes(entrant) ? String(ballot.rank.indexOf(entrant) + 1) : "";
      }
      reason.value = ballot.reason;
    },
  };
}

export function comparisonForm(decision, longest, say) {
  const choose = () => h("select", { required: true }, h("option", { value: "" }, ""), candidatesOf(decision).map(([value, name]) => h("option", { value }, name)));
  const [better, worse] = [choose(), choose()];
  const field = (label, control) => h("label", { class: "field" }, h("span", {}, label), control);
  const reason = h("input", { type: "text", required: true, maxlength: longest });
  const form = h("form", {}, field("I prefer", better), field("to", worse), field("Why, in a sentence", reason),
    h("div", { class: "buttons" }, h("button", {}, "Say so")));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    say({ type: "compare", question: decision.question, decision: decision.decision, better: better.value, worse: worse.value, reason: reason.value });
    folded.open = false;
  });
  const folded = h("details", {}, h("summary", {}, "Say only which of two you prefer"), form);
  return folded;
}

export function reopenForm(decision, longest, say) {
  const reason = h("input", { type: "text", required: true, maxlength: longest });
  const form = h("form", {},
    h("label", { class: "field" }, h("span", {}, "Why, in a sentence"), reason),
    h("div", { class: "buttons" }, h("button", {}, "Ask again")));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    say({ type: "reopen", question: decision.question, decision: decision.decision, reason: reason.value });
    folded.open = false;
  });
  const folded = h("details", {}, h("summary", {}, "Put the question again"), form);
  return folded;
}
