// A lap against another line: a map in the colours of its speed, what was lost where, and a closer look.

import { number, signed } from "../numbers.js";
import { h } from "../race/element.js";
import { barScale, chart, extent, scaleOf } from "./charts.js";
import { data, entrantByKey, entrants, groups, nameOf, ownCars, paretoOf, tables } from "./data.js";
import { choose, command, empty, facts, here, link, note, raceHref } from "./dom.js";
import { d3, Plot } from "./libraries.js";
import { dataTable } from "./table.js";

const course = tables.course;
const lapOf = groups(tables.laps, "entrant");
const KMH = 3.6;
const CLOSE_M = 230;
const LIMIT = "the fastest lap that the car and the rules allow, by optimal control";

const overLimit = (lap) => (data.limit === null || lap === null || lap === undefined ? null : lap / data.limit);

// Of tables of entrants, where the limit is known.
export const limitColumn = () => (data.limit === null ? [] : [{
  key: "limit", head: "Mean / limit", first: "ascending", title: `mean best lap of the time trials over the limit of ${number(data.limit, 3)} s: ${LIMIT}`,
  value: (row) => overLimit(paretoOf.get(row.entrant)?.lap_s), cell: (row) => number(overLimit(paretoOf.get(row.entrant)?.lap_s), 3),
}]);
export const limitNote = () => (data.limit === null ? "" : ` Mean / limit: mean best lap of the time trials over ${number(data.limit, 3)} s, ${LIMIT}.`);

export function lapView(index) {
  const lap = lapOf.get(index);
  if (!lap) return lapCommand(index);
  const others = [...lapOf.keys()].filter((other) => other !== index);
  const asked = entrantByKey.get(here().params.get("against") ?? "")?.number;
  const against = others.find((one) => one === asked) ?? null;
  const other = lapOf.get(against ?? -1) ?? course;
  const names = { own: nameOf(index), other: against === null ? "built-in driver's line" : nameOf(against) };
  const rows = lap.map((row, i) => ({ ...row, other: other[i], lost: row.time_s - other[i].time_s }));
  const stretches = sectionsOf(rows);
  const place = placeOn(rows, d3.greatest(stretches, (one) => one.lost)?.slowest ?? 0);
  const last = rows.length - 1;
  const [trial, time] = [bestTrial(index), `${number(lap[last].time_s, 3)} s`];
  const choice = h("label", {}, "Against ", h("select", { onchange: (event) => choose("against", event.target.value) },
    h("option", { value: "" }, "the built-in driver's line"),
    others.map((one) => h("option", { value: entrants[one].key, selected: one === against }, nameOf(one)))));
  return [
    facts([
      ["Best time trial", trial ? link(raceHref(trial.race), time) : time],
      ...limitFacts(lap[last].time_s),
      data.limit !== null && ["Mean lap / limit", number(overLimit(paretoOf.get(index)?.lap_s), 3), "of the best laps of all its time trials, as in the leaderboard"],
      [against === null ? "Built-in driver's line" : nameOf(against), [number(other[last].time_s, 3), " s"]],
      ["Difference", [signed(rows[last].lost, 3), " s"]],
    ]),
    note(
      data.limit !== null && `The limit is ${LIMIT}. It acts at every moment, a policy ten times a second: about 1.01 is within reach. `,
      against === null && "The built-in driver's line has the speeds that the driver plans. It is no limit: a policy can be faster."),
    h("div", { class: "controls" }, choice, place.slider, place.said),
    h("div", { class: "maps" }, wholeMap(rows, names, place), closeMap(rows, other, names, place)),
    speedKey(rows),
    traces(rows, names, place),
    dataTable("sections", [
      { key: "from", head: "Section", kind: "name", first: "ascending", value: (row) => row.from, cell: (row) => h("button", { type: "button", class: "plain", onclick: () => place.go(row.slowest) }, row.name) },
      { key: "time", head: "Time, s", value: (row) => row.time, cell: (row) => number(row.time, 3) },
      { key: "lost", head: "Lost, s", value: (row) => row.lost, cell: (row) => h("strong", {}, signed(row.lost, 3)) },
      { key: "drawn", head: "", unseen: "Lost, drawn", kind: "drawn", cell: barScale(stretches, ["lost", "low", "high"], 0, "contacts") },
      { key: "slowest", head: "Lowest speed, km/h", value: (row) => row.least, cell: (row) => number(KMH * row.least) },
      { key: "theirs", head: against === null ? "of the line" : "of the other", value: (row) => row.theirs, cell: (row) => number(KMH * row.theirs) },
    ], stretches, { sort: "from", prefix: "sections-", label: "Sections" }),
  ];
}

