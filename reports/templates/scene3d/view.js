// The race in three dimensions, drawn by WebGL.

import { sized } from "../race/scene.js";
import { cross, EYES, lookAt, minus, mirrorCamera, modelOf, multiply, perspective, unit, within } from "./cameras.js";
import { carModel, LIVERIES, modelNamed, shadowModel, wheelModel } from "./car_models.js";
import { circuitPieces, meadow, UP } from "./circuit.js";
import { dashboard, handWheel, handWheelAt } from "./cockpit.js";
import { puffModel } from "./effects.js";
import { standing } from "./landscape.js";
import { CAR_VERTEX, compiled, FRAGMENT, layTextures, SCENERY_VERTEX, SKY_FRAGMENT, SKY_UNIT, SKY_VERTEX } from "./shaders.js";
import { newPace } from "./pace.js";
import { CORNER_BYTES, LOOK, newMesh, rgb, shared } from "./shapes.js";

// Mirrors: which side they are of, their middle and size as shares of the picture. Those of the doors are seen from the cockpit alone.
/** @type {{ side: -1 | 0 | 1, x: number, y: number, wide: number, high: number }[]} */
const MIRRORS = [{ side: 0, x: 0.5, y: 0.915, wide: 0.3, high: 0.13 }, { side: 1, x: 0.085, y: 0.36, wide: 0.13, high: 0.13 }, { side: -1, x: 0.915, y: 0.36, wide: 0.13, high: 0.13 }];
const FRAME = 0.006; // of a mirror, as a share of the picture's height
const LINE_M = [6, 220]; // how far ahead the racing line is shown
const SEEN_M = { mirrored: 200, wheels: 50, closely: 200 };
const SPOTS = ["place", "facing", "colour", "model0", "model1", "model2", "model3", "paint", "accent"];
const INSTANCE = { place: 16, paint: 20, accent: 24 }; // floats until the end of each
const STILL = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 1, 1, 0, 0, 0, 0, 0];
const MOST_MARKS = 24_000;

/**
 * @typedef {import("./cameras.js").Pose & { speed: number, brake: number, distance?: number, progress?: number, steering?: number }} DrawnCar
 * @typedef {{ place: number[], size: number, colour: number[], opacity: number }} Puff
 * @typedef {ReturnType<typeof viewBy>} View
 * @typedef {{ buffer: WebGLBuffer, count: number, order?: WebGLBuffer }} Loaded
 */

// Which parts a livery gives a second colour: the stripe over the middle, the sills.
const liveryOf = (name) => [...name.replace(/^\d+ /, "")].reduce((sum, letter) => (sum * 31 + letter.codePointAt(0)) % 9973, 7) % LIVERIES;

/**
 * A view on a canvas; null where the browser has no WebGL.
 * @param {HTMLCanvasElement} canvas
 */
export function newView(canvas) {
  // Smooth edges cost most where no graphics card draws them.
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: false, failIfMajorPerformanceCaveat: true }) ?? canvas.getContext("webgl2", { antialias: false, alpha: false });
  return gl && viewBy(gl, canvas);
}

/**
 * @param {WebGL2RenderingContext} gl
 * @param {HTMLCanvasElement} canvas
 */
