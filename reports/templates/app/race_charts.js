// Charts of a recorded race by distance, with a line where the player stands.

import { startNumber } from "../race/recording.js";
import { clock, number, shortened } from "../numbers.js";
import { h } from "../race/element.js";
import { chart, LINES, PLAIN_AXIS, scaleOf, tip } from "./charts.js";
import { groups } from "./data.js";
import { empty, here, keep, note } from "./dom.js";
import { d3, Plot } from "./libraries.js";
import { stopsOf } from "./race_stints.js";
import { lapsOf, passings, traceOf } from "./race_laps.js";

/**
 * @typedef {import("../race/player.js").Player} Player
 * @typedef {import("../race/recording.js").Recording} Recording
 */

/** @type {(recording: Recording, car: number) => string} */
const teamStroke = (recording, car) => (recording.race.cars[car].team === 1 ? "var(--finalist)" : "var(--survivor)");

/**
 * A chart along x with the player's place in it; a click has the player go there.
 * @param {Player} player
 * @param {string} title
 * @param {(width: number) => ReturnType<typeof Plot.plot>} draw
 * @param {() => number} placeOf of the player's moment
 * @param {(x: number) => number | null} timeOf
 */
function playedChart(player, title, draw, placeOf, timeOf) {
  let move = () => {};
  player.on.push(() => move());
  return chart(title, (width) => {
    const plot = draw(width);
    const scale = scaleOf(plot);
    const line = h("svg:line", { class: "cursor", y1: 8, y2: /** @type {SVGSVGElement} */ (plot).viewBox.baseVal.height - 38 });
    plot.append(line);
    move = () => {
      const x = scale.apply(placeOf());
      line.setAttribute("visibility", Number.isFinite(x) ? "visible" : "hidden");
      if (Number.isFinite(x)) for (const end of ["x1", "x2"]) line.setAttribute(end, String(x));
    };
    move();
    plot.addEventListener("click", (event) => {
      const time = timeOf(scale.invert(d3.pointer(event, plot)[0]));
      if (time !== null) player.seek(time);
    });
    return plot;
  });
}

/**
 * @param {Player} player
 * @param {import("./data.js").Car[]} cars of the race
 */
export function raceCharts(player, cars) {
  const { recording, state } = player;
  const { race, circuit, samples } = recording;
  const rows = passings(recording);
  if (!rows.length) return empty("No car drove far enough for a chart.");
  const byCar = groups(rows, "car");
  const last = [...byCar.values()].map((own) => own.at(-1));
  const stops = cars.flatMap((one) => {
    const own = byCar.get(one.slot - 1) ?? [];
    return stopsOf(one).map((lap) => own.find((row) => row.lap >= lap)).filter((row) => row !== undefined);
  });
  const stopped = (y) => Plot.dot(stops, { x: "lap", y, r: 4, fill: "var(--paper)", stroke: (row) => teamStroke(recording, row.car), strokeWidth: 1.8 });
  const end = d3.max(rows, ({ lap }) => lap);
  const place = () => {
    const tick = recording.tickAt(state.now);
    return (Math.max(...samples.distance.map((column) => column[tick])) + race.origin) / circuit.lap;
  };
  /** @param {number} lap */
  const when = (lap) => {
    const times = samples.distance.map((_, car) => recording.timeAt(car, lap * circuit.lap - race.origin)).filter((time) => time !== null);
    return times.length ? Math.min(...times) : null;
  };
  const along = { label: "laps of the leader", domain: [0, end], ticks: d3.range(0, end), tickFormat: "d", ...PLAIN_AXIS };
  const lines = (y) => Plot.line(rows, { x: "lap", y, z: "car", stroke: (row) => teamStroke(recording, row.car), strokeWidth: 1.8, strokeLinejoin: "round" });
  const about = (row) => `${race.cars[row.car].name}\nplace ${row.place}, ${number(row.gap, 1)} s behind the leader\n${clock(row.time)} after the start`;
  const pointed = (y) => Plot.tip(rows, Plot.pointer({ ...tip, x: "lap", y, title: about }));
  const out = new Set(cars.filter((one) => one.ending !== "finished").map((one) => one.slot - 1));
  const short = ({ car }) => `${startNumber(car)}${out.has(car) ? " out" : ""}`;
  const named = (row, width) => (width < 500 || row.lap < end - 0.2 ? short(row) : shortened(race.cars[row.car].name, 24));
  const halo = { fill: "currentColor", stroke: "var(--paper)", strokeWidth: 3 };
  const height = Math.max(270, 46 + 14 * recording.cars); // for names below each other
  return h("div", { class: "charts" },
    playedChart(player, "Places", (width) => Plot.plot({
      width, height, marginRight: width < 500 ? 44 : 158, marginLeft: 34, marginBottom: 38, ariaLabel: "Place of every car along the race",
      x: along, y: { domain: [recording.cars + 0.4, 0.6], ticks: d3.range(1, recording.cars + 1), tickFormat: "d", label: null, tickSize: 0 },
      marks: [Plot.ruleX(d3.range(1, end), { stroke: "var(--rule)" }), lines("place"),
        Plot.text(last, { x: "lap", y: "place", text: (row) => named(row, width), textAnchor: "start", dx: 6, ...halo }), stopped("place"), pointed("place")],
    }), place, when),
    playedChart(player, "Gap to the leader, s", (width) => Plot.plot({
      width, height, marginRight: 44, marginLeft: 34, marginBottom: 38, ariaLabel: "Gap of every car to the leader along the race",
      x: along, y: { domain: [d3.max(rows, ({ gap }) => gap) || 1, 0], label: null, grid: true },
      marks: [Plot.ruleX(d3.range(1, end), { stroke: "var(--rule)" }), lines("gap"),
        Plot.text(last, { x: "lap", y: "gap", text: short, textAnchor: "start", dx: 5, ...halo }), stopped("gap"), pointed("gap")],
    }), place, when),
    note("Numbers at the lines are start numbers, as in the order.", out.size > 0 && " Out: did not finish.", stops.length > 0 && " Circles: stops."));
}

