// A recorded race, as reports/race_data.py packs it.

/**
 * @typedef {"wall_left" | "kerb_left" | "left" | "right" | "kerb_right" | "wall_right"} LineName
 * @typedef {{ x: Float64Array, y: Float64Array, z: Float64Array }} Line by row of the circuit, m
 * @typedef {"x" | "y" | "z" | "pitch" | "roll" | "yaw" | "speed" | "distance" | "steering" | "throttle" | "brake" | "slipstream"
 *   | "penalty" | "place" | "lap" | "driving"} SampleName
 */

/**
 * @typedef {object} CircuitData
 * @property {number} rows
 * @property {number} lap m
 * @property {LineName[]} lines
 * @property {number} step of the outline, m
 * @property {string} points
 * @property {string} heights
 * @property {string} runoff surfaces left and right of the road, penalty zone, side of the pit lane
 * @property {[number, number]} lane how far beside the road the pit lane begins and ends, m
 * @property {string[]} surfaces colours
 * @property {string} road its colour
 * @property {string[]} kerb its colours
 * @property {{ left: string[], right: string[] }} walls colours of panels in turn
 * @property {{ name: string, start: number, end: number }[]} sections
 */

/**
 * @typedef {object} Incident
 * @property {number} time s
 * @property {string} kind
 * @property {number[]} cars
 * @property {string} text
 * @property {boolean} notice whether it is only told
 * @property {number} fault the car; -1 for nobody
 * @property {number} closing m/s
 * @property {number} penalty s
 */

/**
 * @typedef {object} RaceData
 * @property {string} match
 * @property {number} race
 * @property {{ name: string, team: number, colour: string }[]} cars
 * @property {string} kind of its cars
 * @property {number} length of a car, m
 * @property {number} width
 * @property {number} origin where distances begin along the lap, m
 * @property {number} ticks
 * @property {string} time
 * @property {{ name: SampleName, step: number }[]} columns
 * @property {string} samples
 * @property {Incident[]} incidents
 * @property {{ time: number, car: number, passed: number, place: number, x: number, y: number, section: number }[]} passes `section` is -1 between two
 * @property {import("./sight.js").SightData[]} sights
 */

/** @typedef {Awaited<ReturnType<typeof openRecording>>} Recording */

/**
 * Rows of whole numbers.
 * @param {string} text
 * @param {number} width of a row
 */
export async function unpacked(text, width) {
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  const count = planes.length / 4;
  const rows = [];
  for (let start = 0; start < count; start += width) {
    const row = new Int32Array(width);
    let sum = 0;
    for (let i = 0; i < width; i++) {
      const k = start + i;
      sum += planes[k] | (planes[k + count] << 8) | (planes[k + 2 * count] << 16) | (planes[k + 3 * count] << 24);
      row[i] = sum;
    }
    rows.push(row);
  }
  return rows;
}

/**
 * The lines of a circuit, by name, and what lies beside and on the road, by row.
 * @param {CircuitData} circuit
 */
export async function openCircuit(circuit) {
  const [outline, heights, ground] = await Promise.all(
    [circuit.points, circuit.heights, circuit.runoff].map((rows) => unpacked(rows, circuit.rows)),
  );
  /** @param {Int32Array} row */
  const metres = (row) => Float64Array.from(row, (v) => v * circuit.step);
  const line = /** @type {Record<LineName, Line>} */ (Object.fromEntries(
    circuit.lines.map((name, i) => [name, { x: metres(outline[2 * i]), y: metres(outline[2 * i + 1]), z: metres(heights[i]) }]),
  ));
  return { line, ground };
}

/**
 * Samples by name, car and tick; the circuit's lines; and what follows from both.
 * @param {RaceData} race
 * @param {CircuitData} circuit
 */
export async function openRecording(race, circuit) {
  const cars = race.cars.length;
  const [[ticks], rows, { line, ground }] = await Promise.all([
    race.ticks ? unpacked(race.time, race.ticks) : [new Int32Array()],
    race.ticks ? unpacked(race.samples, race.ticks) : [],
    openCircuit(circuit),
  ]);
  const time = Array.from(ticks, (ms) => ms / 1000);
  const samples = /** @type {Record<SampleName, Float64Array[]>} */ ({});
  race.columns.forEach(({ name, step }, c) => {
    samples[name] = Array.from({ length: cars }, (_, car) => Float64Array.from(rows[c * cars + car] ?? [], (v) => v * step));
  });

  /**
   * The first index in a rising column whose value is not below this one.
   * @param {ArrayLike<number>} column
   * @param {number} wanted
   */
  function indexOf(column, wanted, high = column.length) {
    let low = 0;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (column[middle] < wanted) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** @param {number} seconds */
  const tickAt = (seconds) => {
    const next = indexOf(time, seconds);
    return time[next] === seconds ? next : Math.max(next - 1, 0);
  };

  /**
   * A tick, and the share of the way to the next.
   * @param {number} seconds
   * @returns {[number, number]}
   */
  function moment(seconds) {
    const tick = tickAt(seconds);
    const next = Math.min(tick + 1, time.length - 1);
    return [tick, next > tick ? Math.min(Math.max((seconds - time[tick]) / (time[next] - time[tick]), 0), 1) : 0];
  }

  /**
   * @param {SampleName} name
   * @param {number} car
   * @param {number} tick
   * @param {number} part of the way to the next
   */
  function value(name, car, tick, part) {
    const column = samples[name][car];
    return part ? column[tick] * (1 - part) + column[tick + 1] * part : column[tick];
  }

  /**
   * When a car had come so far, s, by a tick; null where it had not, or was beyond from the start. Its distance never falls much.
   * @param {number} car
   * @param {number} distance
   */
  function timeAt(car, distance, last = time.length - 1) {
    const column = samples.distance[car];
    const next = indexOf(column, distance, last);
    if (!(column[next] >= distance)) return null;
    if (!next) return column[0] === distance ? time[0] : null;
    // Whoever has finished stands where it was out, somewhere between two samples.
    if (!samples.driving[car][next]) return Math.min(time[next - 1] + (distance - column[next - 1]) / samples.speed[car][next - 1], time[next]);
    const part = (distance - column[next - 1]) / (column[next] - column[next - 1] || 1);
    return time[next - 1] + Math.min(Math.max(part, 0), 1) * (time[next] - time[next - 1]);
  }

  /**
   * Seconds since the car in front of all was where this car is now.
   * @param {number} car
   * @param {number} leader
   * @param {number} tick
   */
  function gap(car, leader, tick) {
    const there = timeAt(leader, samples.distance[car][tick], tick);
    return there === null ? 0 : Math.max(time[tick] - there, 0);
  }

  return {
    race, circuit, cars, time, samples, line, ground, tickAt, moment, value, timeAt, gap,
    end: time.at(-1) ?? 0,
    /** @type {(car: number, tick: number) => boolean} */
    drives: (car, tick) => samples.driving[car][tick] !== 0,
    /** @type {(tick: number) => number[]} */
    order: (tick) => [...Array(cars).keys()].sort((a, b) => samples.place[a][tick] - samples.place[b][tick]),
  };
}

/**
 * What is painted on a car: people count from 1.
 * @param {number} car
 */
export const startNumber = (car) => String(car + 1);
