// What the driver of one car sees in two races, as reports/seen_data.py packs it.

import { h } from "../race/element.js";
import { unpacked } from "../race/recording.js";
import { penOf, sized } from "../race/scene.js";
import { across, ORIGINAL, secondsAt, TWIN, upright } from "./charts.js";

const UNLIKE = 0.02; // share of a number's range by which two differ visibly
const STRONGLY = 0.25; // and that at which a strip has its full colour
const BINS = 600;
const CAR_NUMBERS = 5; // present, x, y, velocity x, velocity y
const SHOWN_M = { ahead: 70, behind: 20 };

// All drivers of a car in turn: `at` gives the numbers that were seen last at a moment, null before the first.
export async function openSeen(seen) {
  const drivers = await Promise.all(seen.drivers.map(async (one) => {
    const [[time], own, course, cars] = await Promise.all([
      unpacked(one.time, one.ticks), unpacked(one.own, one.ticks),
      one.points ? unpacked(one.course, one.ticks) : [],
      one.ahead + one.behind ? unpacked(one.cars, one.ticks) : [],
    ]);
    return { ...one, time: Array.from(time, (ms) => ms / 1000), own, course, cars };
  }));
  const steps = seen.fields.flatMap((field) => field.parts.map(() => field.step));

  function at(seconds) {
    const driver = drivers.findLast((one) => one.time[0] <= seconds + 1e-6);
    if (!driver) return null;
    let [low, high] = [0, driver.time.length - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (driver.time[middle] <= seconds + 1e-6) low = middle;
      else high = middle - 1;
    }
    const metres = (row) => row[low] * seen.step;
    const carsOf = (first, count) => Array.from({ length: count }, (_, i) => {
      const [present, ...numbers] = driver.cars.slice((first + i) * CAR_NUMBERS, (first + i + 1) * CAR_NUMBERS).map(metres);
      return present > 0.5 ? numbers : null;
    }).filter(Boolean);
    return {
      own: steps.map((step, i) => driver.own[i][low] * step),
      points: Array.from({ length: driver.points }, (_, i) => driver.course.slice(4 * i, 4 * i + 4).map(metres)),
      ahead: carsOf(0, driver.ahead),
      behind: carsOf(driver.ahead, driver.behind),
      over: seconds > driver.time.at(-1) + 1,
    };
  }

  return { fields: seen.fields, at };
}

// Groups of numbers: the fields, then the nearest cars.
function groupsOf(fields) {
  let first = 0;
  const own = fields.map(({ name, unit, parts, range, step }) => {
    const from = first;
    first += parts.length;
    const digits = Math.max(0, Math.min(3, Math.ceil(-Math.log10(step * 10))));
    return { name, unit, parts, range: parts.map(() => range), digits, of: (seen) => seen.own.slice(from, from + parts.length) };
  });
  const nearest = (where) => ({
    name: `nearest ${where}`, unit: "m, m/s", parts: ["x", "y", "velocity x", "velocity y"], range: [160, 40, 80, 40], digits: 1,
    of: (seen) => seen[where][0] ?? [null, null, null, null],
  });
  return [...own, nearest("ahead"), nearest("behind")];
}

// By how much two values differ, as a share of the range; a car that only one of them sees differs wholly.
function apart(a, b, range) {
  if (a === null && b === null) return 0;
  return a === null || b === null ? 1 : Math.abs(a - b) / range;
}