/** @type {(lap: number) => [string, import("../race/element.js").Child, string?][]} */
const limitFacts = (lap) => (data.limit === null ? [] : [["Limit", [number(data.limit, 3), " s"], LIMIT], ["Best lap / limit", number(overLimit(lap), 3)]]);

const bestTrial = (index) => d3.least(
  ownCars(index).filter((car) => car.race.stage === "pareto" && car.race.test === "time_trial" && car.best_lap_s !== null),
  (car) => car.best_lap_s,
);

// How to see the lap of an entrant whose lap the report does not hold.
function lapCommand(index) {
  const best = bestTrial(index);
  if (!best) return empty("It completed no lap of its time trials.");
  return [
    facts([["Best time trial", [number(best.best_lap_s, 3), " s"]], ...limitFacts(best.best_lap_s)]),
    h("p", {}, "The report holds the laps of the shortlist and of the finalists. This command shows any other, from the folder above this page:"),
    command(["nathlon", "replay", data.store, `${best.race.key.slice(0, 12)}:${best.race.race}`]),
  ];
}

// The named sections of the circuit in the order of the lap.
function sectionsOf(rows) {
  const begins = d3.range(course.length).filter((i) => i === 0 || course[i].section !== course[i - 1].section);
  const found = begins.map((begin, i) => {
    const end = begins[i + 1] ?? rows.length - 1;
    const own = d3.range(begin, end + 1);
    const slowest = d3.least(own, (one) => rows[one].speed_m_s) ?? begin;
    return {
      name: course[begin].section || (i ? `after ${course[begin - 1].section}` : "start"), from: rows[begin].distance_m, slowest, low: null, high: null,
      time: rows[end].time_s - rows[begin].time_s, lost: rows[end].lost - rows[begin].lost,
      least: rows[slowest].speed_m_s, theirs: d3.min(own, (one) => rows[one].other.speed_m_s),
    };
  });
  return found.filter((one) => one.time > 0);
}

// A place on the lap that a slider, the maps and the charts share; those who follow it are told when it moves.
function placeOn(rows, first) {
  const followers = new Map();
  const said = h("output", { class: "note" });
  const slider = h("input", { type: "range", min: 0, max: rows.length - 1, value: first, oninput: () => go(Number(slider.value)) });
  let at = first;
  function go(index) {
    at = Math.max(0, Math.min(rows.length - 1, index));
    slider.value = at;
    const row = rows[at];
    said.textContent = `${number(row.distance_m)} m${course[at].section && `, ${course[at].section}`}: ${number(KMH * row.speed_m_s)} km/h against ${number(KMH * row.other.speed_m_s)}, ${signed(row.lost, 2)} s`;
    slider.setAttribute("aria-valuetext", said.textContent);
    for (const follow of followers.values()) follow(at);
  }
  go(first);
  return {
    go, said,
    slider: h("label", { class: "slider" }, "Place on the lap ", slider),
    follow: (name, follower) => { followers.set(name, follower); follower(at); },
  };
}

const speedScale = (rows) => {
  const [low, high] = extent(rows.flatMap((row) => [row.speed_m_s, row.other.speed_m_s]), (speed) => speed);
  // From a quarter on, viridis stands out from the road.
  return { low, high, colour: (speed) => d3.interpolateViridis(0.25 + (0.75 * (speed - low)) / Math.max(high - low, 1e-9)) };
};
function speedKey(rows) {
  const { low, high, colour } = speedScale(rows);
  const steps = d3.range(24).map((i) => h("svg:rect", { x: 10 * i, y: 0, width: 10.5, height: 12, fill: colour(low + ((high - low) * i) / 23) }));
  return h("p", { class: "key" }, `${number(KMH * low)} `, h("svg:svg", { viewBox: "0 0 240 12", width: 240, height: 12, "aria-hidden": "true" }, steps), ` ${number(KMH * high)} km/h`);
}

