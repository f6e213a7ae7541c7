// Meshes of circuit and cars: triangles of coloured corners, 16 bytes each; alpha says how much a car's own colour counts.

export const CORNER_BYTES = 16;
const SUN = [0.42, 0.3, 0.86];
const WALL_M = 1.0;
const ZONE = [150, 122, 62]; // where penalties are served
const PLAIN_M = 3000;
const TREE_GAP_M = 14;
const TREE_ROOM_M = 22;

export function rgb(css) {
  return [1, 3, 5].map((at) => parseInt(css.slice(at, at + 2), 16));
}

export function newMesh() {
  const corners = [];
  const add = (point, colour, own) => corners.push(...point, ...colour, own);
  const shaded = (a, b, c, colour) => {
    const [u, v] = [[0, 1, 2].map((i) => b[i] - a[i]), [0, 1, 2].map((i) => c[i] - a[i])];
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const light = Math.abs((n[0] * SUN[0] + n[1] * SUN[1] + n[2] * SUN[2]) / (Math.hypot(...n) || 1));
    return colour.map((part) => Math.min(part * (0.55 + 0.5 * light), 255));
  };
  return {
    triangle(a, b, c, colour, own = 0) {
      const lit = shaded(a, b, c, colour);
      for (const point of [a, b, c]) add(point, lit, own);
    },
    quad(a, b, c, d, colour, own = 0) {
      this.triangle(a, b, c, colour, own);
      this.triangle(a, c, d, colour, own);
    },
    get count() {
      return corners.length / 7;
    },
    get data() {
      const bytes = new ArrayBuffer((corners.length / 7) * CORNER_BYTES);
      const view = new DataView(bytes);
      for (let i = 0; i * 7 < corners.length; i++) {
        for (let k = 0; k < 3; k++) view.setFloat32(i * CORNER_BYTES + 4 * k, corners[i * 7 + k], true);
        for (let k = 0; k < 3; k++) view.setUint8(i * CORNER_BYTES + 12 + k, corners[i * 7 + 3 + k]);
        view.setUint8(i * CORNER_BYTES + 15, corners[i * 7 + 6] * 255);
      }
      return bytes;
    },
  };
}

// The ground, kerbs, walls and trees of a circuit; `line` holds points by name, `ground` surfaces by row.
export function circuitMesh({ circuit, line, ground }) {
  const mesh = newMesh();
  const n = circuit.rows;
  const at = (name, i, up = 0) => [line[name].x[i], line[name].y[i], line[name].z[i] + up];
  const toward = (a, b, metres) => {
    const far = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
    return a.map((part, i) => part + ((b[i] - part) * metres) / far);
  };
  const road = rgb(circuit.road);
  const dim = (colour, i, every) => colour.map((part) => part * (Math.floor(i / every) % 2 ? 0.93 : 1));
  for (let i = 0; i < n; i++) {
    const j = (i + 1) % n;
    const strip = (first, second, colour) => mesh.quad(at(first, i), at(second, i), at(second, j), at(first, j), colour);
    for (const [side, row] of [["left", 0], ["right", 1]]) {
      const [edge, kerb, wall] = [side, `kerb_${side}`, `wall_${side}`];
      strip(wall, kerb, dim(rgb(circuit.surfaces[ground[row][i]]), i, 5));
      if (Math.hypot(line[edge].x[i] - line[kerb].x[i], line[edge].y[i] - line[kerb].y[i]) > 0.1) {
        strip(kerb, edge, rgb(circuit.kerb[(i >> 1) % 2]));
      }
      mesh.quad(at(wall, i), at(wall, j), at(wall, j, WALL_M), at(wall, i, WALL_M), i % 12 < 6 ? [176, 181, 188] : [150, 156, 166]);
      const out = (k) => {
        const away = toward(at(wall, k), at(edge, k), -90);
        return [away[0], away[1], line[wall].z[k] - 9];
      };
      mesh.quad(at(wall, i), at(wall, j), out(j), out(i), dim([70, 96, 62], i, 9));
    }
    strip("left", "right", dim(ground[2][i] ? ZONE : road, i, 6));
    for (const [side, other] of [["left", "right"], ["right", "left"]]) {
      const [a, b] = [at(side, i, 0.02), at(side, j, 0.02)];
      mesh.quad(a, b, toward(b, at(other, j, 0.02), 0.2), toward(a, at(other, i, 0.02), 0.2), [225, 226, 222]);
    }
  }
  layPlain(mesh, line);
  paintStart(mesh, at, toward);
  plantTrees(mesh, at, toward, line, n, circuit.lap / n);
  return mesh;
}

// The land below all else, as far as one sees.
function layPlain(mesh, { wall_left: left, wall_right: right }) {
  const ends = (part) => [left, right].flatMap((wall) => [Math.min(...wall[part]), Math.max(...wall[part])]);
  const [[x, X], [y, Y], [z]] = ["x", "y", "z"].map((part) => [Math.min(...ends(part)), Math.max(...ends(part))]);
  const [west, east, south, north, low] = [x - PLAIN_M, X + PLAIN_M, y - PLAIN_M, Y + PLAIN_M, z - 12];
  mesh.quad([west, south, low], [east, south, low], [east, north, low], [west, north, low], [70, 96, 62]);
}