export function seenView(player, sides, mark) {
  const { state, end } = player;
  const groups = groupsOf(sides[0].fields);
  const rows = groups.map((group) => {
    const cells = sides.map(() => group.parts.map((part) => h("i", { title: part || group.name })));
    const strip = h("canvas", {
      role: "img", "aria-label": `how unlike ${group.name} is over the race`,
      onclick: (event) => player.seek(secondsAt(event, strip, end)),
    });
    const drawn = stripOf(sides, group, end);
    const node = h("tr", {}, h("th", { scope: "row" }, group.name, h("small", {}, group.unit)),
      cells.map((parts, i) => h("td", { class: i ? "twin" : "original" }, parts)), h("td", { class: "strip" }, strip));
    return { group, cells, strip, drawn, node };
  });
  const plans = ["original", "twin"].map((side) => h("canvas", { class: "plan", role: "img", "aria-label": `What it sees in the ${side}: the edges of the road and other cars` }));

  player.on.push(() => {
    const seen = sides.map((side) => side.at(state.now)).map((one) => (one?.over ? null : one));
    for (const { group, cells, strip, drawn } of rows) {
      const values = seen.map((one) => (one ? group.of(one) : null));
      group.parts.forEach((_, p) => {
        const unlike = values[0] && values[1] && apart(values[0][p], values[1][p], group.range[p]) > UNLIKE;
        cells.forEach((parts, i) => {
          const v = values[i]?.[p];
          parts[p].textContent = v === null || v === undefined ? "–" : (Number(v.toFixed(group.digits)) || 0).toFixed(group.digits).replace("-", "−");
          parts[p].classList.toggle("unlike", Boolean(unlike));
        });
      });
      const pen = penOf(strip);
      const [width, height, ratio] = sized(strip);
      pen.clearRect(0, 0, width, height);
      pen.imageSmoothingEnabled = false;
      const left = across(0, end, width, ratio);
      pen.drawImage(drawn, left, 0, across(end, end, width, ratio) - left, height);
      if (mark !== null) upright(pen, across(mark, end, width, ratio), "#f06a6a", height, ratio);
      upright(pen, across(state.now, end, width, ratio), "#e6e8eb", height, ratio);
    }
    plans.forEach((plan, i) => drawPlan(plan, seen[i], player.recording.race, i ? TWIN : ORIGINAL));
  });

  return h("div", { class: "seen" },
    h("div", { class: "plans" }, plans.map((plan, i) => h("figure", {}, plan, h("figcaption", {}, i ? "twin: what its driver sees" : "original: what its driver sees")))),
    h("div", { class: "scroll" }, h("table", { id: "numbers" },
      h("thead", {}, h("tr", {}, ["Seen", "Original", "Twin", "Unlike, over the race"].map((head) => h("th", { scope: "col" }, head)))),
      h("tbody", {}, rows.map((row) => row.node)))));
}

// One row of pixels: how unlike a group is at each moment.
function stripOf(sides, group, end) {
  const strip = document.createElement("canvas");
  [strip.width, strip.height] = [BINS, 1];
  const pen = penOf(strip);
  for (let bin = 0; bin < BINS; bin++) {
    const seen = sides.map((side) => side.at(((bin + 0.5) / BINS) * end));
    let share = 0;
    if (seen[0] && seen[1] && !seen[0].over && !seen[1].over) {
      const [a, b] = seen.map(group.of);
      share = Math.max(...group.parts.map((_, p) => apart(a[p], b[p], group.range[p])));
    }
    pen.fillStyle = share > UNLIKE ? `rgb(245 180 80 / ${0.15 + 0.85 * Math.min(share / STRONGLY, 1)})` : "#1a1e24";
    pen.fillRect(bin, 0, 1, 1);
  }
  return strip;
}

// The road and the cars as the driver has them: its car below, nose up.
function drawPlan(canvas, seen, race, colour) {
  const pen = penOf(canvas);
  const [width, height, ratio] = sized(canvas);
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.clearRect(0, 0, width, height);
  if (!seen) return;
  const scale = height / (SHOWN_M.ahead + SHOWN_M.behind);
  /** @type {(x: number, y: number) => [number, number]} */
  const place = (x, y) => [width / 2 - y * scale, height - (x + SHOWN_M.behind) * scale];
  pen.lineWidth = 1.5 * ratio;
  for (const side of [0, 1]) {
    pen.strokeStyle = pen.fillStyle = "#e1e2de";
    pen.beginPath();
    // A point has x and y of the left edge, then of the right.
    for (const point of seen.points) pen.lineTo(...place(point[2 * side], point[2 * side + 1]));
    pen.stroke();
    for (const point of seen.points) {
      pen.beginPath();
      pen.arc(...place(point[2 * side], point[2 * side + 1]), 2 * ratio, 0, 7);
      pen.fill();
    }
  }
  const box = (x, y, fill) => {
    const [left, top] = place(x + race.length / 2, y + race.width / 2);
    pen.fillStyle = fill;
    pen.fillRect(left, top, race.width * scale, race.length * scale);
  };
  for (const [x, y, vx, vy] of [...seen.ahead, ...seen.behind]) {
    box(x, y, "#99a1ac");
    pen.strokeStyle = "#f06a6a";
    pen.beginPath();
    pen.moveTo(...place(x, y));
    pen.lineTo(...place(x + vx, y + vy));
    pen.stroke();
  }
  box(0, 0, colour);
}
