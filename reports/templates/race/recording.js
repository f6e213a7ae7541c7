// A recorded race, as reports/race_data.py packs it.

// Rows of whole numbers.
async function unpacked(text, width) {
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

// The lines of a circuit, by name, and what lies beside and on the road, by row.
async function openCircuit(circuit) {
  const [outline, heights, ground] = await Promise.all(
    [circuit.points, circuit.heights, circuit.runoff].map((rows) => unpacked(rows, circuit.rows)),
  );
  const metres = (row) => Float64Array.from(row, (v) => v * circuit.step);
  const line = Object.fromEntries(
    circuit.lines.map((name, i) => [name, { x: metres(outline[2 * i]), y: metres(outline[2 * i + 1]), z: metres(heights[i]) }]),
  );
  return { line, ground };
}

// Samples by name, car and tick; the circuit's lines; and what follows from both.
async function openRecording(race, circuit) {
  const cars = race.cars.length;
  const [[ticks], rows, { line, ground }] = await Promise.all([
    race.ticks ? unpacked(race.time, race.ticks) : [new Int32Array()],
    race.ticks ? unpacked(race.samples, race.ticks) : [],
    openCircuit(circuit),
  ]);
  const time = Array.from(ticks, (ms) => ms / 1000);
  const samples = {};
  race.columns.forEach(({ name, step }, c) => {
    samples[name] = Array.from({ length: cars }, (_, car) => Float64Array.from(rows[c * cars + car] ?? [], (v) => v * step));
  });

  // The first index in a rising column whose value is not below this one.
  function indexOf(column, wanted, high = column.length) {
    let low = 0;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (column[middle] < wanted) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  const tickAt = (seconds) => {
    const next = indexOf(time, seconds);
    return time[next] === seconds ? next : Math.max(next - 1, 0);
  };

  // A tick, and the share of the way to the next.
  function moment(seconds) {
    const tick = tickAt(seconds);
    const next = Math.min(tick + 1, time.length - 1);
    return [tick, next > tick ? Math.min(Math.max((seconds - time[tick]) / (time[next] - time[tick]), 0), 1) : 0];
  }

  function value(name, car, tick, part) {
    const column = samples[name][car];
    return part ? column[tick] * (1 - part) + column[tick + 1] * part : column[tick];
  }

  // When a car had come so far, s, by a tick; null where it had not, or was beyond from the start. Its distance never falls much.
  function timeAt(car, distance, last = time.length - 1) {
    const column = samples.distance[car];
    const next = indexOf(column, distance, last);
    if (!(column[next] >= distance)) return null;
    if (!next) return column[0] === distance ? time[0] : null;
    const part = (distance - column[next - 1]) / (column[next] - column[next - 1] || 1);
    return time[next - 1] + Math.min(Math.max(part, 0), 1) * (time[next] - time[next - 1]);
  }

  // Seconds since the car in front of all was where this car is now.
  function gap(car, leader, tick) {
    const there = timeAt(leader, samples.distance[car][tick], tick);
    return there === null ? 0 : Math.max(time[tick] - there, 0);
  }

  return {
    race, circuit, cars, time, samples, line, ground, tickAt, moment, value, timeAt, gap,
    end: time.at(-1) ?? 0,
    drives: (car, tick) => samples.driving[car][tick] !== 0,
    order: (tick) => [...Array(cars).keys()].sort((a, b) => samples.place[a][tick] - samples.place[b][tick]),
  };
}

// What is painted on a car: people count from 1.
const startNumber = (car) => String(car + 1);

// A difference with its sign; what rounds to zero has no minus.
function difference(value, digits) {
  const text = Math.abs(value).toFixed(digits);
  return `${value < 0 && Number(text) > 0 ? "−" : "+"}${text}`;
}

function clock(seconds) {
  const tenths = Math.max(Math.round(seconds * 10), 0);
  return `${Math.floor(tenths / 600)}:${String(Math.floor(tenths / 10) % 60).padStart(2, "0")}.${tenths % 10}`;
}
