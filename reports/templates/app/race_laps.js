// A recorded race by distance: who was where first, and laps laid over each other.

const GRID_M = 100;
const TRACE_M = 15;

// Of every car where it came by every GRID_M of the race: laps from the line, s behind the first there, and place.
export function passings(recording) {
  const { race, circuit, cars, samples } = recording;
  const furthest = Math.max(0, ...samples.distance.map((column) => column.at(-1) ?? 0));
  const rows = [];
  for (let distance = GRID_M; distance <= furthest; distance += GRID_M) {
    const there = Array.from({ length: cars }, (_, car) => ({ car, time: recording.timeAt(car, distance) }))
      .filter(({ time }) => time !== null)
      .sort((a, b) => a.time - b.time);
    there.forEach(({ car, time }, i) => rows.push({ car, time, lap: (distance + race.origin) / circuit.lap, place: i + 1, gap: time - there[0].time }));
  }
  return rows;
}

// The laps that were driven from line to line, the fastest first; without the first, which begins at a standstill,
// if there are others.
export function lapsOf({ race, circuit, cars, samples, timeAt }) {
  const laps = [];
  for (let car = 0; car < cars; car++) {
    const end = samples.distance[car].at(-1);
    for (let lap = 1, from = -race.origin; from + circuit.lap <= end; lap++, from += circuit.lap) {
      const start = timeAt(car, from);
      if (start !== null) laps.push({ car, lap, from, start, seconds: timeAt(car, from + circuit.lap) - start, key: `${car}.${lap}` });
    }
  }
  const flying = laps.filter(({ lap }) => lap > 1);
  return (flying.length ? flying : laps).sort((a, b) => a.seconds - b.seconds);
}

// Speed and time of a lap by the way since the line.
export function traceOf(recording, { car, from, start }) {
  const rows = [];
  for (let distance = 0; distance <= recording.circuit.lap; distance += TRACE_M) {
    const time = recording.timeAt(car, from + distance);
    if (time === null) break;
    rows.push({ distance, seconds: time - start, speed: 3.6 * recording.value("speed", car, ...recording.moment(time)) });
  }
  return rows;
}
