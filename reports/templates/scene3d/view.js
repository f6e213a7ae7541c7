// The race in three dimensions, drawn by WebGL.

import { sized } from "../race/scene.js";
import { lookAt, mirrorCamera, modelOf, multiply, perspective } from "./cameras.js";
import { carMesh, circuitMesh, CORNER_BYTES, newMesh, rgb } from "./mesh.js";

const SKY = [0.55, 0.7, 0.84];
const MIRROR = { width: 0.3, height: 0.13 };
const LINE_M = [6, 220]; // how far ahead the racing line is shown
const VERTEX = `
attribute vec3 place; attribute vec4 colour;
uniform mat4 model, camera; uniform vec3 tint;
varying vec3 shade; varying float far;
void main() {
  gl_Position = camera * model * vec4(place, 1.0);
  shade = mix(colour.rgb, colour.rgb * tint, colour.a);
  far = gl_Position.w;
}`;
const FRAGMENT = `
precision mediump float;
uniform vec3 sky; uniform float alpha;
varying vec3 shade; varying float far;
void main() { gl_FragColor = vec4(mix(sky, shade, exp(-far / 900.0)), alpha); }`;

/**
 * @typedef {ReturnType<typeof viewBy>} View
 * @typedef {import("./cameras.js").Camera} Camera
 * @typedef {import("./cameras.js").Pose & { progress?: number, speed: number }} DrawnCar
 */

/**
 * What is drawn: the circuit as it was unpacked, the size of cars and their colours; for the driver's line also that line.
 * @typedef {object} Made
 * @property {import("../race/recording.js").CircuitData} circuit
 * @property {Record<import("../race/recording.js").LineName, import("../race/recording.js").Line>} line
 * @property {Int32Array[]} ground
 * @property {number} length m
 * @property {number} width
 * @property {string[]} colours
 * @property {number} [lap] m
 * @property {import("../race/recording.js").Line & { speed: Float64Array }} [reference]
 */

/**
 * A view on a canvas; null where the browser has no WebGL.
 * @param {HTMLCanvasElement} canvas
 */
export function newView(canvas) {
  const gl = canvas.getContext("webgl", { antialias: true, alpha: false });
  return gl && viewBy(gl, canvas);
}

/**
 * @param {WebGLRenderingContext} gl
 * @param {HTMLCanvasElement} canvas
 */
