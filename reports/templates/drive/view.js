// The race in three dimensions, drawn by WebGL.

const SKY = [0.55, 0.7, 0.84];
const CHASE = { back: 6.4, up: 2.3, look: 7, fov: 0.95 };
const COCKPIT = { forward: 0.35, up: 1.16, fov: 1.1 };
const MIRROR = { width: 0.3, height: 0.13, fov: 0.5 };
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

function multiply(a, b) {
  const out = new Float32Array(16);
  for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) out[c * 4 + r] += a[k * 4 + r] * b[c * 4 + k];
  return out;
}

function perspective(fov, aspect, mirrored) {
  const [near, far, f] = [0.2, 4000, 1 / Math.tan(fov / 2)];
  return new Float32Array([(mirrored ? -f : f) / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0]);
}

const minus = (a, b) => a.map((part, i) => part - b[i]);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (a) => a.map((part) => part / (Math.hypot(...a) || 1));

function lookAt(eye, target, up) {
  const back = unit(minus(eye, target));
  const right = unit(cross(up, back));
  const top = cross(back, right);
  return new Float32Array([right[0], top[0], back[0], 0, right[1], top[1], back[1], 0, right[2], top[2], back[2], 0, -dot(right, eye), -dot(top, eye), -dot(back, eye), 1]);
}

// Axes of a car in the world: forward, left, up.
function axes({ yaw, pitch, roll }) {
  const forward = [Math.cos(yaw) * Math.cos(pitch), Math.sin(yaw) * Math.cos(pitch), -Math.sin(pitch)];
  const level = [-Math.sin(yaw), Math.cos(yaw), 0];
  const left = unit([level[0] * Math.cos(roll), level[1] * Math.cos(roll), Math.sin(roll)]);
  return [forward, left, cross(forward, left)];
}

function modelOf(car) {
  const [f, l, u] = axes(car);
  return new Float32Array([...f, 0, ...l, 0, ...u, 0, car.x, car.y, car.z, 1]);
}

// A view on a canvas; null where the browser has no WebGL.
function newView(canvas) {
  const gl = canvas.getContext("webgl", { antialias: true, alpha: false });
  if (!gl) return null;
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
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
  const load = (data, use = gl.STATIC_DRAW) => {
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, use);
    return buffer;
  };
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
  let scene = null;
  let heading = null;

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
    heading = null;
  }

  // Where the camera of a view is, and what it looks at.
  function placed(kind, car) {
    const [forward, left, up] = axes(car);
    const at = (f, u) => [0, 1, 2].map((i) => [car.x, car.y, car.z][i] + forward[i] * f + up[i] * u);
    if (kind === "cockpit") return { eye: at(COCKPIT.forward, COCKPIT.up), target: at(30, COCKPIT.up - 0.2), up, fov: COCKPIT.fov };
    if (kind === "mirror") return { eye: at(-0.4 * scene.made.length, 1.25), target: at(-30, 0.9), up: [0, 0, 1], fov: MIRROR.fov };
    // The camera turns after the car.
    const turn = heading === null ? 0 : Math.atan2(Math.sin(car.yaw - heading), Math.cos(car.yaw - heading));
    heading = heading === null ? car.yaw : heading + turn * 0.12;
    const eye = [car.x - CHASE.back * Math.cos(heading), car.y - CHASE.back * Math.sin(heading), car.z + CHASE.up - CHASE.back * forward[2]];
    return { eye, target: at(CHASE.look, 0.8), up: [0, 0, 1], fov: CHASE.fov + Math.min(car.speed / 90, 1) * 0.2 };
  }

  function paint([x, y, width, height], camera, frame, own, inside, mirrored) {
    gl.viewport(x, y, width, height);
    gl.scissor(x, y, width, height);
    gl.clearColor(...SKY, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(uniform.camera, false, multiply(perspective(camera.fov, width / height, mirrored), lookAt(camera.eye, camera.target, camera.up)));
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
      draw(scene.car, model, rgb(scene.made.colours[i]).map((part) => part / 255), 0, inside && i === own ? scene.cabin : scene.all);
    });
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
    render(frame, own, { kind, mirror, line }) {
      if (!scene) return;
      const [width, height] = sized(canvas);
      const car = frame.cars[own];
      const camera = placed(kind, car);
      paint([0, 0, width, height], camera, frame, own, kind === "cockpit", false);
      if (line) paintLine(car);
      if (mirror) {
        const [w, h] = [Math.round(width * MIRROR.width), Math.round(height * MIRROR.height)];
        paint([Math.round((width - w) / 2), height - h - Math.round(height * 0.02), w, h], placed("mirror", car), frame, own, false, true);
      }
    },
  };
}
