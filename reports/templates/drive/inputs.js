// What the person does: keys, a gamepad, or a wheel with pedals that has been calibrated.

/** @type {Record<string, "left" | "right" | "throttle" | "brake">} */
const KEYS = {
  ArrowLeft: "left", KeyA: "left", ArrowRight: "right", KeyD: "right",
  ArrowUp: "throttle", KeyW: "throttle", ArrowDown: "brake", KeyS: "brake",
};
const DEAD = 0.06; // of a stick, about its middle
const MOVED = 0.4; // change of an axis or a button by which calibration knows it
const STORED = "nathlon drive: ";
const STEPS = [
  ["left", "Turn the wheel or stick all the way to the left."],
  ["right", "Now all the way to the right."],
  ["throttle", "Let the wheel go and press the throttle all the way."],
  ["brake", "Let the throttle go and press the brake all the way."],
];

export const kept = {
  read(name, otherwise) {
    try {
      return JSON.parse(localStorage.getItem(STORED + name) ?? "null") ?? otherwise;
    } catch {
      return otherwise;
    }
  },
  write(name, value) {
    try {
      localStorage.setItem(STORED + name, JSON.stringify(value));
    } catch {
      // A browser that keeps nothing asks again.
    }
  },
};

export const pads = () => [...navigator.getGamepads()].filter((pad) => pad !== null).filter((pad) => pad.connected);
/** @param {Gamepad} pad */
const numbers = (pad) => [...pad.axes, ...pad.buttons.map((button) => button.value)];

/**
 * @typedef {{ index: number, from: number, to: number }} Control a number of a gamepad, and its ends
 * @typedef {{ wheel: Control, throttle: Control, brake: Control }} Calibration
 * @typedef {{ keys: boolean, steering: number, throttle: number, brake: number }} Driven
 */

/**
 * Where a control stands between two ends, from 0 to 1.
 * @param {number[]} values
 * @param {Control} control
 */
const share = (values, { index, from, to }) => Math.min(Math.max((values[index] - from) / (to - from || 1), 0), 1);

/**
 * Steering, throttle and brake of a gamepad by its calibration, or of a standard one without.
 * @param {Gamepad} pad
 * @param {Calibration | null} calibration
 * @returns {Driven | null}
 */
function readPad(pad, calibration) {
  const values = numbers(pad);
  if (calibration) {
    const middle = 1 - 2 * share(values, calibration.wheel);
    return { keys: false, steering: middle, throttle: share(values, calibration.throttle), brake: share(values, calibration.brake) };
  }
  if (pad.mapping !== "standard") return null;
  const stick = -pad.axes[0];
  const beyond = Math.max(Math.abs(stick) - DEAD, 0) / (1 - DEAD);
  return {
    keys: false,
    steering: Math.sign(stick) * beyond ** 1.5,
    throttle: pad.buttons[7].value,
    brake: pad.buttons[6].value,
  };
}

/**
 * The control that has moved furthest since `rest`.
 * @param {number[]} rest
 * @param {number[]} values
 */
function moved(rest, values) {
  let index = 0;
  values.forEach((value, i) => {
    if (Math.abs(value - rest[i]) > Math.abs(values[index] - rest[index])) index = i;
  });
  return { index, from: rest[index], to: values[index] };
}

/**
 * Steps of a calibration: `press` notes where the controls stand; the calibration once it is whole, else null.
 * @param {Gamepad} pad
 */
export function newCalibration(pad) {
  const rest = numbers(pad);
  let step = 0;
  const ends = /** @type {{ left: Control, right: number, throttle: Control, brake: Control }} */ ({});
  return {
    get words() {
      return STEPS[step]?.[1];
    },
    /** @param {Gamepad} now */
    moves: (now) => step === 1 || Math.abs(moved(rest, numbers(now)).to - moved(rest, numbers(now)).from) > MOVED,
    /**
     * @param {Gamepad} now
     * @returns {Calibration | null}
     */
    press(now) {
      const values = numbers(now);
      if (step === 1) ends.right = values[ends.left.index];
      else ends[/** @type {"left" | "throttle" | "brake"} */ (STEPS[step][0])] = moved(rest, values);
      step += 1;
      if (step < STEPS.length) return null;
      const { left, right, throttle, brake } = ends;
      return { wheel: { index: left.index, from: left.to, to: right }, throttle, brake };
    },
  };
}

/** @param {() => void} onChange */
export function newInputs(onChange) {
  const down = new Set();
  let device = kept.read("device", "keys");
  addEventListener("keydown", (event) => {
    // What has just been hidden keeps the focus until the page is drawn again.
    const elsewhere = event.target instanceof Element && event.target.closest("input, select, button, dialog")?.checkVisibility();
    if (!(event.code in KEYS) || elsewhere) return;
    event.preventDefault();
    if (down.has(event.code)) return;
    down.add(event.code);
    onChange();
  });
  addEventListener("keyup", (event) => {
    if (down.delete(event.code)) onChange();
  });
  // Keys that are let go elsewhere are never told of.
  addEventListener("blur", () => down.clear());
  const held = (what) => [...down].some((code) => KEYS[code] === what);
  const byKeys = () => ({
    keys: true, steering: Number(held("left")) - Number(held("right")), throttle: Number(held("throttle")), brake: Number(held("brake")),
  });
  return {
    get device() {
      return device;
    },
    choose(id) {
      device = id;
      kept.write("device", id);
    },
    /**
     * Keys always work, also where a pad is chosen.
     * @returns {Driven}
     */
    read() {
      const pad = device === "keys" || down.size ? null : pads().find(({ id }) => id === device);
      return (pad && readPad(pad, kept.read(`calibration of ${pad.id}`, null))) ?? byKeys();
    },
  };
}