function viewBy(gl, canvas) {
  const program = gl.createProgram();
  for (const [kind, source] of /** @type {[number, string][]} */ ([[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]])) {
    const shader = gl.createShader(kind);
    if (!shader) continue; // The context is lost, and nothing is drawn.
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  gl.useProgram(program);
  const [place, colour] = ["place", "colour"].map((name) => gl.getAttribLocation(program, name));
  const uniform = Object.fromEntries(["model", "camera", "tint", "sky", "alpha"].map((name) => [name, gl.getUniformLocation(program, name)]));
  const still = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
  gl.enable(gl.DEPTH_TEST);
  gl.enable(gl.SCISSOR_TEST);
  gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  gl.uniform3fv(uniform.sky, SKY);
  /** @type {(data: ArrayBuffer, use?: number) => WebGLBuffer} */
  const load = (data, use = gl.STATIC_DRAW) => {
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, use);
    return buffer;
  };
  /** @type {(buffer: WebGLBuffer, model: Float32Array, tint: number[], first: number, count: number) => void} */
  const draw = (buffer, model, tint, first, count) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(place);
    gl.enableVertexAttribArray(colour);
    gl.vertexAttribPointer(place, 3, gl.FLOAT, false, CORNER_BYTES, 0);
    gl.vertexAttribPointer(colour, 4, gl.UNSIGNED_BYTE, true, CORNER_BYTES, 12);
    gl.uniformMatrix4fv(uniform.model, false, model);
    gl.uniform3fv(uniform.tint, tint);
    gl.drawArrays(gl.TRIANGLES, first, count);
  };
  /**
   * @typedef {{ made: Made, ground: WebGLBuffer, corners: number, car: WebGLBuffer, cabin: number, all: number, shadow: WebGLBuffer, line: WebGLBuffer }} Scene
   */
  let scene = /** @type {Scene} */ (/** @type {unknown} */ (null)); // until `show`

  /** @param {Made} made */
  function show(made) {
    const [ground, car] = [circuitMesh(made), carMesh(made.length, made.width)];
    const shadow = newMesh();
    const [x, y] = [made.length / 2 + 0.15, made.width / 2 + 0.15];
    shadow.quad([-x, -y, 0.05], [x, -y, 0.05], [x, y, 0.05], [-x, y, 0.05], [16, 18, 20]);
    scene = {
      made, ground: load(ground.data), corners: ground.count,
      car: load(car.mesh.data), cabin: car.cabin, all: car.mesh.count,
      shadow: load(shadow.data), line: gl.createBuffer(),
    };
  }

  /**
   * Draws what a camera sees and returns its matrix. Of the own car a mirror shows nothing, and a camera within no cabin.
   * @param {[number, number, number, number]} box of the canvas
   * @param {Camera} camera
   * @param {{ cars: DrawnCar[] }} frame
   * @param {number} own
   */
  function paint([x, y, width, height], camera, frame, own, mirrored = false) {
    gl.viewport(x, y, width, height);
    gl.scissor(x, y, width, height);
    gl.clearColor(SKY[0], SKY[1], SKY[2], 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const matrix = multiply(perspective(camera, width / height, mirrored), lookAt(camera));
    gl.uniformMatrix4fv(uniform.camera, false, matrix);
    gl.uniform1f(uniform.alpha, 1);
    draw(scene.ground, still, [1, 1, 1], 0, scene.corners);
    frame.cars.forEach((car, i) => {
      if (mirrored && i === own) return;
      const model = modelOf(car);
      gl.enable(gl.BLEND);
      gl.uniform1f(uniform.alpha, 0.45);
      draw(scene.shadow, model, [1, 1, 1], 0, 6);
      gl.disable(gl.BLEND);
      gl.uniform1f(uniform.alpha, 1);
      draw(scene.car, model, rgb(scene.made.colours[i]).map((part) => part / 255), 0, i === own ? scene.cabin : scene.all);
    });
    return matrix;
  }

  /**
   * The driver's line ahead, red where one is too fast for it.
   * @param {DrawnCar} car
   */
  function paintLine(car) {
    const { reference, lap = 1 } = scene.made;
    if (!reference) return;
    const [n, mesh] = [reference.x.length, newMesh()];
    const first = Math.floor(((((car.progress ?? 0) + LINE_M[0]) % lap) + lap) % lap / lap * n);
    const rows = Math.floor(((LINE_M[1] - LINE_M[0]) / lap) * n);
    const [step, point] = [2, (i) => [reference.x[i % n], reference.y[i % n], reference.z[i % n] + 0.04]];
    for (let k = first; k < first + rows; k += 2 * step) {
      const [a, b] = [point(k), point(k + step)];
      const far = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
      const side = [(-(b[1] - a[1]) / far) * 0.28, ((b[0] - a[0]) / far) * 0.28, 0];
      const over = car.speed ** 2 - reference.speed[k % n] ** 2 - 2 * 11 * (((k - first) / n) * lap);
      const paint = over > 0 ? [240, 70, 60] : over > -250 ? [242, 190, 60] : [90, 205, 120];
      mesh.quad(a.map((p, i) => p - side[i]), b.map((p, i) => p - side[i]), b.map((p, i) => p + side[i]), a.map((p, i) => p + side[i]), paint);
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, scene.line);
    gl.bufferData(gl.ARRAY_BUFFER, mesh.data, gl.DYNAMIC_DRAW);
    gl.enable(gl.BLEND);
    gl.uniform1f(uniform.alpha, 0.75);
    draw(scene.line, still, [1, 1, 1], 0, mesh.count);
    gl.disable(gl.BLEND);
    gl.uniform1f(uniform.alpha, 1);
  }

  return {
    show,
    /**
     * The race as `camera` sees it; `inside` is a car without its cabin, `mirror` and `line` are cars that have these.
     * @param {{ cars: DrawnCar[] }} frame
     * @param {Camera} camera
     * @param {{ inside?: number, mirror?: number, line?: number }} [cars]
     */
    render(frame, camera, { inside = -1, mirror = -1, line = -1 } = {}) {
      const [width, height] = sized(canvas);
      const matrix = paint([0, 0, width, height], camera, frame, inside);
      if (line >= 0) paintLine(frame.cars[line]);
      if (mirror >= 0) {
        const [w, h] = [Math.round(width * MIRROR.width), Math.round(height * MIRROR.height)];
        const behind = mirrorCamera(frame.cars[mirror], scene.made.length);
        paint([Math.round((width - w) / 2), height - h - Math.round(height * 0.02), w, h], behind, frame, mirror, true);
      }
      return matrix;
    },
  };
}
