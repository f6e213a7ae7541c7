// The page of the coach.

import { keepMoment, momentOf, racePlayer } from "../race/player.js";
import { openRecording } from "../race/recording.js";
import { lapMap } from "./map.js";
import { lapTraces, valueAt } from "./traces.js";

const PIECE_M = 12;
const BEFORE_S = 2;
const AROUND_M = 60;

async function start() {
  const at = (id) => document.getElementById(id);
  const data = JSON.parse(at("data").textContent);
  const { own, sections, advice, car } = data;
  const length = own.place.at(-1);
  const recording = await openRecording(data.race, data.circuit);
  const named = new URLSearchParams(location.hash.slice(1));
  const player = racePlayer(recording, { followed: car, now: data.start, scrolls: true, ...(named.has("at") && momentOf(named)) });
  at("race").append(player.node);
  const timeAt = (place) => data.start + valueAt(own, "time_s", place);
  const placeAt = (seconds) => {
    const since = seconds - data.start;
    const after = own.time_s.findIndex((time) => time >= since);
    if (since < 0 || after < 0) return null;
    if (after === 0) return own.place[0];
    const share = (since - own.time_s[after - 1]) / (own.time_s[after] - own.time_s[after - 1]);
    return own.place[after - 1] + share * (own.place[after] - own.place[after - 1]);
  };
  const traces = lapTraces(at("traces"), data, (place, pressed) => {
    traces.mark(place);
    here(place);
    if (pressed) player.seek(timeAt(Math.min(place, length)));
  });
  const here = lapMap(at("map"), PIECE_M);
  let until = null;

  function choose({ section = null, driven = null }) {
    const part = section === null ? null : sections[section];
    const span = driven !== null ? [advice[driven].from, advice[driven].to] : part ? [Math.max(part.from - AROUND_M, 0), Math.min(part.to + AROUND_M, length)] : [0, length];
    traces.show(...span, driven);
    at("whole").hidden = !part;
    at("with-advice").hidden = driven === null;
    at("range").textContent = part ? `${part.name}, ${Math.round(span[0])} m to ${Math.round(span[1])} m` : "";
    for (const node of document.querySelectorAll(".label")) node.classList.toggle("chosen", Number(node.dataset.section) === section);
    document.querySelectorAll(".advice li").forEach((node, i) => node.classList.toggle("chosen", i === driven));
    if (section !== null) player.seek(timeAt(span[0]));
  }

  const adviceOf = (section) => {
    const found = advice.findIndex((one) => one.section === section);
    return found < 0 ? null : found;
  };
  const chooseSection = (section) => choose({ section, driven: adviceOf(section) });
  for (const node of document.querySelectorAll("[data-section]")) {
    const press = () => chooseSection(Number(node.dataset.section));
    node.addEventListener("click", () => {
      press();
      if (node.matches("button")) at("traces-head").scrollIntoView({ block: "start" });
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
  for (const node of document.querySelectorAll(".look")) {
    const driven = Number(node.dataset.advice);
    node.addEventListener("click", () => choose({ section: advice[driven].section, driven }));
  }
  function clip(from, to) {
    until = to;
    player.follow(car);
    player.seek(from);
    player.play(true);
    at("race-head").scrollIntoView({ block: "start" });
  }
  for (const node of document.querySelectorAll(".watch")) {
    const one = advice[Number(node.dataset.advice)];
    node.addEventListener("click", () => {
      choose({ section: one.section, driven: Number(node.dataset.advice) });
      clip(timeAt(one.from), timeAt(Math.min(one.to, length)));
    });
  }
  for (const node of document.querySelectorAll(".moment")) {
    const seconds = Number(node.dataset.at);
    node.addEventListener("click", () => clip(seconds - BEFORE_S, seconds + 2 * BEFORE_S));
  }
  at("whole").addEventListener("click", () => choose({}));
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
  if (named.has("at")) player.seek(momentOf(named).now);
}

start();