// Speeds of up to two laps, and the time that they lose, against the fastest lap of the race.
/** @param {Player} player */
export function speedCharts(player) {
  const { recording, state } = player;
  const { race, circuit } = recording;
  const laps = lapsOf(recording);
  if (!laps.length) return empty("No car completed a lap.");
  const [reference] = laps;
  const titled = (lap) => `${race.cars[lap.car].name}, lap ${lap.lap}, ${number(lap.seconds, 2)} s`;
  const others = laps.filter(({ car }) => car !== reference.car);
  const opponent = others.find(({ car }) => race.cars[car].team !== race.cars[reference.car].team) ?? others[0] ?? laps[1];
  const { params } = here();
  const lapAt = (name, fallback) => (params.has(name) ? laps.find(({ key }) => key === params.get(name)) : fallback);
  const chosen = [lapAt("a", opponent), lapAt("b")];
  const host = h("div", {});
  const choose = (name, i) => h("label", {}, ["", "and "][i], h("select", {
    "aria-label": ["First lap", "Second lap"][i],
    onchange: (event) => {
      chosen[i] = laps.find(({ key }) => key === event.target.value);
      keep(name, event.target.value || "none");
      draw();
    },
  }, h("option", { value: "" }, "none"), laps.map((lap) => h("option", { value: lap.key, selected: lap === chosen[i] }, titled(lap)))));
  const distances = circuit.sections.map((section) => ({ ...section, middle: (section.start + section.end) / 2 }));
  const place = () => {
    const car = state.followed >= 0 ? state.followed : recording.order(recording.tickAt(state.now))[0];
    const distance = recording.value("distance", car, ...recording.moment(state.now)) + race.origin;
    return distance < 0 ? NaN : distance % circuit.lap;
  };
  const when = (distance) => recording.timeAt((chosen[0] ?? reference).car, (chosen[0] ?? reference).from + distance);

  function draw() {
    const traces = chosen.map((lap, i) => lap && { lap, line: i, rows: traceOf(recording, lap) }).filter(Boolean);
    const base = traceOf(recording, reference);
    const lost = (rows) => rows.slice(0, base.length).map((row, i) => ({ ...row, lost: row.seconds - base[i].seconds }));
    const along = { domain: [0, circuit.lap], label: "m from the line", ...PLAIN_AXIS };
    const bounds = Plot.ruleX(distances, { x: "start", stroke: "var(--rule)" });
    const pen = ({ line }) => ({ stroke: LINES[line][0], strokeWidth: 1.6 });
    host.replaceChildren(
      playedChart(player, "Speed, km/h", (width) => Plot.plot({
        width, height: 260, marginLeft: 38, marginBottom: 38, marginTop: width > 900 ? 34 : 14, ariaLabel: "Speed along the lap", x: along, y: { label: null, grid: true, nice: true },
        marks: [bounds, width < 900 ? null : Plot.text(distances, { x: "middle", text: (row) => ((width * (row.end - row.start)) / circuit.lap > 7 * row.name.length ? row.name : ""), frameAnchor: "top", dy: -18, lineWidth: 7, fill: "var(--muted)", fontSize: 11 }),
          Plot.line(base, { x: "distance", y: "speed", stroke: "var(--muted)", strokeDasharray: "4 3", strokeWidth: 1.6 }),
          traces.map((one) => Plot.line(one.rows, { x: "distance", y: "speed", ...pen(one) }))],
      }), place, when),
      playedChart(player, "Time lost to the reference, s", (width) => Plot.plot({
        width, height: 160, marginLeft: 38, marginBottom: 38, marginTop: 14, ariaLabel: "Time lost to the reference along the lap", x: along, y: { label: null, grid: true, nice: true },
        marks: [bounds, Plot.ruleY([0], { stroke: "var(--muted)", strokeDasharray: "4 3" }), traces.map((one) => Plot.line(lost(one.rows), { x: "distance", y: "lost", ...pen(one) }))],
      }), place, when));
  }
  draw();
  return [
    note("Dashed: the reference, the fastest lap of this race: ", titled(reference), "."),
    h("div", { class: "controls" }, [["a", 0], ["b", 1]].map(([name, i]) => [h("i", { class: `swatch line${i}` }), choose(name, i)])),
    host,
  ];
}