function viewBy(gl, canvas) {
  const [scenery, polished] = [SCENERY_VERTEX, CAR_VERTEX].map((vertex) => compiled(gl, vertex, FRAGMENT, SPOTS));
  const heaven = compiled(gl, SKY_VERTEX, SKY_FRAGMENT, ["corner"]);
  const spots = Object.fromEntries(SPOTS.map((name, spot) => [name, spot]));
  const cameras = [scenery, polished].map((program) => gl.getUniformLocation(program, "camera"));
  const eye = gl.getUniformLocation(polished, "eye");
  const looking = Object.fromEntries(["ahead", "across", "above"].map((name) => [name, gl.getUniformLocation(heaven, name)]));
  layTextures(gl);
  gl.useProgram(heaven);
  gl.uniform1i(gl.getUniformLocation(heaven, "sky"), SKY_UNIT);
  gl.enable(gl.DEPTH_TEST);
  gl.depthFunc(gl.LEQUAL);
  gl.enable(gl.SCISSOR_TEST);
  gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  gl.polygonOffset(-2, -2);
  /** @type {(data: BufferSource | number, use?: number, kind?: number) => WebGLBuffer} */
  const buffer = (data, use = gl.STATIC_DRAW, kind = gl.ARRAY_BUFFER) => {
    const made = gl.createBuffer();
    gl.bindBuffer(kind, made);
    gl.bufferData(kind, /** @type {any} */ (data), use);
    return made;
  };
  /** @type {(mesh: import("./shapes.js").Mesh, how?: { smooth?: boolean, baked?: boolean }) => Loaded} */
  const load = (mesh, how = { baked: true }) => {
    const { corners, order } = shared(mesh.data(how));
    return { buffer: buffer(corners), count: order.length, order: buffer(order, gl.STATIC_DRAW, gl.ELEMENT_ARRAY_BUFFER) };
  };
  const screen = buffer(new Float32Array([-1, -1, 3, -1, -1, 3]));
  const moving = gl.createBuffer();
  const flowing = gl.createBuffer();
  let scene = /** @type {any} */ (null); // until `show`
  const pace = newPace();

  /**
   * Draws a mesh once for each instance: matrix, paint, accent.
   * @param {Loaded} mesh
   */
  function draw({ buffer: corners, count, order }, instances = STILL, held = null, [first, many] = [0, instances.length / INSTANCE.accent]) {
    if (!many || !count) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, corners);
    gl.vertexAttribPointer(spots.place, 3, gl.FLOAT, false, CORNER_BYTES, 0);
    gl.vertexAttribPointer(spots.facing, 4, gl.BYTE, false, CORNER_BYTES, 12);
    gl.vertexAttribPointer(spots.colour, 4, gl.UNSIGNED_BYTE, true, CORNER_BYTES, 16);
    gl.bindBuffer(gl.ARRAY_BUFFER, held ?? moving);
    if (!held) gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(instances), gl.STREAM_DRAW);
    [spots.model0, spots.model1, spots.model2, spots.model3, spots.paint, spots.accent].forEach((spot, k) => gl.vertexAttribPointer(spot, 4, gl.FLOAT, false, 4 * INSTANCE.accent, 4 * (INSTANCE.accent * first + 4 * k)));
    if (!order) return gl.drawArraysInstanced(gl.TRIANGLES, 0, count, many);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, order);
    gl.drawElementsInstanced(gl.TRIANGLES, count, gl.UNSIGNED_INT, 0, many);
  }

  function prepareScene() {
    for (const [name, spot] of Object.entries(spots)) {
      gl.enableVertexAttribArray(spot);
      gl.vertexAttribDivisor(spot, ["place", "facing", "colour"].includes(name) ? 0 : 1);
    }
  }

  // Things that stand along the lap, in pieces as the ground is.
  function planted({ meshes, places }) {
    const instances = new Float32Array(places.flatMap(({ matrix, tint }) => [...matrix, tint, tint, tint, 0, 0, 0, 0, 1]));
    const pieces = [];
    const size = 8;
    for (let first = 0; first < places.length; first += size) {
      const part = places.slice(first, first + size);
      const centre = [0, 1, 2].map((k) => part.reduce((sum, { at }) => sum + at[k] / part.length, 0));
      pieces.push({ range: [first, part.length], centre, reach: 15 + Math.max(...part.map(({ at }) => Math.hypot(...minus(at, centre)))) });
    }
    return { meshes: meshes.map((mesh) => load(mesh)), held: buffer(instances), pieces };
  }

  function show(made) {
    const kind = modelNamed(made.kind ?? "", made.length, made.width);
    const model = carModel(kind, made.length, made.width);
    scene = {
      made, kind, wheels: model.wheels, radius: model.radius,
      ground: circuitPieces(made).map(({ meshes, ...piece }) => ({ ...piece, meshes: meshes.map((mesh) => load(mesh)) })), meadow: load(meadow(made.line)),
      planted: standing(made).map(planted),
      body: load(model.body, { smooth: true }), cabin: load(model.glass, { smooth: true }), wheel: load(wheelModel(model.radius), { smooth: true }),
      shadow: load(shadowModel(made.length, made.width)), puff: load(puffModel()),
      dashboard: load(dashboard(EYES[kind]), {}), hand: load(handWheel(), { smooth: true }),
      marks: { buffer: buffer(MOST_MARKS * 6 * CORNER_BYTES, gl.DYNAMIC_DRAW), laid: 0 },
      paints: made.colours.map((colour, i) => {
        const paint = rgb(colour).map((part) => part / 255);
        const livery = liveryOf(made.names?.[i] ?? "");
        const bright = paint[0] * 0.3 + paint[1] * 0.6 + paint[2] * 0.1 > 0.62;
        return { paint, accent: [livery & 1, livery >> 1, bright ? 0.1 : 0.95, 0] };
      }),
    };
  }

  /**
   * Marks of tyres. The oldest make room.
   * @param {number[][][]} quads their corners
   */
  function layMarks(quads) {
    const mesh = newMesh();
    for (const [a, b, c, d] of quads) mesh.quad(a, b, c, d, [14, 14, 16, 0.5], LOOK.unlit, UP);
    const bytes = new Uint8Array(mesh.data());
    const { marks } = scene;
    gl.bindBuffer(gl.ARRAY_BUFFER, marks.buffer);
    quads.forEach((_, k) => gl.bufferSubData(gl.ARRAY_BUFFER, ((marks.laid + k) % MOST_MARKS) * 6 * CORNER_BYTES, bytes, k * 6 * CORNER_BYTES, 6 * CORNER_BYTES));
    marks.laid += quads.length;
  }

  function paintSky({ eye, target, up, fov }, aspect, mirrored) {
    gl.useProgram(heaven);
    const ahead = unit(minus(target, eye));
    const across = unit(cross(ahead, up));
    const above = cross(across, ahead);
    const half = Math.tan(fov / 2);
    gl.uniform3fv(looking.ahead, ahead);
    gl.uniform3fv(looking.across, across.map((part) => part * half * aspect * (mirrored ? -1 : 1)));
    gl.uniform3fv(looking.above, above.map((part) => part * half));
    for (const spot of Object.values(spots)) gl.disableVertexAttribArray(spot);
    gl.bindBuffer(gl.ARRAY_BUFFER, screen);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribDivisor(0, 0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  // Draws what a camera sees and returns its matrix. Of the own car a mirror shows nothing, and a camera within no cabin.
  function paint([x, y, width, height], camera, frame, { inside, mirrored = false, marks, line = -1, standing }) {
    gl.viewport(x, y, width, height);
    gl.scissor(x, y, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    prepareScene();
    const matrix = multiply(perspective(camera, width / height, mirrored), lookAt(camera));
    [scenery, polished].forEach((program, k) => {
      gl.useProgram(program);
      gl.uniformMatrix4fv(cameras[k], false, matrix);
    });
    gl.uniform3fv(eye, camera.eye);
    const seen = within(camera, width / height);
    const away = ({ centre }) => Math.hypot(...minus(centre, camera.eye));
    const fine = (piece, meshes) => (away(piece) < SEEN_M.closely ? meshes[0] : meshes.at(-1));
    const cars = frame.cars.map((car, i) => ({ car, i, model: modelOf(car) })).filter(({ car, i }) => !(mirrored && i === inside.mirror) && seen([car.x, car.y, car.z], 6));
    const painted = ({ car, i, model }) => [...model, ...scene.paints[i].paint, car.brake > 0.05 ? 1 : 0, ...scene.paints[i].accent];
    gl.useProgram(polished);
    gl.enable(gl.CULL_FACE);
    gl.frontFace(mirrored ? gl.CW : gl.CCW);
    draw(scene.body, cars.flatMap(painted));
    draw(scene.cabin, cars.filter(({ i }) => i !== inside.car).flatMap(painted));
    draw(scene.wheel, cars.filter(({ car }) => seen([car.x, car.y, car.z], 6, SEEN_M.wheels)).flatMap(({ car, model }) => wheelsOf(car, model)));
    gl.disable(gl.CULL_FACE);
    gl.useProgram(scenery);
    for (const { meshes, held, pieces } of scene.planted) {
      for (const piece of pieces) if (seen(piece.centre, piece.reach, standing)) draw(fine(piece, meshes), [], held, piece.range);
    }
    // What is near first: what it hides costs little then.
    const ground = scene.ground.filter(({ centre, reach }) => seen(centre, reach, mirrored ? SEEN_M.mirrored : Infinity)).sort((a, b) => away(a) - away(b));
    for (const piece of ground) draw(fine(piece, piece.meshes));
    draw(scene.meadow);
    paintSky(camera, width / height, mirrored);
    prepareScene();
    gl.useProgram(scenery);
    gl.enable(gl.BLEND);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.depthMask(false);
    draw({ buffer: scene.marks.buffer, count: 6 * Math.min(marks ?? scene.marks.laid, scene.marks.laid, MOST_MARKS) });
    draw(scene.shadow, cars.flatMap(({ model }) => [...model, ...STILL.slice(16)]));
    if (line >= 0) paintLine(frame.cars[line]);
    gl.disable(gl.POLYGON_OFFSET_FILL);
    paintPuffs(frame.puffs ?? [], camera);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    if (inside.car >= 0 && !mirrored) paintCockpit(frame.cars[inside.car]);
    return matrix;
  }

  // The wheels of a car: those in front steer, all roll, and those on the right are turned round.
  function wheelsOf(car, model) {
    const roll = -(car.distance ?? car.progress ?? 0) / scene.radius;
    return scene.wheels.flatMap(([x, y, z], k) => {
      const steer = (k < 2 ? (car.steering ?? 0) * (scene.made.full_lock ?? 0.35) : 0) + (y < 0 ? Math.PI : 0);
      const turn = y < 0 ? -roll : roll;
      const [c, s, p, q] = [Math.cos(steer), Math.sin(steer), Math.cos(turn), Math.sin(turn)];
      return [...multiply(model, [c * p, s * p, q, 0, -s, c, 0, 0, -c * q, -s * q, p, 0, x, y, z, 1]), ...STILL.slice(16)];
    });
  }

  function paintCockpit(car) {
    const model = modelOf(car);
    const look = STILL.slice(16);
    // It is nearer than all else, the own bonnet included.
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.useProgram(polished);
    draw(scene.dashboard, [...model, ...look]);
    draw(scene.hand, [...multiply(model, handWheelAt(EYES[scene.kind], car.steering ?? 0)), ...look]);
  }

  function paintPuffs(puffs, camera) {
    const back = unit(minus(camera.eye, camera.target));
    const right = unit(cross(camera.up, back));
    const top = cross(back, right);
    draw(scene.puff, puffs.flatMap(({ place, size, colour, opacity }) => [
      ...right.map((part) => part * size), 0, ...top.map((part) => part * size), 0, ...back, 0, ...place, 1, ...colour.map((part) => part / 255), opacity, 0, 0, 0, 1]));
  }

  // The driver's line ahead, red where one is too fast for it.
  function paintLine(car) {
    const { reference, lap } = scene.made;
    const [n, mesh] = [reference.x.length, newMesh()];
    const first = Math.floor((((car.progress + LINE_M[0]) % lap) + lap) % lap / lap * n);
    const rows = Math.floor(((LINE_M[1] - LINE_M[0]) / lap) * n);
    const [step, point] = [2, (i) => [reference.x[i % n], reference.y[i % n], reference.z[i % n] + 0.04]];
    for (let k = first; k < first + rows; k += 2 * step) {
      const [a, b] = [point(k), point(k + step)];
      const far = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
      const side = [(-(b[1] - a[1]) / far) * 0.28, ((b[0] - a[0]) / far) * 0.28, 0];
      const over = car.speed ** 2 - reference.speed[k % n] ** 2 - 2 * 11 * (((k - first) / n) * lap);
      const paint = over > 0 ? [240, 70, 60] : over > -250 ? [242, 190, 60] : [90, 205, 120];
      mesh.quad(a.map((p, i) => p - side[i]), b.map((p, i) => p - side[i]), b.map((p, i) => p + side[i]), a.map((p, i) => p + side[i]), [...paint, 0.75], LOOK.unlit, UP);
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, flowing);
    gl.bufferData(gl.ARRAY_BUFFER, mesh.data(), gl.DYNAMIC_DRAW);
    draw({ buffer: flowing, count: mesh.count });
  }

  return {
    show,
    layMarks,
    /** @returns {number[][]} */
    get wheels() {
      return scene.wheels;
    },
    /** @returns {string} */
    get kind() {
      return scene.kind;
    },
    // The race as `camera` sees it; `inside` is a car without its cabin, `mirror` and `line` are cars that have these, `marks` how
    // many marks of tyres there are by now, and `moving` tells that the picture follows the one before.
    /**
     * @param {{ cars: DrawnCar[], puffs?: Puff[] }} frame
     * @param {import("./cameras.js").Camera} camera
     * @param {{ inside?: number, mirror?: number, line?: number, marks?: number | null, moving?: boolean }} options
     */
    render(frame, camera, { inside = -1, mirror = -1, line = -1, marks = null, moving = false } = {}) {
      const { share, standing } = pace(performance.now(), moving);
      const [width, height] = sized(canvas, share);
      const from = { car: inside, mirror };
      const matrix = paint([0, 0, width, height], camera, frame, { inside: from, marks, line, standing });
      if (mirror < 0) return matrix;
      const edge = Math.ceil(FRAME * height);
      for (const { side, x, y, wide, high } of MIRRORS) {
        if (side && inside !== mirror) continue;
        const [w, h] = [Math.round(width * wide), Math.round(height * high)];
        const [left, low] = [Math.round(width * x - w / 2), Math.round(height * y - h / 2)];
        gl.scissor(left - edge, low - edge, w + 2 * edge, h + 2 * edge);
        gl.clear(gl.COLOR_BUFFER_BIT);
        paint([left, low, w, h], mirrorCamera(frame.cars[mirror], scene.made.length, side), frame, { inside: from, marks, mirrored: true, standing: Math.min(standing, SEEN_M.mirrored) });
      }
      return matrix;
    },
  };
}
