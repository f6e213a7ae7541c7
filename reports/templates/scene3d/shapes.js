// Meshes: triangles of lit corners, 20 bytes each: place, normal and what kind of surface it is, colour.

import { cross, inner, minus, unit } from "./cameras.js";

export const CORNER_BYTES = 20;
// How a surface is lit: as it is; in the paint of an entrant, or its accent where the livery has one; brake lights; glass; with grain.
export const LOOK = { plain: 0, paint: 1, stripe: 2, sill: 3, brake: 4, glass: 5, road: 6, grass: 7, unlit: 8 };
// Where the sun stands, and how bright it and the sky are; the last on what looks down.
export const SUN = [0.46, 0.34, 0.82];
export const LIGHT = { sun: [0.72, 0.69, 0.63], sky: [0.42, 0.47, 0.55], ground: [0.3, 0.3, 0.27] };
const CREASE = 0.55; // cosine of the angle up to which faces share normals

export function rgb(css) {
  return [1, 3, 5].map((at) => parseInt(css.slice(at, at + 2), 16));
}

function normalOf(a, b, c) {
  const [u, v] = [minus(b, a), minus(c, a)];
  return unit(cross(u, v));
}

/**
 * @typedef {import("./cameras.js").Place} Place
 * @typedef {number[] | number[][]} Colour
 * @typedef {ReturnType<typeof newMesh>} Mesh
 */

// How much of a colour's part (0 red, 1 green, 2 blue) light gives back from a face.
function lightOn(normal, part) {
  const up = 0.5 + 0.5 * normal[2];
  return LIGHT.sun[part] * Math.max(inner(normal, SUN), 0) + LIGHT.ground[part] * (1 - up) + LIGHT.sky[part] * up;
}

// Faces with a colour (red, green, blue and, where it is not whole, opacity; or one for each corner) and a look; `data` packs them.
export function newMesh() {
  const faces = [];
  return {
    /** @type {(a: Place, b: Place, c: Place, colour: Colour, look?: number, normal?: Place | null) => void} */
    triangle(a, b, c, colour, look = LOOK.plain, normal = null) {
      const own = normalOf(a, b, c);
      // Seen from the side to which its normal points.
      const points = normal && inner(own, normal) < 0 ? [a, c, b] : [a, b, c];
      faces.push({ points, colour: points[1] === b || !Array.isArray(colour[0]) ? colour : /** @type {Colour} */ ([colour[0], colour[2], colour[1]]), look, normal: normal ?? own, flat: normal !== null });
    },
    /** @type {(a: Place, b: Place, c: Place, d: Place, colour: Colour, look?: number, normal?: Place | null) => void} */
    quad(a, b, c, d, colour, look = LOOK.plain, normal = null) {
      this.triangle(a, b, c, colour, look, normal);
      this.triangle(a, c, d, colour, look, normal);
    },
    get count() {
      return 3 * faces.length;
    },
    // With `smooth`, corners in one place share the normals of faces that hardly differ. What is `baked` has its light in its colours.
    /** @param {{ smooth?: boolean, baked?: boolean }} how */
    data({ smooth = false, baked = false } = {}) {
      const around = new Map();
      const key = (point) => point.map((part) => Math.round(part * 500)).join();
      if (smooth) {
        for (const face of faces) {
          for (const point of face.points) {
            const at = key(point);
            if (around.has(at)) around.get(at).push(face.normal);
            else around.set(at, [face.normal]);
          }
        }
      }
      const bytes = new ArrayBuffer(3 * faces.length * CORNER_BYTES);
      const view = new DataView(bytes);
      let at = 0;
      const packed = (colour, facing, look) => {
        const [red, green, blue, opacity = 1] = colour;
        return [red, green, blue].map((part, k) => Math.min(part * (baked && look !== LOOK.unlit ? lightOn(facing, k) : 1), 255)).concat(255 * opacity);
      };
      for (const { points, colour, look, normal, flat } of faces) {
        const one = smooth || Array.isArray(colour[0]) ? null : packed(colour, normal, look);
        points.forEach((point, corner) => {
          const near = smooth && !flat ? around.get(key(point)).filter((other) => inner(other, normal) > CREASE) : [];
          const facing = near.length > 1 ? unit(near.reduce((sum, other) => sum.map((part, i) => part + other[i]), [0, 0, 0])) : normal;
          const shown = one ?? packed(Array.isArray(colour[0]) ? colour[corner] : colour, facing, look);
          for (let k = 0; k < 3; k++) {
            view.setFloat32(at + 4 * k, point[k], true);
            view.setInt8(at + 12 + k, Math.round(facing[k] * 127));
          }
          view.setInt8(at + 15, look);
          for (let k = 0; k < 4; k++) view.setUint8(at + 16 + k, shown[k]);
          at += CORNER_BYTES;
        });
      }
      return bytes;
    },
  };
}

