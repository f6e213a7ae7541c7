// Races to look at, and the log.

import { capital, clock } from "../numbers.js";
import { h } from "../race/element.js";
import { elsewhere, empty, fileOf, head, note, scroll, when } from "./figures.js";

export function racesView(state) {
  const files = (race) => [[race.player, "watch"], [race.video, "video"], [race.recording, "recording"], [race.replay, "Rerun"]].filter(([path]) => path);
  return [
    h("h2", {}, "Races to look at"),
    state.races.length ? h("ul", { class: "races said" }, state.races.map((race) => h("li", {},
      h("p", {}, h("strong", {}, capital(race.why)), " ", files(race).map(([path, text], i) => [i > 0 && " · ", elsewhere(fileOf(state, path), text)])),
      race.missing && note(`It could not be run again: ${race.missing}`),
      race.player && race.clips.length > 0 && h("ul", { class: "moments" }, race.clips.map((clip) => h("li", {},
        elsewhere(`${fileOf(state, race.player)}#${new URLSearchParams({ at: clip.start_s, car: clip.car })}`, `${clock(clip.start_s)} to ${clock(clip.end_s)}`), ` ${clip.why}`)))))) : empty("No race of this run has been recorded yet."),
  ];
}

export function logView(state) {
  return [
    h("h2", {}, "Log"),
    note("All that was ever said, in order. Nothing is taken back."),
    state.log.length ? scroll("Log", h("table", {}, head([["No."], ["When"], ["Decision"], ["What"]]),
      h("tbody", {}, state.log.map((line) => h("tr", {}, h("td", {}, String(line.id)), h("td", {}, when(line.at)), h("td", {}, line.decision.split("-")[0]), h("td", {}, line.text)))))) : empty("Nothing was said in this run."),
  ];
}