// Lines on the map, whose y points down.
/** @param {"" | "left_" | "right_"} [side] of the road */
const onMap = (side = "") => d3.line((/** @type {any} */ row) => row[`${side}x_m`], (row) => -row[`${side}y_m`]).curve(d3.curveCatmullRom).digits(1);
const road = () => `${onMap("left_")(course)}Z${onMap("right_")(course)}Z`;

// The road and the lap in the colours of its speed.
function drawnLap(rows) {
  const { colour } = speedScale(rows);
  const points = rows.map((row) => `${row.x_m} ${-row.y_m}`);
  return [
    h("svg:path", { class: "road", d: road() }),
    h("svg:g", { class: "driven" }, points.slice(1).map((point, i) => h("svg:path", { d: `M${points[i]}L${point}`, stroke: colour(rows[i].speed_m_s) }))),
  ];
}

const dot = (kind) => h("svg:path", { class: kind });
const put = (marker, { x_m: x, y_m: y }) => marker.setAttribute("d", `M${x} ${-y}h0`);
const atTime = (rows, time) => rows[Math.min(rows.length - 1, d3.bisector((row) => row.time_s).left(rows, time))];

const MAP_PX = 480;
function wholeMap(rows, names, place) {
  const [left, right] = extent(rows, (row) => row.x_m);
  const [low, high] = extent(rows, (row) => row.y_m);
  const margin = 0.06 * Math.max(right - left, high - low);
  const box = [left - margin, -high - margin, right - left + 2 * margin, high - low + 2 * margin];
  return chart(null, (width) => {
    const pixel = Math.max(box[2] / width, box[3] / MAP_PX);
    const car = dot("car");
    const svg = h("svg:svg", {
      viewBox: box.join(" "), class: "map", height: box[3] / pixel, "aria-label": `Map of the circuit with the lap of ${names.own}, coloured by speed`,
      onpointermove: (event) => event.pointerType === "mouse" && near(event), onpointerdown: near,
    }, drawnLap(rows), startLine(), h("svg:g", { "font-size": 12 * pixel }, sectionNames(rows, box, pixel)), car);
    function near(event) {
      const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM()?.inverse());
      place.go(d3.leastIndex(rows, (row) => (row.x_m - point.x) ** 2 + (row.y_m + point.y) ** 2));
    }
    place.follow("map", (at) => put(car, rows[at]));
    return svg;
  });
}

const startLine = () => h("svg:path", { class: "start", d: `M${course[0].left_x_m} ${-course[0].left_y_m}L${course[0].right_x_m} ${-course[0].right_y_m}` });

// Names beside the road, away from the middle; one that would cover another is left out.
function sectionNames(rows, box, pixel) {
  const middle = { x: d3.mean(rows, (row) => row.x_m) ?? 0, y: -(d3.mean(rows, (row) => row.y_m) ?? 0) };
  const taken = [];
  const within = (own) => [0, 1].every((k) => own[k] > box[k] && own[k] + own[k + 2] < box[k] + box[k + 2]);
  const clear = (own) => within(own) && taken.every((one) => own[0] > one[0] + one[2] || one[0] > own[0] + own[2] || own[1] > one[1] + one[3] || one[1] > own[1] + own[3]);
  const road = rows.filter((_, i) => i % 4 === 0).map((row) => [row.x_m - 6 * pixel, -row.y_m - 6 * pixel, 12 * pixel, 12 * pixel]);
  taken.push(...road);
  return d3.groups(course.map((row, i) => ({ ...row, i })), (row) => row.section).filter(([name]) => name).flatMap(([name, own]) => {
    const row = rows[own[Math.floor(own.length / 2)].i];
    const [width, height] = [6.6 * pixel * name.length, 15 * pixel];
    const away = Math.atan2(-row.y_m - middle.y, row.x_m - middle.x);
    for (const turn of [0, 0.7, -0.7, Math.PI, Math.PI - 0.7, 0.7 - Math.PI]) {
      const [dx, dy] = [Math.cos(away + turn), Math.sin(away + turn)];
      const [x, y] = [row.x_m + dx * (width / 2 + 11 * pixel), -row.y_m + dy * (height / 2 + 11 * pixel)];
      const label = [x - width / 2, y - height / 2, width, height];
      if (!clear(label)) continue;
      taken.push(label);
      return [h("svg:text", { x, y: y + 4 * pixel, "text-anchor": "middle" }, name)];
    }
    return [];
  });
}

