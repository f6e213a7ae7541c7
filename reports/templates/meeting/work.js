// Who runs matches, what waits, and what nights came to.

import { ABSENT, number } from "../numbers.js";
import { h } from "../race/element.js";
import { absent, chip, empty, head, note, scroll, when } from "./figures.js";

const STAGES = { pareto: "filter", battery: "n-athlon", tournament: "round robin" };
const SHOWN_NIGHTS = 60; // of the last, in the chart
const rows = (columns, found, cells) => h("table", {}, head(columns), h("tbody", {}, found.map((one) => h("tr", {}, cells(one)))));
const cell = (text, kind) => h("td", { class: kind }, text);

// Both views say on the page itself what could not be had.
const asking = (node, get, show) => async () => {
  try {
    node.replaceChildren(...show(await get()).filter(Boolean));
  } catch (error) {
    node.replaceChildren(empty(`This cannot be shown now. ${error}`));
  }
};

export function workView(ask, speak) {
  const node = h("div", {});
  const renew = asking(node, () => ask("work"), (state) => {
    const steer = (changed) => () => {
      speak({ type: "steer", ...changed });
      setTimeout(renew, 300);
    };
    const at = state.under_way;
    const share = at?.total ? ` ${number(at.done)} of ${number(at.total)} matches` : "";
    return [
      h("h2", {}, "Work"),
      h("p", { class: "state" }, at ? [`${at.name}: ${at.stage ? `${STAGES[at.stage] ?? at.stage},${share}` : "begins"}`, at.ends_at && [". Verdict expected at ", when(at.ends_at)]] : "No run is under way."),
      h("p", { class: "buttons" }, h("button", { type: "button", onclick: steer({ paused: !state.paused }) }, state.paused ? "Resume" : "Pause"),
        state.paused ? chip("alarm", `paused by ${state.by}`) : note("Paused, matches under way end and no machine begins another.")),
      h("h3", {}, "Workers"),
      state.workers.length ? scroll("Workers", rows([["Host"], ["Process", "number"], ["Processes", "number"], ["Matches a minute", "number"], ["Last seen"]], state.workers, (one) => [
        h("th", { scope: "row" }, one.host), cell(String(one.process), "number"), cell(number(one.processes), "number"), cell(number(one.matches_per_minute, 1), "number"), cell(one.seen_at ? when(one.seen_at) : ABSENT)])) : empty("Nobody is at work."),
      h("h3", {}, "Queue"),
      state.queue.length ? scroll("Queue", rows([["Scenario"], ["Circuit"], ["Car"], ["World"], ["Matches", "number"], ["Order"]], state.queue, (one) => [
        h("th", { scope: "row" }, one.scenario || one.surroundings.slice(0, 12)), cell(one.circuit), cell(one.car), cell(one.world), cell(number(one.matches), "number"),
        h("td", {}, one.first ? h("button", { type: "button", onclick: steer({ first: null }) }, "as they came") : h("button", { type: "button", onclick: steer({ first: one.surroundings }) }, "first"))])) : empty("Nothing waits."),
    ];
  });
  return { node, renew };
}

export function historyView(ask) {
  const found = h("div", { "aria-live": "polite" });
  const nights = h("div", {});
  const search = h("input", { type: "search", maxlength: 500, "aria-label": "Search all checkpoints", placeholder: "Name, path or digest" });
  const look = asking(found, () => (search.value.trim() ? ask(`checkpoints?${new URLSearchParams({ search: search.value.trim() })}`) : []), (list) => [
    list.length > 0 ? scroll("Checkpoints", rows([["Checkpoint"], ["Run"], ["Came to"], ["Points", "number"], ["Path"]], list, (one) => [
      h("th", { scope: "row" }, one.name), cell(one.run), cell(reached(one)), h("td", { class: "number" }, number(one.points_per_race, 1), h("small", {}, between(one.points_low, one.points_high))), cell(one.source)])) : search.value.trim() && empty("No checkpoint was ever judged whose name, path or digest has this."),
  ]);
  const renew = asking(nights, () => ask("nights"), (list) => [
    chart(list.slice(0, SHOWN_NIGHTS).reverse()),
    list.length ? scroll("Nights", rows([["Night"], ["Began"], ["Sent"], ["Points", "number"], ["Faults", "number"], ["Void", "number"], ["Outcome"]], list, (night) => [
      h("th", { scope: "row" }, night.name), cell(when(night.began_at)), cell(night.sent.map((one) => one.name).join(", ") || ABSENT),
      h("td", { class: "number" }, number(night.sent[0]?.points, 1), h("small", {}, between(night.sent[0]?.low, night.sent[0]?.high))),
      cell(number(night.faults), "number"), cell(number(night.void), "number"), cell(night.reason || night.status)])) : empty("There was no night yet."),
  ]);
  const form = h("form", { role: "search", onsubmit: (event) => { event.preventDefault(); look(); } }, search, " ", h("button", {}, "Search"));
  return { node: h("div", {}, h("h2", {}, "History"), h("h3", {}, "Checkpoints"), form, found, h("h3", {}, "Nights"), nights), renew };
}

const between = (low, high) => (absent(low) || absent(high) ? "" : `${number(low, 1)} to ${number(high, 1)}`);
const reached = (one) => (one.rank ? `round robin, rank ${one.rank}` : !absent(one.skill) ? `n-athlon, ${number(one.skill)} points` : one.survives === false ? "left out by the filter" : "filter");

// Points of whom each night sent, with their intervals.
function chart(nights) {
  const known = nights.flatMap((night, at) => (absent(night.sent[0]?.points) ? [] : [{ at, night: night.name, ...night.sent[0] }]));
  if (known.length < 2) return null;
  const [width, height, edge] = [640, 180, 34];
  const ends = known.flatMap(({ points, low, high }) => [points, low ?? points, high ?? points]);
  const [least, most] = [Math.min(...ends), Math.max(...ends)];
  const x = (at) => edge + ((width - 2 * edge) * at) / Math.max(1, nights.length - 1);
  const y = (value) => height - 22 - ((height - 34) * (value - least)) / (most - least || 1);
  const label = (value) => h("svg:text", { x: 2, y: y(value) + 4, class: "tick" }, number(value, 1));
  return h("svg:svg", { viewBox: `0 0 ${width} ${height}`, class: "points", role: "img", "aria-label": "Points of whom each night sent" },
    label(least), most > least && label(most),
    known.map((one) => !absent(one.low) && !absent(one.high) && h("svg:line", { x1: x(one.at), x2: x(one.at), y1: y(one.low), y2: y(one.high), class: "interval" })),
    h("svg:polyline", { points: known.map((one) => `${x(one.at)},${y(one.points)}`).join(" "), class: "line" }),
    known.map((one) => h("svg:circle", { cx: x(one.at), cy: y(one.points), r: 3.5 }, h("svg:title", {}, `${one.night}: ${one.name}, ${number(one.points, 1)} (${between(one.low, one.high)})`))),
    h("svg:text", { x: x(known[0].at), y: height - 4, class: "tick" }, known[0].night), h("svg:text", { x: x(known.at(-1).at), y: height - 4, class: "tick last" }, known.at(-1).night));
}