function paintStart(mesh, at, toward) {
  const [left, right] = [at("left", 0, 0.03), at("right", 0, 0.03)];
  const [next, last] = [at("left", 1, 0.03), at("right", 1, 0.03)];
  const wide = Math.hypot(left[0] - right[0], left[1] - right[1]);
  for (let m = 0; m < wide - 0.5; m += 1) {
    const ends = (from, to) => [toward(from, to, m), toward(from, to, m + 1)];
    const [[a, b], [c, d]] = [ends(left, right), ends(next, last)];
    mesh.quad(a, b, d, c, m % 2 ? [245, 245, 245] : [25, 25, 28]);
  }
}

function plantTrees(mesh, at, toward, line, n, spacing) {
  const cells = new Map();
  const cell = (x, y) => `${Math.floor(x / TREE_ROOM_M)} ${Math.floor(y / TREE_ROOM_M)}`;
  for (let i = 0; i < n; i++) cells.set(cell((line.left.x[i] + line.right.x[i]) / 2, (line.left.y[i] + line.right.y[i]) / 2), true);
  const free = (x, y) => {
    for (const dx of [-1, 0, 1]) for (const dy of [-1, 0, 1]) if (cells.has(cell(x + dx * TREE_ROOM_M, y + dy * TREE_ROOM_M))) return false;
    return true;
  };
  let seed = 7;
  const chance = () => {
    seed = (seed * 16807) % 2147483647;
    return seed / 2147483647;
  };
  const every = Math.max(Math.round(TREE_GAP_M / spacing), 1);
  for (let i = 0; i < n; i += every) {
    for (const side of ["left", "right"]) {
      const foot = toward(at(`wall_${side}`, i), at(side, i), -(5 + 45 * chance()));
      const [size, shade] = [4 + 5 * chance(), 0.75 + 0.4 * chance()];
      if (!free(foot[0], foot[1])) continue;
      const base = line[`wall_${side}`].z[i] - 4;
      const top = [foot[0], foot[1], base + 4 + 1.7 * size];
      const ring = [0, 1, 2, 3, 4].map((k) => [
        foot[0] + 0.42 * size * Math.cos(k * 1.2566), foot[1] + 0.42 * size * Math.sin(k * 1.2566), base + 3,
      ]);
      ring.forEach((point, k) => mesh.triangle(point, ring[(k + 1) % 5], top, [46, 84, 48].map((part) => part * shade)));
    }
  }
}

// A car on its wheels, nose along x: its body, and from `cabin` on what the driver sits under.
export function carMesh(length, width) {
  const mesh = newMesh();
  const [h, s] = [length / 2, width / 2];
  // A prism between two outlines in the plane of x and z, as wide as each says.
  const hull = (points, colour, own) => {
    const side = (sign) => points.map(([x, z, wide]) => [x * h, sign * wide * s, z]);
    const [left, right] = [side(1), side(-1)];
    points.forEach((_, k) => {
      const next = (k + 1) % points.length;
      mesh.quad(left[k], left[next], right[next], right[k], colour, own);
      if (k > 1) {
        mesh.triangle(left[0], left[k - 1], left[k], colour, own);
        mesh.triangle(right[0], right[k - 1], right[k], colour, own);
      }
    });
  };
  hull([[-0.98, 0.3, 0.92], [-1, 0.72, 0.88], [-0.55, 0.8, 0.94], [0.25, 0.76, 0.92], [0.85, 0.58, 0.86], [1, 0.38, 0.72], [0.98, 0.16, 0.74], [-0.9, 0.16, 0.9]], [235, 235, 235], 1);
  for (const x of [-0.6, 0.62]) {
    for (const y of [-1, 1]) {
      const ring = [...Array(10).keys()].map((k) => [x * h + 0.34 * Math.cos(k * 0.628), 0.34 + 0.34 * Math.sin(k * 0.628)]);
      ring.forEach(([a, b], k) => {
        const [c, d] = ring[(k + 1) % 10];
        mesh.quad([a, y * s * 0.7, b], [c, y * s * 0.7, d], [c, y * s, d], [a, y * s, b], [30, 31, 34]);
        mesh.triangle([x * h, y * s, 0.34], [a, y * s, b], [c, y * s, d], [52, 54, 58]);
      });
    }
  }
  mesh.quad([-h, s, 1.12], [-h, -s, 1.12], [-0.86 * h, -s, 1.14], [-0.86 * h, s, 1.14], [30, 33, 38]);
  for (const y of [-1, 1]) {
    mesh.quad([-h, y * s, 0.95], [-0.84 * h, y * s, 0.95], [-0.84 * h, y * s, 1.2], [-h, y * s, 1.2], [30, 33, 38]);
    const lamp = (x, z, from, to, colour) => mesh.quad([x, y * from * s, z], [x, y * to * s, z], [x, y * to * s, z + 0.12], [x, y * from * s, z + 0.12], colour);
    lamp(-1.005 * h, 0.55, 0.45, 0.82, [190, 32, 30]);
    lamp(0.985 * h, 0.38, 0.42, 0.68, [250, 246, 220]);
  }
  const cabin = mesh.count;
  hull([[-0.62, 0.78, 0.82], [-0.36, 1.16, 0.64], [0.02, 1.18, 0.62], [0.36, 0.75, 0.8]], [28, 34, 42], 0);
  hull([[-0.35, 1.17, 0.6], [0.02, 1.19, 0.6], [0.02, 1.17, 0.6], [-0.35, 1.15, 0.6]], [235, 235, 235], 1);
  return { mesh, cabin };
}