function closeMap(rows, other, names, place) {
  const [car, ghost] = [dot("car"), dot("ghost")];
  const svg = h("svg:svg", { class: "map close", role: "img", "aria-label": `The road around the place on the lap: ${names.own} and the ${names.other}` },
    drawnLap(rows), startLine(), h("svg:path", { class: "other", d: onMap()(other) }), ghost, car);
  place.follow("close", (at) => {
    const { x_m: x, y_m: y, time_s: time } = rows[at];
    svg.setAttribute("viewBox", [x - CLOSE_M / 2, -y - CLOSE_M / 2.8, CLOSE_M, CLOSE_M / 1.4].join(" "));
    put(car, rows[at]);
    put(ghost, atTime(other, time));
  });
  return h("figure", {}, svg, h("p", { class: "key" }, h("i", { class: "car" }), names.own, " ", h("i", { class: "ghost" }), `${names.other}, dashed, at the same time; ${CLOSE_M} m across`));
}

// Speeds, the time lost and the pedals over the lap, with a line where the place is.
function traces(rows, names, place) {
  const along = { label: null, domain: [0, rows.at(-1).distance_m], grid: true };
  const trace = (name, title, height, options) => chart(title, (width) => {
    const plot = Plot.plot({ width, height, marginLeft: 46, marginRight: 12, marginBottom: 24, ariaLabel: title, ...options, x: { ...along, ticks: width / 110, tickFormat: (m) => `${number(m / 1000, 1)} km` } });
    const x = scaleOf(plot);
    const line = h("svg:line", { class: "place", y1: 4, y2: height - 24 });
    plot.append(line);
    plot.addEventListener("pointermove", (event) => {
      const [within] = d3.pointer(event, plot);
      place.go(Math.round(((rows.length - 1) * x.invert(within)) / along.domain[1]));
    });
    place.follow(name, (at) => { for (const end of ["x1", "x2"]) line.setAttribute(end, String(x.apply(rows[at].distance_m))); });
    return plot;
  });
  /** @type {[(row: any) => number, string, string | undefined][]} */
  const lines = [[(row) => KMH * row.other.speed_m_s, "var(--muted)", "4 3"], [(row) => KMH * row.speed_m_s, "var(--survivor)", undefined]];
  return [
    trace("speed", `Speed, km/h: ${names.own}, and dashed ${names.other}`, 210, {
      y: { grid: true, label: null, nice: true },
      marks: lines.map(([y, stroke, strokeDasharray]) => Plot.line(rows, { x: "distance_m", y, stroke, strokeDasharray, strokeWidth: 1.8 })),
    }),
    trace("lost", "Time lost, s: rising where it is slower", 140, {
      y: { grid: true, label: null, nice: true },
      marks: [
        Plot.ruleY([0], { stroke: "var(--strong-rule)" }),
        Plot.areaY(rows, { x: "distance_m", y: "lost", fill: "var(--finalist)", fillOpacity: 0.2 }),
        Plot.line(rows, { x: "distance_m", y: "lost", stroke: "var(--finalist)", strokeWidth: 1.8 }),
      ],
    }),
    trace("pedals", "Throttle above, brake below", 100, {
      y: { label: null, domain: [-1, 1], ticks: [-1, 0, 1], tickFormat: "d" },
      marks: [
        Plot.ruleY([0], { stroke: "var(--strong-rule)" }),
        Plot.areaY(rows, { x: "distance_m", y: (row) => Math.max(0, row.pedals), fill: "var(--survivor)", fillOpacity: 0.45 }),
        Plot.areaY(rows, { x: "distance_m", y: (row) => Math.min(0, row.pedals), fill: "var(--finalist)", fillOpacity: 0.55 }),
      ],
    }),
  ];
}
