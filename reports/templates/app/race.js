// One race: its grid and result; if it was recorded, the race itself; and how to run it again.

import { capital, clock, number } from "../numbers.js";
import { h, shown } from "../race/element.js";
import { orderTable } from "../race/order.js";
import { keepMoment, keyHints, momentOf, racePlayer } from "../race/player.js";
import { openRecording, startNumber } from "../race/recording.js";
import { blames, carsOf, data, EPISODE, groups, lapped, measured, onCircuit, POINT_DIGITS, raceByKey, stageName, sum, summary } from "./data.js";
import { command, empty, entrantLink, facts, fileHref, gained, here, keep, missing, note, plain, section } from "./dom.js";
import { raceCharts, speedCharts } from "./race_charts.js";
import { momentButton, passesView } from "./race_passes.js";
import { stintChart, stintsOf } from "./race_stints.js";
import { replay } from "./recorded.js";
import { dataTable, entrantColumn, ownColumns } from "./table.js";

/**
 * @typedef {import("../race/player.js").Player} Player
 * @typedef {import("./data.js").Replay} Replay
 */

/** @param {string[]} address match and race */
export function raceView([key, index]) {
  const race = raceByKey(`${key}/${index}`);
  if (!race) return missing("race");
  const cars = carsOf(race);
  const teams = [...groups(cars.filter((one) => one.team >= 0), "team")].sort(([a], [b]) => a - b);
  const same = (one) => one.match === race.key && one.race === race.race;
  const [recording, shown] = [data.recordings.find(same), summary.replays.find(same)];
  const player = recording && playerOf(recording);
  const stopped = cars.some((one) => stintsOf(one).length > 0);
  const flagged = (value) => (value ? h("span", { class: "fault" }, number(value)) : "0");
  return [
    h("p", { class: "over" }, `${stageName(race.stage)} · ${plain(race.test)}`),
    h("h1", {}, `${capital(EPISODE)} ${race.key.slice(0, 12)}/${race.race}`),
    teams.length === 2 && h("p", { class: "why" }, teams.map(([, own], i) => [i > 0 && " : ", entrantLink(own[0].entrant), ` ${number(sum(own.map((one) => one.points)), POINT_DIGITS)}`])),
    facts([
      ["Seed", race.seed], (onCircuit || race.stage === "tournament") && [onCircuit ? "Grid" : "Sides", race.mirrored ? "mirrored" : "as drawn"],
      onCircuit && ["Contacts", [number(sum(cars.map((one) => one.contacts)) / 2), h("small", {}, "each counted once; in the table for both cars")]],
      measured("penalties") && ["Penalties", number(sum(cars.map((one) => one.penalties)))],
    ]),
    shown && filmOf(shown),
    player && later(player, (ready) => [h("div", { class: "watch" }, ready.node, orderTable(ready)), keyHints("Click the race for its keys: "), clipsHere(ready, shown), twinOf(ready, shown)]),
    section("Result", dataTable("result", [
      { key: "place", head: "Place", kind: "rank", first: "ascending", value: (row) => row.place },
      { key: "grid", head: onCircuit ? "Grid" : "Seat", first: "ascending", value: (row) => row.slot, cell: (row) => [number(row.slot), " ", onCircuit && gained(row.slot - row.place)] },
      { ...entrantColumn(), cell: (row) => [row.team >= 0 && h("i", { class: `team team${row.team}`, title: `team ${row.team + 1}` }), entrantLink(row.entrant)] },
      { key: "points", head: "Points", value: (row) => row.points, cell: (row) => number(row.points, POINT_DIGITS) },
      ...ownColumns(),
      measured("race_time_s") && { key: "time", head: "Time, s", first: "ascending", value: (row) => row.race_time_s, cell: (row) => (row.race_time_s === null ? plain(row.ending) : number(row.race_time_s, 3)) },
      lapped && { key: "lap", head: "Best lap, s", first: "ascending", value: (row) => row.best_lap_s, cell: (row) => number(row.best_lap_s, 3) },
      measured("laps") && { key: "laps", head: "Laps", value: (row) => row.laps },
      measured("contacts") && { key: "contacts", head: "Contacts", value: (row) => row.contacts },
      blames && { key: "blame", head: "At fault", value: (row) => row.contacts_at_fault, cell: (row) => flagged(row.contacts_at_fault) },
      measured("penalties") && { key: "penalties", head: "Penalties", value: (row) => row.penalties, cell: (row) => flagged(row.penalties) },
      measured("off_course_s") && { key: "off", head: "Off course, s", value: (row) => row.off_course_s, cell: (row) => number(row.off_course_s, 1) },
      measured("wall_s") && { key: "wall", head: "Wall, s", value: (row) => row.wall_s, cell: (row) => number(row.wall_s, 1) },
      stopped && { key: "stops", head: "Stops", value: (row) => Math.max(stintsOf(row).length - 1, 0) },
      stopped && { key: "stood", head: "Standing, s", value: (row) => sum(stintsOf(row).map((one) => one.stood_s ?? 0)), cell: (row) => number(sum(stintsOf(row).map((one) => one.stood_s ?? 0)), 1) },
      stopped && { key: "lane", head: "In the lane, s", value: (row) => sum(stintsOf(row).map((one) => one.lane_s ?? 0)), cell: (row) => number(sum(stintsOf(row).map((one) => one.lane_s ?? 0)), 1) },
      { key: "ending", head: "Ending", kind: "text", first: "ascending", value: (row) => plain(row.ending) },
    ], cars, { sort: "place", label: "Result" })),
    stopped && section("Stints", stintChart(cars)),
    player && later(player, (ready) => [
      section("Along the race", raceCharts(ready, cars)),
      section("Speed along the lap", speedCharts(ready)),
      section("Incidents", incidents(ready, shown)),
      section("Where cars pass", passesView(ready)),
    ]),
    (onCircuit || shown) && watched(race, shown),
  ];
}

