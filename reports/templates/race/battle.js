// What is worth watching in a race: the closest gap, and contacts.

const NEAR_M = 40; // from the followed car, along the lap
const LEADERS = 5;
const HARD_M_S = 1; // closing speed beyond which a contact counts
export const SLOW = { rate: 0.25, before: 1.5, after: 2.5 }; // s around a contact

/** @typedef {import("./recording.js").Recording} Recording */

/**
 * The followed car, or else the first one.
 * @param {Recording} recording
 * @param {number} tick
 * @param {number} followed the car; -1 for none
 */
export const watchedCar = (recording, tick, followed) => (followed >= 0 ? followed : recording.order(tick)[0]);

/**
 * Two cars, one behind the other, with the least distance between them: of those near the followed car, or of the first five
 * where none is followed; of equal ones the foremost. A car alone is its own battle.
 * @param {Recording} recording
 * @param {number} tick
 * @param {number} followed the car; -1 for none
 */
export function battleAt(recording, tick, followed) {
  const { samples: { distance } } = recording;
  const racing = recording.order(tick).filter((car) => recording.drives(car, tick));
  const near = followed < 0 ? racing.slice(0, LEADERS) : racing.filter((car) => Math.abs(distance[car][tick] - distance[followed][tick]) < NEAR_M);
  let [best, least] = [[watchedCar(recording, tick, followed)], Infinity];
  for (let i = 1; i < near.length; i++) {
    const apart = Math.abs(distance[near[i - 1]][tick] - distance[near[i]][tick]);
    if (apart < least) [best, least] = [[near[i - 1], near[i]], apart];
  }
  return best;
}

/**
 * Whether a contact of or near the followed car, or any where none is followed, is about to come or has just been.
 * @param {Recording} recording
 * @param {number} now s
 * @param {number} followed the car; -1 for none
 */
export function nearContact(recording, now, followed) {
  const { samples: { distance } } = recording;
  return recording.race.incidents.some(({ kind, closing, time, cars }) => {
    if (kind !== "contact" || closing <= HARD_M_S || now < time - SLOW.before || now > time + SLOW.after) return false;
    const tick = recording.tickAt(time);
    return followed < 0 || cars.some((car) => Math.abs(distance[car][tick] - distance[followed][tick]) < NEAR_M);
  });
}
