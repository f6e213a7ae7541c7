// Cameras: where they are (eye, target, up, vertical angle of view), and the matrices of what they see.

/**
 * @typedef {number[]} Place x, y and z, m
 * @typedef {{ eye: Place, target: Place, up: Place, fov: number, near?: number }} Camera
 * @typedef {{ x: number, y: number, z: number, yaw: number, pitch: number, roll: number }} Pose
 */

const CHASE = { back: 6.4, up: 2.3, look: 7, fov: 0.95 };
const COCKPIT_FOV = 1.1;
// Where the driver's eyes are, m ahead of the middle and above the road, by the car's model.
/** @type {Record<string, { ahead: number, up: number }>} */
export const EYES = { gt3: { ahead: 0.0, up: 1.06 }, coupe: { ahead: 0.05, up: 1.14 }, prototype: { ahead: 0.15, up: 0.9 } };
const MIRROR_FOV = 0.5;

/**
 * @param {ArrayLike<number>} a
 * @param {ArrayLike<number>} b
 */
export function multiply(a, b) {
  const out = new Float32Array(16);
  for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) out[c * 4 + r] += a[k * 4 + r] * b[c * 4 + k];
  return out;
}

/**
 * @param {Camera} camera
 * @param {number} aspect width by height
 * @param {boolean} mirrored
 */
export function perspective({ fov, near = 0.2 }, aspect, mirrored) {
  const [far, f] = [4000, 1 / Math.tan(fov / 2)];
  return new Float32Array([(mirrored ? -f : f) / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0]);
}

/** @type {(a: Place, b: Place) => Place} */
export const minus = (a, b) => a.map((part, i) => part - b[i]);
/** @type {(a: Place, b: Place) => Place} */
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
/** @type {(a: Place, b: Place) => number} */
export const inner = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
/** @type {(a: Place) => Place} */
export const unit = (a) => a.map((part) => part / (Math.hypot(...a) || 1));

/** @param {Camera} camera */
export function lookAt({ eye, target, up }) {
  const back = unit(minus(eye, target));
  const right = unit(cross(up, back));
  const top = cross(back, right);
  return new Float32Array([right[0], top[0], back[0], 0, right[1], top[1], back[1], 0, right[2], top[2], back[2], 0, -inner(right, eye), -inner(top, eye), -inner(back, eye), 1]);
}

/**
 * Tells whether what lies within `reach` of a place, and no farther away than `most`, may be in the picture.
 * @param {Camera} camera
 * @param {number} aspect width by height
 * @returns {(centre: Place, reach: number, most?: number) => boolean}
 */
export function within({ eye, target, fov }, aspect) {
  const ahead = unit(minus(target, eye));
  const corner = Math.atan(Math.tan(fov / 2) * Math.hypot(1, aspect));
  return (centre, reach, most = Infinity) => {
    const to = minus(centre, eye);
    const [far, along] = [Math.hypot(...to), inner(to, ahead)];
    const aside = Math.sqrt(Math.max(far ** 2 - along ** 2, 0));
    return far - reach < most && aside * Math.cos(corner) - along * Math.sin(corner) <= reach;
  };
}

/**
 * Axes of a car in the world: forward, left, up.
 * @param {Pose} car
 */
function axes({ yaw, pitch, roll }) {
  const forward = [Math.cos(yaw) * Math.cos(pitch), Math.sin(yaw) * Math.cos(pitch), -Math.sin(pitch)];
  const level = [-Math.sin(yaw), Math.cos(yaw), 0];
  const left = unit([level[0] * Math.cos(roll), level[1] * Math.cos(roll), Math.sin(roll)]);
  return [forward, left, cross(forward, left)];
}

/** @param {Pose} car */
export function modelOf(car) {
  const [f, l, u] = axes(car);
  return new Float32Array([...f, 0, ...l, 0, ...u, 0, car.x, car.y, car.z, 1]);
}

/**
 * A point of the world in a picture: x and y from -1 to 1, and how far ahead it is.
 * @param {Float32Array} matrix
 * @param {Place} place
 */
export function projected(matrix, [x, y, z]) {
  const [across, up, , ahead] = [0, 1, 2, 3].map((r) => matrix[r] * x + matrix[4 + r] * y + matrix[8 + r] * z + matrix[12 + r]);
  return [across / ahead, up / ahead, ahead];
}

/**
 * A place beside a car's origin, so far ahead, above and to the left.
 * @param {Pose} car
 * @param {number} ahead m
 * @param {number} above m
 * @param {number} aside m
 * @returns {Place}
 */
export function besideCar(car, ahead, above, aside = 0) {
  const [forward, left, up] = axes(car);
  return [car.x, car.y, car.z].map((part, i) => part + forward[i] * ahead + up[i] * above + left[i] * aside);
}

/**
 * From behind a car, in the direction `heading`.
 * @param {Pose & { speed: number }} car
 * @param {number} heading rad
 * @returns {Camera}
 */
export function chaseCamera(car, heading) {
  const [forward] = axes(car);
  const eye = [car.x - CHASE.back * Math.cos(heading), car.y - CHASE.back * Math.sin(heading), car.z + CHASE.up - CHASE.back * forward[2]];
  return { eye, target: besideCar(car, CHASE.look, 0.8), up: [0, 0, 1], fov: CHASE.fov + Math.min(car.speed / 90, 1) * 0.2 };
}

/**
 * @param {Pose} car
 * @param {string} kind of its model
 * @returns {Camera}
 */
export function cockpitCamera(car, kind) {
  const { ahead, up } = EYES[kind];
  return { eye: besideCar(car, ahead, up), target: besideCar(car, 30, up - 1.4), up: axes(car)[2], fov: COCKPIT_FOV, near: 0.08 };
}

/**
 * @param {Pose} car
 * @param {number} length of cars, m
 * @param {-1 | 0 | 1} side of the mirror: right, middle, left
 * @returns {Camera}
 */
export function mirrorCamera(car, length, side) {
  return { eye: besideCar(car, -0.4 * length, 1.25, side), target: besideCar(car, -30, 0.9, 8 * side), up: [0, 0, 1], fov: MIRROR_FOV };
}
