// How corners become pixels: light from sun and sky, haze, grain of the ground, and the sky itself.

import { drawn, LOOK } from "./shapes.js";

const SUN = [0.46, 0.34, 0.82];
const HAZE = [0.76, 0.83, 0.89];
export const SCENE_VERTEX = `#version 300 es
in vec3 place; in vec4 facing; in vec4 colour;
in vec4 model0, model1, model2, model3, paint, accent;
uniform mat4 camera; uniform vec3 eye;
const vec3 SUN = vec3(${SUN.map((part) => part.toFixed(4))});
out vec4 shade; out vec3 grain; out float far;
void main() {
  mat4 model = mat4(model0, model1, model2, model3);
  vec4 world = model * vec4(place, 1.0);
  gl_Position = camera * world;
  far = gl_Position.w;
  int look = int(facing.w + 0.5);
  vec3 n = normalize(mat3(model) * facing.xyz);
  vec3 base = colour.rgb;
  bool painted = look >= ${LOOK.paint} && look <= ${LOOK.sill};
  if (painted) {
    float other = look == ${LOOK.stripe} ? accent.x : look == ${LOOK.sill} ? accent.y : 0.0;
    base *= mix(paint.rgb, vec3(accent.z), other);
  } else if (look != ${LOOK.brake}) base *= mix(vec3(1.0), paint.rgb, accent.w);
  if (look == ${LOOK.brake}) base = mix(base, vec3(1.0, 0.16, 0.1), paint.a);
  vec3 light = vec3(0.92, 0.88, 0.80) * max(dot(n, SUN), 0.0) * 0.78 + mix(vec3(0.30, 0.30, 0.27), vec3(0.42, 0.47, 0.55), 0.5 + 0.5 * n.z);
  vec3 lit = base * light;
  if (painted || look == ${LOOK.glass}) {
    vec3 view = normalize(eye - world.xyz);
    float edge = pow(1.0 - max(dot(n, view), 0.0), 3.0);
    vec3 seen = reflect(-view, n);
    float gleam = pow(max(dot(seen, SUN), 0.0), 26.0);
    lit = mix(lit, mix(vec3(0.42, 0.46, 0.44), vec3(0.74, 0.84, 0.94), smoothstep(-0.1, 0.5, seen.z)), (look == ${LOOK.glass} ? 0.16 : 0.05) + 0.34 * edge) + gleam * (look == ${LOOK.glass} ? 0.5 : 0.4);
  }
  if (look == ${LOOK.unlit} || (look == ${LOOK.brake} && paint.a > 0.02)) lit = base;
  float tinted = look == ${LOOK.unlit} ? accent.w : 0.0;
  shade = vec4(lit, colour.a * mix(1.0, paint.a, tinted));
  grain = look == ${LOOK.road} ? vec3(world.xy, 0.30) : look == ${LOOK.grass} ? vec3(world.xy, 0.62) : vec3(0.0);
}`;
export const SCENE_FRAGMENT = `#version 300 es
precision mediump float; precision highp sampler2D;
in vec4 shade; in highp vec3 grain; in float far;
uniform sampler2D noise;
out vec4 drawn;
void main() {
  vec3 seen = shade.rgb;
  if (grain.z > 0.0) {
    float fine = texture(noise, grain.xy * 0.19).r, coarse = texture(noise, grain.xy * 0.011).g;
    seen *= 1.0 + grain.z * (0.55 * (fine - 0.5) + 0.75 * (coarse - 0.5));
  }
  drawn = vec4(mix(vec3(${HAZE}), seen, exp(-far / 1500.0)), shade.a);
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
precision mediump float; precision highp sampler2D;
in highp vec3 way;
uniform sampler2D noise;
const vec3 SUN = vec3(${SUN.map((part) => part.toFixed(4))});
out vec4 drawn;
void main() {
  vec3 to = normalize(way);
  float up = max(to.z, 0.0);
  vec3 sky = mix(vec3(${HAZE}), vec3(0.24, 0.47, 0.78), pow(up, 0.55));
  float sun = max(dot(to, SUN), 0.0);
  sky += vec3(1.0, 0.9, 0.7) * (0.16 * pow(sun, 10.0) + smoothstep(0.9985, 0.9995, sun));
  vec2 over = to.xy / (up + 0.14);
  float cloud = 0.62 * texture(noise, over * 0.10).g + 0.38 * texture(noise, over * 0.31 + 0.37).g;
  drawn = vec4(mix(sky, vec3(0.97), smoothstep(0.5, 0.78, cloud) * smoothstep(0.02, 0.22, up) * 0.8), 1.0);
}`;

export function compiled(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  return program;
}

// Noise that can be laid side by side: red is fine, green soft.
export function noiseTexture(gl) {
  const size = 128;
  const chance = drawn(13);
  const lattice = (cells) => {
    const value = Array.from({ length: cells * cells }, chance);
    const ease = (t) => t * t * (3 - 2 * t);
    return (x, y) => {
      const [i, j] = [Math.floor(x * cells), Math.floor(y * cells)];
      const [u, v] = [ease(x * cells - i), ease(y * cells - j)];
      const at = (a, b) => value[(a % cells) + (b % cells) * cells];
      return (at(i, j) * (1 - u) + at(i + 1, j) * u) * (1 - v) + (at(i, j + 1) * (1 - u) + at(i + 1, j + 1) * u) * v;
    };
  };
  const octaves = [4, 8, 16, 32].map(lattice);
  const pixels = new Uint8Array(size * size * 4);
  for (let y = 0; y < size; y++) {
    for (let x = 0; x < size; x++) {
      const soft = octaves.reduce((sum, octave, k) => sum + octave(x / size, y / size) / 2 ** (k + 1), 0) / 0.9375;
      pixels.set([255 * (0.6 * chance() + 0.4 * octaves[3](x / size, y / size)), 255 * Math.min(Math.max(1.6 * (soft - 0.5) + 0.5, 0), 1), 0, 255], 4 * (x + y * size));
    }
  }
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, size, size, 0, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  gl.generateMipmap(gl.TEXTURE_2D);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
}
