// What the camera of a car showed, as reports/race_data.py packs it.

import { h } from "./element.js";
import { unpacked } from "./recording.js";

const WIDTH = 192;

/**
 * @typedef {object} SightData
 * @property {number} car
 * @property {number} width pixels
 * @property {number} height
 * @property {number} proportion how much wider than high it is shown
 * @property {number} first s
 * @property {number} between two pictures, s
 * @property {number} count
 * @property {number} step of colours
 * @property {string} pixels
 */

/**
 * A picture in a corner of a race, shown while a car is followed that sees by a camera.
 * @param {SightData[]} sights
 * @param {() => void} ready called when another picture can be shown
 */
export function sightOf(sights, ready) {
  const canvas = h("canvas", { class: "sight", role: "img", "aria-label": "What the driver of the followed car sees", hidden: true });
  /** @type {Map<number, Int32Array[] | null>} */
  const opened = new Map();

  /** @param {SightData} sight */
  function open(sight) {
    opened.set(sight.car, null);
    unpacked(sight.pixels, sight.count).then((rows) => {
      opened.set(sight.car, rows);
      ready();
    });
  }

  /** @param {{ now: number, followed: number }} state */
  function draw({ now, followed }) {
    const sight = sights.find((one) => one.car === followed);
    canvas.hidden = !sight;
    if (!sight) return;
    if (!opened.has(sight.car)) open(sight);
    const rows = opened.get(sight.car);
    const pen = canvas.getContext("2d");
    if (!rows || !pen) return;
    if (canvas.width !== sight.width || canvas.height !== sight.height) {
      canvas.width = sight.width;
      canvas.height = sight.height;
      canvas.style.width = `${WIDTH}px`;
      canvas.style.height = `${Math.round(WIDTH / sight.proportion)}px`;
    }
    const at = Math.min(Math.max(Math.round((now - sight.first) / sight.between), 0), sight.count - 1);
    const picture = pen.createImageData(sight.width, sight.height);
    for (let k = 0; k < rows.length; k++) {
      picture.data[4 * Math.floor(k / 3) + (k % 3)] = rows[k][at] * sight.step + sight.step / 2;
      picture.data[4 * Math.floor(k / 3) + 3] = 255;
    }
    pen.putImageData(picture, 0, 0);
  }

  return { node: canvas, draw };
}