/**
 * What is drawn of a race that was recorded, once that is unpacked.
 * @param {Promise<Player>} player
 * @param {(player: Player) => import("../race/element.js").Child} draw
 */
function later(player, draw) {
  const host = h("div", {});
  player.then((ready) => host.append(...shown([draw(ready)])));
  return host;
}

/** @param {import("../race/recording.js").RaceData} race */
async function playerOf(race) {
  const player = racePlayer(await openRecording(race, data.circuit), { scrolls: true, ...momentOf(here().params) });
  // A click gives it the keys: it takes the focus, and the page keeps its own keys elsewhere.
  player.node.tabIndex = -1;
  player.node.addEventListener("keydown", player.key);
  keepMoment(player, (moment) => Object.entries(moment).forEach(([name, value]) => keep(name, value)));
  return player;
}

/**
 * The recording's file, from the folder above the page; empty where there is none.
 * @param {Replay | undefined} shown
 */
const fileOf = (shown) => shown?.recording?.replace("../", "") ?? "";

// What commands are told of a store that is not found beside the recording.
const storeAsked = () => (data.store === "store.sqlite" ? [] : ["--store", data.store]);

/**
 * How to race it again with another policy at the wheel of the followed car, from the player's moment on.
 * @param {Player} player
 * @param {Replay | undefined} shown
 */
function twinOf({ state, recording }, shown) {
  const file = fileOf(shown);
  if (!file || !recording.time.length) return null;
  const asked = h("div", { role: "status" });
  const show = () => {
    const car = state.followed >= 0 ? state.followed : recording.order(recording.tickAt(state.now))[0];
    asked.replaceChildren(
      h("p", {}, `Both races side by side, with FILE at the wheel of ${recording.race.cars[car].name} from ${clock(state.now)} on. FILE may bring another plan of stops. From the folder above this page:`),
      command(["nathlon", "twin", file, "--car", startNumber(car), "--policy", "FILE", "--at", state.now.toFixed(1), "--out", "twin", ...storeAsked()]));
  };
  return [h("p", {}, h("button", { type: "button", class: "moment", onclick: show }, "race it again with another policy from this moment")), asked];
}

