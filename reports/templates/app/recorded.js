// Races of the night that were recorded.

import { capital, clock } from "../numbers.js";
import { h } from "../race/element.js";
import { EPISODE, raceByKey } from "./data.js";
import { fileHref, link, raceHref, to } from "./dom.js";

/** @typedef {import("./data.js").Replay} Replay */

/**
 * A race that was recorded: what is seen there, and its files.
 * @param {Replay} recorded
 */
export function replay({ match, race, why, player, video, recording, replay: rerun, missing: reason }) {
  const there = raceByKey(`${match.slice(0, 12)}/${race}`);
  const name = `${capital(EPISODE)} ${match.slice(0, 6)}/${race}`;
  /** @type {[string | null, string][]} */
  const files = [[player, "watch it here"], [video, "video"], [rerun, "Rerun"], [recording, "recording, for Foxglove and Rerun"]];
  return [
    there ? link(raceHref(there), name) : name, `: ${why}. `,
    files.flatMap(([file, text]) => (file ? [link(fileHref(file), text)] : [])).map((one, i) => [i > 0 && " · ", one]),
    reason && h("span", { class: "fault" }, `It could not be run again: ${reason}`),
  ];
}

/**
 * The clips of a race that is to be looked at, as links that open the player there.
 * @param {Replay} recorded
 */
export function clipsOf({ match, race, clips }) {
  return clips.length > 0 && h("ul", { class: "moments" }, clips.map((clip) => h("li", {},
    link(to("race", [match.slice(0, 12), String(race)], { at: String(clip.start_s), car: String(clip.car) }), `${clock(clip.start_s)} to ${clock(clip.end_s)}`), ` ${clip.why}`)));
}
