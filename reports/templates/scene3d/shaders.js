// How corners become pixels: light from sun and sky, haze, grain of the ground, and the sky itself.

import { unit } from "./cameras.js";
import { drawn, LIGHT, LOOK, SUN } from "./shapes.js";

const HAZE = [0.76, 0.83, 0.89];
const HAZE_M = 1500;
const SHADER_SUN = `vec3(${SUN.map((part) => part.toFixed(4))})`;
// What stands still: its light is in its colours.
export const SCENERY_VERTEX = `#version 300 es
in vec3 place; in vec4 facing; in vec4 colour;
in vec4 model0, model1, model2, model3, paint, accent;
uniform mat4 camera;
out vec4 shade; out vec3 grain; out float clear;
void main() {
  vec4 world = mat4(model0, model1, model2, model3) * vec4(place, 1.0);
  gl_Position = camera * world;
  clear = exp(-max(gl_Position.w, 0.0) / ${HAZE_M}.0);
  shade = vec4(colour.rgb * mix(vec3(1.0), paint.rgb, accent.w), colour.a * mix(1.0, paint.a, accent.w));
  int look = int(facing.w + 0.5);
  grain = vec3(world.xy * 0.19, (look == ${LOOK.road} ? 0.2 : look == ${LOOK.grass} ? 0.42 : 0.0) * max(1.0 - gl_Position.w / 110.0, 0.0));
}`;
// Cars: lit by sun and sky, and their paint reflects both.
export const CAR_VERTEX = `#version 300 es
in vec3 place; in vec4 facing; in vec4 colour;
in vec4 model0, model1, model2, model3, paint, accent;
uniform mat4 camera; uniform vec3 eye;
const vec3 SUN = ${SHADER_SUN};
out vec4 shade; out vec3 grain; out float clear;
void main() {
  mat4 model = mat4(model0, model1, model2, model3);
  vec4 world = model * vec4(place, 1.0);
  gl_Position = camera * world;
  clear = exp(-max(gl_Position.w, 0.0) / ${HAZE_M}.0);
  grain = vec3(0.0);
  int look = int(facing.w + 0.5);
  vec3 n = normalize(mat3(model) * facing.xyz);
  vec3 base = colour.rgb;
  bool painted = look >= ${LOOK.paint} && look <= ${LOOK.sill};
  if (painted) {
    float other = look == ${LOOK.stripe} ? accent.x : look == ${LOOK.sill} ? accent.y : 0.0;
    base *= mix(paint.rgb, vec3(accent.z), other);
  }
  if (look == ${LOOK.brake}) base = mix(base, vec3(1.0, 0.16, 0.1), paint.a);
  vec3 lit = base * (vec3(${LIGHT.sun}) * max(dot(n, SUN), 0.0) + mix(vec3(${LIGHT.ground}), vec3(${LIGHT.sky}), 0.5 + 0.5 * n.z));
  if (painted || look == ${LOOK.glass}) {
    vec3 view = normalize(eye - world.xyz);
    float edge = pow(1.0 - max(dot(n, view), 0.0), 3.0);
    vec3 seen = reflect(-view, n);
    float gleam = pow(max(dot(seen, SUN), 0.0), 26.0);
    lit = mix(lit, mix(vec3(0.42, 0.46, 0.44), vec3(0.74, 0.84, 0.94), smoothstep(-0.1, 0.5, seen.z)), (look == ${LOOK.glass} ? 0.16 : 0.05) + 0.34 * edge) + gleam * (look == ${LOOK.glass} ? 0.5 : 0.4);
  }
  if (look == ${LOOK.unlit} || (look == ${LOOK.brake} && paint.a > 0.02)) lit = base;
  shade = vec4(lit, colour.a);
}`;
export const FRAGMENT = `#version 300 es
precision mediump float; precision highp sampler2D;
in vec4 shade; in highp vec3 grain; in float clear;
uniform sampler2D noise;
out vec4 drawn;
void main() {
  vec3 seen = shade.rgb;
  if (grain.z > 0.0) seen *= 1.0 + grain.z * (texture(noise, grain.xy).r - 0.5);
  drawn = vec4(mix(vec3(${HAZE}), seen, clear), shade.a);
}`;
export const SKY_VERTEX = `#version 300 es
in vec2 corner;
uniform vec3 ahead, across, above;
out vec3 way;
void main() {
  way = ahead + corner.x * across + corner.y * above;
  gl_Position = vec4(corner, 1.0, 1.0);
}`;
export const SKY_FRAGMENT = `#version 300 es
precision mediump float; precision mediump samplerCube;
in highp vec3 way;
uniform samplerCube sky;
out vec4 drawn;
void main() { drawn = texture(sky, way); }`;