/** @type {Record<string, string>} */
const VERDICTS = { contact: "nobody at fault", wall: "noted", off_course: "noted", penalty: "penalty" };
/**
 * @param {Player} player
 * @param {Replay | undefined} shown
 */
function incidents(player, shown) {
  const { race } = player.recording;
  const rows = race.incidents.filter((incident) => !incident.notice);
  if (!rows.length) return empty("The stewards noted nothing.");
  const verdict = ({ kind, fault, penalty }) => [
    fault >= 0 ? h("span", { class: "fault" }, `${race.cars[fault].name} at fault`) : VERDICTS[kind], penalty > 0 && `, ${number(penalty, 1)} s`];
  const asked = h("div", { role: "status" });
  const file = fileOf(shown);
  const frozenBy = (row) => [
    "nathlon", "incident", file, "--at", row.time.toFixed(1), "--car", startNumber(row.fault >= 0 ? row.fault : row.cars[0]), "--name", "NAME",
    ...storeAsked(),
  ];
  const ask = (row) => h("button", {
    type: "button", class: "moment", "aria-label": `Make a test of the ${plain(row.kind)} at ${clock(row.time)}`,
    onclick: () => asked.replaceChildren(h("p", {}, "Every later night can run it. From the folder above this page:"), command(frozenBy(row))),
  }, "make a test");
  return [dataTable("incidents", [
    { key: "time", head: "Time", first: "ascending", value: (row) => row.time, cell: (row) => momentButton(player, row.time - 3, row.cars[0], clock(row.time)) },
    { key: "kind", head: "Kind", kind: "text", first: "ascending", value: (row) => plain(row.kind) },
    { key: "what", head: "What the stewards saw", kind: "text long", cell: (row) => row.text.replace(/: [^:]* penalty$/, "") },
    { key: "closing", head: "Closing, m/s", value: (row) => (row.kind === "contact" ? row.closing : null), cell: (row) => number(row.kind === "contact" ? row.closing : null, 1) },
    { key: "verdict", head: "Verdict", kind: "text", first: "ascending", value: (row) => (row.fault >= 0 ? 0 : 1) - row.penalty / 100, cell: verdict },
    file !== "" && { key: "test", head: "", unseen: "Test", kind: "text", cell: (row) => row.kind !== "penalty" && ask(row) },
  ], rows, { sort: "time", prefix: "incidents-", label: "Incidents", text: (row) => `${plain(row.kind)} ${row.text}`, shown: 12 }), asked];
}

/**
 * The video of an episode of another world, and who had which seat there.
 * @param {Replay} recorded
 */
function filmOf({ video, seats, why }) {
  return video && h("div", { class: "film" },
    h("video", { src: fileHref(video), controls: true, loop: true, muted: true, preload: "auto", "aria-label": why }),
    note([...groups(Object.entries(seats).map(([seat, who]) => ({ seat, who })), "who")]
      .map(([who, own]) => `${own.map(({ seat }) => seat).join(", ")}: ${who}`).join(" · ")));
}

/**
 * @param {Player} player
 * @param {Replay | undefined} shown
 */
function clipsHere(player, shown) {
  const clips = shown?.clips ?? [];
  return clips.length > 0 && h("ul", { class: "moments" }, clips.map((clip) => h("li", {},
    momentButton(player, clip.start_s, clip.car, `${clock(clip.start_s)} to ${clock(clip.end_s)}`), ` ${clip.why}`)));
}

/**
 * How to see the race elsewhere.
 * @param {import("./data.js").Race} race
 * @param {Replay | undefined} shown
 */
function watched(race, shown) {
  const file = fileOf(shown);
  return section("Replay",
    shown && h("p", {}, replay(shown)),
    file && [h("p", {}, "Open the recording in Rerun, from the folder above this page:"), command(["nathlon", "replay", file])],
    shown?.notes.map((text) => h("p", {}, text)),
    h("p", {}, file ? `Run the ${EPISODE} again and show it, from there:` : `Run the ${EPISODE} again, record it and show it in Rerun, from the folder above this page:`),
    command(["nathlon", "replay", data.store, `${race.key.slice(0, 12)}:${race.race}`]));
}