// Packed corners without those that are there twice, and which of them the triangles have.
export function shared(bytes) {
  const words = new Uint32Array(bytes);
  const size = CORNER_BYTES / 4;
  const [found, kept, order] = [new Map(), new Uint32Array(words.length), new Uint32Array(words.length / size)];
  for (let i = 0; i < order.length; i++) {
    const corner = words.subarray(size * i, size * (i + 1));
    const key = corner.join();
    const place = found.get(key) ?? found.size;
    if (place === found.size) {
      found.set(key, place);
      kept.set(corner, size * place);
    }
    order[i] = place;
  }
  return { corners: kept.subarray(0, size * found.size), order };
}

// A block from low corner to high corner; `lean` moves its top along x.
export function block(mesh, [x, y, z], [X, Y, Z], colour, look = LOOK.plain, lean = 0) {
  const [a, b, c, d] = [[x, y, z], [X, y, z], [X, Y, z], [x, Y, z]];
  const [e, f, g, i] = [[x + lean, y, Z], [X + lean, y, Z], [X + lean, Y, Z], [x + lean, Y, Z]];
  for (const side of [[a, b, f, e], [b, c, g, f], [c, d, i, g], [d, a, e, i], [e, f, g, i], [d, c, b, a]]) mesh.quad(side[0], side[1], side[2], side[3], colour, look);
}

// A skin over rings of as many points each, closed at both ends; `styled(k, i)` tells colour and look between point k and the next of ring
// i and the next. Points run so that the skin faces outwards.
export function loft(mesh, rings, styled) {
  const n = rings[0].length;
  for (let i = 0; i + 1 < rings.length; i++) {
    for (let k = 0; k < n; k++) {
      const l = (k + 1) % n;
      mesh.quad(rings[i][k], rings[i + 1][k], rings[i + 1][l], rings[i][l], ...styled(k, i));
    }
  }
  for (const [i, ring] of [[0, rings[0]], [rings.length - 2, rings.at(-1).toReversed()]]) {
    for (let k = 1; k + 1 < n; k++) mesh.triangle(ring[0], ring[k], ring[k + 1], ...styled(0, i));
  }
}

// A body turned about the axis along y: `profile` holds places on the axis and radii.
export function lathe(mesh, profile, parts, colour) {
  const at = ([y, radius], k) => [radius * Math.cos((2 * Math.PI * k) / parts), y, radius * Math.sin((2 * Math.PI * k) / parts)];
  for (let i = 0; i + 1 < profile.length; i++) {
    for (let k = 0; k < parts; k++) {
      const [a, b] = [profile[i], profile[i + 1]];
      if (a[1] > 0) mesh.triangle(at(a, k), at(b, k + 1), at(a, k + 1), colour);
      if (b[1] > 0) mesh.triangle(at(a, k), at(b, k), at(b, k + 1), colour);
    }
  }
}

// Numbers that look drawn, the same each time.
export function drawn(seed) {
  let state = seed;
  return () => {
    state = (state * 16807) % 2147483647;
    return state / 2147483647;
  };
}