// A program whose attributes have these names, in the order of their places.
export function compiled(gl, vertex, fragment, attributes) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  attributes.forEach((name, place) => gl.bindAttribLocation(program, place, name));
  gl.linkProgram(program);
  return program;
}

// Noise that can be laid side by side: values from 0 to 1 at places in a square of 1.
function softNoise(seed, cells) {
  const chance = drawn(seed);
  const value = Array.from({ length: cells * cells }, chance);
  const ease = (t) => t * t * (3 - 2 * t);
  return (x, y) => {
    const [u, v] = [(x - Math.floor(x)) * cells, (y - Math.floor(y)) * cells];
    const [i, j] = [Math.floor(u), Math.floor(v)];
    const [s, t] = [ease(u - i), ease(v - j)];
    const at = (a, b) => value[(a % cells) + (b % cells) * cells];
    return (at(i, j) * (1 - s) + at(i + 1, j) * s) * (1 - t) + (at(i, j + 1) * (1 - s) + at(i + 1, j + 1) * s) * t;
  };
}

// The grain of the ground.
function grainTexture(gl) {
  const size = 64;
  const chance = drawn(13);
  const soft = softNoise(17, 16);
  const pixels = new Uint8Array(size * size * 4);
  for (let k = 0; k < size * size; k++) pixels[4 * k] = 255 * (0.6 * chance() + 0.4 * soft((k % size) / size, Math.floor(k / size) / size));
  gl.activeTexture(gl.TEXTURE0);
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, size, size, 0, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  gl.generateMipmap(gl.TEXTURE_2D);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_NEAREST);
}

// The colour of the sky in a direction: blue above, haze below, the sun, clouds.
function skyColour(way, clouds) {
  const [x, y, z] = way;
  const up = Math.max(z, 0);
  const mix = (a, b, share) => a.map((part, i) => part + (b[i] - part) * share);
  const step = (low, high, value) => {
    const t = Math.min(Math.max((value - low) / (high - low), 0), 1);
    return t * t * (3 - 2 * t);
  };
  const sun = Math.max(x * SUN[0] + y * SUN[1] + z * SUN[2], 0);
  const shine = 0.16 * sun ** 10 + step(0.9975, 0.9993, sun);
  const clear = mix(HAZE, [0.24, 0.47, 0.78], up ** 0.55).map((part, i) => part + shine * [1, 0.9, 0.7][i]);
  const [u, v] = [x / (up + 0.14), y / (up + 0.14)];
  const cloud = clouds.reduce((sum, layer, k) => sum + layer(0.05 * 2 ** k * u + 0.37 * k, 0.05 * 2 ** k * v) / 2 ** (k + 1), 0) / 0.9375;
  return mix(clear, [0.97, 0.97, 0.97], 0.8 * step(0.42, 0.66, cloud) * step(0.02, 0.22, up));
}

// The sky all around, on the six sides of a cube.
function skyTexture(gl) {
  const size = 96;
  const clouds = [5, 5, 7, 9].map((cells, k) => softNoise(21 + k, cells));
  gl.activeTexture(gl.TEXTURE1);
  gl.bindTexture(gl.TEXTURE_CUBE_MAP, gl.createTexture());
  const sides = [(a, b) => [1, -b, -a], (a, b) => [-1, -b, a], (a, b) => [a, 1, b], (a, b) => [a, -1, -b], (a, b) => [a, -b, 1], (a, b) => [-a, -b, -1]];
  sides.forEach((way, side) => {
    const pixels = new Uint8Array(size * size * 4);
    for (let k = 0; k < size * size; k++) {
      const colour = skyColour(unit(way((2 * ((k % size) + 0.5)) / size - 1, (2 * (Math.floor(k / size) + 0.5)) / size - 1)), clouds);
      pixels.set([...colour.map((part) => 255 * Math.min(part, 1)), 255], 4 * k);
    }
    gl.texImage2D(gl.TEXTURE_CUBE_MAP_POSITIVE_X + side, 0, gl.RGBA, size, size, 0, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  });
  gl.texParameteri(gl.TEXTURE_CUBE_MAP, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
}

// What all programs look up, by the number of its unit.
export function layTextures(gl) {
  grainTexture(gl);
  skyTexture(gl);
}
export const SKY_UNIT = 1;
