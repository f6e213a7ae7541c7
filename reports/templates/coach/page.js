// The page of the coach.

import { all, byId, dataOf } from "../race/element.js";
import { keepMoment, momentOf, racePlayer } from "../race/player.js";
import { openRecording } from "../race/recording.js";
import { lapMap } from "./map.js";
import { lapTraces, valueAt } from "./traces.js";

const PIECE_M = 12;
const BEFORE_S = 2;
const AROUND_M = 60;

async function start() {
  const data = dataOf("data");
  const { own, sections, advice, car } = data;
  const length = own.place.at(-1);
  const recording = await openRecording(data.race, data.circuit);
  const named = new URLSearchParams(location.hash.slice(1));
  const player = racePlayer(recording, { followed: car, now: data.start, scrolls: true, ...(named.has("at") && momentOf(named)) });
  byId("race").append(player.node);
  const timeAt = (place) => data.start + valueAt(own, "time_s", place);
  const placeAt = (seconds) => {
    const since = seconds - data.start;
    const after = own.time_s.findIndex((time) => time >= since);
    if (since < 0 || after < 0) return null;
    if (after === 0) return own.place[0];
    const share = (since - own.time_s[after - 1]) / (own.time_s[after] - own.time_s[after - 1]);
    return own.place[after - 1] + share * (own.place[after] - own.place[after - 1]);
  };
  const traces = lapTraces(byId("traces"), data, (place, pressed) => {
    traces.mark(place);
    here(place);
    if (pressed) player.seek(timeAt(Math.min(place, length)));
  });
  const here = lapMap(byId("map", SVGSVGElement), PIECE_M);
  /** @type {number | null} */
  let until = null;

  /** @param {{ section?: number | null, driven?: number | null }} what none of a lap without advice */
  function choose({ section = null, driven = null }) {
    const part = section === null ? null : sections[section];
    /** @type {[number, number]} */
    const span = driven !== null ? [advice[driven].from, advice[driven].to] : part ? [Math.max(part.from - AROUND_M, 0), Math.min(part.to + AROUND_M, length)] : [0, length];
    traces.show(...span, driven);
    byId("whole").hidden = !part;
    byId("with-advice").hidden = driven === null;
    byId("range").textContent = part ? `${part.name}, ${Math.round(span[0])} m to ${Math.round(span[1])} m` : "";
    for (const node of all(".bend")) node.classList.toggle("chosen", Number(node.dataset.section) === section);
    for (const [i, node] of all(".advice li").entries()) node.classList.toggle("chosen", i === driven);
    if (section !== null) player.seek(timeAt(span[0]));
  }

  const adviceOf = (section) => {
    const found = advice.findIndex((one) => one.section === section);
    return found < 0 ? null : found;
  };
  const chooseSection = (section) => choose({ section, driven: adviceOf(section) });
  for (const node of all("[data-section]")) {
    const press = () => chooseSection(Number(node.dataset.section));
    node.addEventListener("click", () => {
      press();
      if (node.matches("button")) byId("traces-head").scrollIntoView({ block: "start" });
    });
    if (!node.matches("button")) {
      node.addEventListener("keydown", (event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        event.stopPropagation();
        press();
      });
    }
  }
  for (const node of all(".look")) {
    const driven = Number(node.dataset.advice);
    node.addEventListener("click", () => choose({ section: advice[driven].section, driven }));
  }
  function clip(from, to) {
    until = to;
    player.follow(car);
    player.seek(from);
    player.play(true);
    byId("race-head").scrollIntoView({ block: "start" });
  }
  for (const node of all(".watch")) {
    const one = advice[Number(node.dataset.advice)];
    node.addEventListener("click", () => {
      choose({ section: one.section, driven: Number(node.dataset.advice) });
      clip(timeAt(one.from), timeAt(Math.min(one.to, length)));
    });
  }
  for (const node of all(".moment")) {
    const seconds = Number(node.dataset.at);
    node.addEventListener("click", () => clip(seconds - BEFORE_S, seconds + 2 * BEFORE_S));
  }
  byId("whole").addEventListener("click", () => choose({}));
  document.addEventListener("keydown", player.key);
  keepMoment(player, (moment) => history.replaceState(null, "", `#${new URLSearchParams(moment)}`));
  player.on.push((state) => {
    // A clip ends by itself.
    if (until !== null && state.playing && state.now >= until) {
      until = null;
      player.play(false);
    }
    const place = placeAt(state.now);
    traces.mark(place);
    here(place);
    document.body.dataset.ready = "yes";
  });
  choose(advice.length ? { section: advice[0].section, driven: 0 } : {});
  const { now } = momentOf(named);
  if (now !== undefined) player.seek(now);
}

start();
