// How finely the scene is drawn while it moves: so that 20 pictures a second come without a graphics card too.

const SLOW_MS = 45; // between two pictures, with some room
const FAST_MS = 24;
const COUNTED = 5; // pictures, of whose times the middle one counts
const BACK_MS = 20_000; // for so long it stays as coarse as it has become

// Parts of the canvas's width and height, and how far away trees and stands are seen, m.
const FINE = { share: 1, standing: 600 };
const LEVELS = [FINE, { share: 0.7, standing: 350 }, { share: 0.5, standing: 220 }, { share: 0.36, standing: 140 }];

export function newPace() {
  let level = 0;
  let last = -Infinity;
  let barred = -Infinity;
  /** @type {number[]} */
  let times = [];
  /**
   * How a picture that is begun now is drawn. What stands still is drawn as finely as can be.
   * @param {number} now ms
   * @param {boolean} moving whether it follows the one before
   */
  return (now, moving) => {
    const time = now - last;
    last = moving ? now : -Infinity;
    if (!moving) return FINE;
    if (time < Infinity) times.push(time);
    if (times.length < COUNTED) return LEVELS[level];
    const middle = times.sort((a, b) => a - b)[COUNTED >> 1];
    times = [];
    if (middle > SLOW_MS) [level, barred] = [Math.min(level + (middle > 2 * SLOW_MS ? 2 : 1), LEVELS.length - 1), now + BACK_MS];
    else if (middle < FAST_MS && now > barred) level = Math.max(level - 1, 0);
    return LEVELS[level];
  };
}
