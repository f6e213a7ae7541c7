// The connection to the server, and the race as its frames tell it.

const DOING = ["out", "driving", "finished"];
const PHASES = ["countdown", "racing", "paused", "over"];
const BEHIND_S = 2.5 / 60; // drawn so far behind the latest frame: there are then two to draw between
const DRIFT = 0.002; // share of the time by which a clock that runs ahead is held back
const HEAD_BYTES = 52;
const CAR_BYTES = 40;
const TOKEN = "nathlon room: token"; // under which the committee's room keeps it for the tab

/**
 * @typedef {import("../scene3d/view.js").DrawnCar & {
 *   progress: number, gap: number, throttle: number, brake: number, place: number, doing: string,
 * }} FrameCar
 * @typedef {{
 *   tick: number, number: number, time: number, phase: string, offCourse: boolean, warnings: number, steering: number, rpm: number,
 *   gear: number, laps: number, lap: number, lastLap: number, bestLap: number, penalty: number, sliding: number, cars: FrameCar[],
 * }} Frame
 */

/**
 * A frame as nathlon/lab/drive/frames.py lays it out.
 * @param {ArrayBuffer} buffer
 */
function readFrame(buffer) {
  const view = new DataView(buffer);
  /** @param {number} at */
  const float = (at) => view.getFloat32(at, true);
  /** @type {Frame} */
  const frame = {
    tick: view.getUint32(0, true), number: view.getUint32(4, true), time: float(8),
    phase: PHASES[view.getUint8(12)], offCourse: view.getUint8(14) > 0, warnings: view.getUint8(15),
    steering: float(16), rpm: float(20), gear: view.getUint32(24, true), laps: view.getUint32(28, true),
    lap: float(32), lastLap: float(36), bestLap: float(40), penalty: float(44), sliding: float(48),
    cars: [],
  };
  for (let car = 0; car < view.getUint8(13); car++) {
    const at = HEAD_BYTES + car * CAR_BYTES;
    frame.cars.push({
      x: float(at), y: float(at + 4), z: float(at + 8), yaw: float(at + 12), pitch: float(at + 16), roll: float(at + 20),
      speed: float(at + 24), progress: float(at + 28), gap: float(at + 32),
      throttle: view.getUint8(at + 36) / 255, brake: view.getUint8(at + 37) / 255,
      place: view.getUint8(at + 38), doing: DOING[view.getUint8(at + 39)],
    });
  }
  return frame;
}

/** @type {("x" | "y" | "z" | "pitch" | "roll" | "speed" | "progress")[]} */
const SMOOTH = ["x", "y", "z", "pitch", "roll", "speed", "progress"];

/**
 * A frame between two, the share of the way to the second.
 * @param {Frame} first
 * @param {Frame} second
 * @param {number} share
 * @returns {Frame}
 */
function between(first, second, share) {
  /** @type {(a: number, b: number) => number} */
  const blend = (a, b) => a + (b - a) * share;
  return {
    ...second,
    time: blend(first.time, second.time),
    steering: blend(first.steering, second.steering),
    rpm: blend(first.rpm, second.rpm),
    cars: second.cars.map((car, i) => {
      const before = first.cars[i];
      const turn = Math.atan2(Math.sin(car.yaw - before.yaw), Math.cos(car.yaw - before.yaw));
      const made = { ...car, yaw: before.yaw + turn * share };
      for (const name of SMOOTH) made[name] = blend(before[name], car[name]);
      return made;
    }),
  };
}

// Frames as they come, and the race as it stood a moment ago; `now` is in seconds of any clock that goes on.
export function newPlayback() {
  /** @type {Frame[]} */
  let frames = [];
  /** @type {number | null} */
  let offset = null;
  return {
    /**
     * @param {Frame} frame
     * @param {number} now
     */
    take(frame, now) {
      if (frame.time < (this.latest?.time ?? -Infinity)) this.clear();
      frames.push(frame);
      if (frames.length > 30) frames.shift();
      const ahead = frame.time - now;
      // The frame that took the least time to come sets the clock.
      offset = offset === null || frame.phase !== "racing" ? ahead : Math.max(ahead, offset - DRIFT / 60);
    },
    /** @param {number} now */
    at(now) {
      if (offset === null) return null;
      const wanted = now + offset - BEHIND_S;
      const next = frames.findIndex((frame) => frame.time >= wanted);
      if (next < 0) return this.latest;
      if (next === 0) return frames[0];
      const [first, second] = [frames[next - 1], frames[next]];
      return between(first, second, (wanted - first.time) / (second.time - first.time || 1));
    },
    get latest() {
      return frames.at(-1) ?? null;
    },
    clear() {
      [frames, offset] = [[], null];
    },
  };
}

/**
 * A connection that comes back by itself, unless another window has taken its place.
 * @param {{ address: string, token: string | null }} session
 * @param {{
 *   onWords: (words: any) => void, onFrame: (frame: Frame) => void, onState: (state: "open" | "taken" | "unknown" | "lost") => void,
 * }} hears
 */
export function connect(session, { onWords, onFrame, onState }) {
  /** @type {WebSocket} */
  let socket;
  let number = 0;
  const open = () => {
    socket = new WebSocket(session.address);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      number = 0;
      socket.send(session.token ?? sessionStorage.getItem(TOKEN) ?? "");
      onState("open");
    };
    socket.onmessage = ({ data }) => (typeof data === "string" ? onWords(JSON.parse(data)) : onFrame(readFrame(data)));
    socket.onclose = ({ code }) => {
      onState(code === 4000 ? "taken" : code === 4001 ? "unknown" : "lost");
      if (code !== 4000 && code !== 4001) setTimeout(open, 1000);
    };
  };
  open();
  const ready = () => socket.readyState === WebSocket.OPEN;
  return {
    /** @param {object} words */
    say: (words) => ready() && socket.send(JSON.stringify(words)),
    /**
     * As nathlon/lab/drive/input_buffer.py reads it.
     * @param {import("./inputs.js").Driven} driven
     */
    steer({ keys, steering, throttle, brake }) {
      if (!ready()) return;
      const view = new DataView(new ArrayBuffer(20));
      view.setUint32(0, ++number, true);
      view.setUint8(4, keys ? 1 : 0);
      for (const [i, value] of [steering, throttle, brake].entries()) view.setFloat32(8 + 4 * i, value, true);
      socket.send(view.buffer);
    },
  };
}
