// What tests ask of the scene in a page.

function triangles({ carModel, wheelModel }, name, length, width) {
  const car = carModel(name, length, width);
  const view = new DataView(car.body.data());
  const corners = Array.from({ length: car.body.count }, (_, i) => [0, 4, 8].map((k) => view.getFloat32(20 * i + k, true)));
  const reach = [0, 1, 2].map((k) => Math.max(...corners.map((corner) => Math.abs(corner[k]))));
  const wheel = wheelModel(car.radius).count;
  // How high the body ends behind the rear wheels, where they are.
  const [, , [x, y]] = car.wheels;
  const tail = Math.min(...corners.filter((corner) => corner[0] < x - car.radius && Math.abs(corner[1]) > y - 0.15 && corner[1] ** 2 < (y + 0.1) ** 2).map(([, , z]) => z));
  return { tail, reach, wheels: car.wheels, triangles: (car.body.count + car.glass.count + 4 * wheel) / 3 };
}

// How many pixels change with what a car does.
async function pixels({ newView }, { openCircuit }) {
  const { race, circuit } = JSON.parse(document.getElementById("race").textContent);
  const made = { circuit, ...(await openCircuit(circuit)) };
  const canvas = document.createElement("canvas");
  Object.defineProperties(canvas, { clientWidth: { value: 200 }, clientHeight: { value: 140 } });
  const view = newView(canvas);
  const shown = { ...made, kind: "gt3", length: 4.65, width: 2, colours: ["#3388ee"], names: ["1 entrant a"] };
  view.show(shown);
  const pose = { x: made.line.left.x[0], y: made.line.left.y[0], z: made.line.left.z[0], yaw: 0, pitch: 0, roll: 0, speed: 20, distance: 0 };
  const seen = (car, eye, options = {}, puffs = []) => {
    const target = [pose.x, pose.y, pose.z + 0.5];
    view.render({ cars: [{ ...pose, brake: 0, steering: 0, ...car }], puffs }, { eye: target.map((part, i) => part + eye[i]), target, up: [0, 0, 1], fov: 0.6 }, options);
    const gl = canvas.getContext("webgl2");
    const pixels = new Uint8Array(4 * 200 * 140);
    gl.readPixels(0, 0, 200, 140, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    return pixels;
  };
  const [behind, ahead, above] = [[-7, 0, 1.5], [7, 3, 1], [-0.1, 0, 9]];
  const changed = (a, b) => { let n = 0; for (let i = 0; i < a.length; i += 4) n += Math.abs(a[i] - b[i]) + Math.abs(a[i + 1] - b[i + 1]) > 24; return n; };
  const red = (pixels) => { let n = 0; for (let i = 0; i < pixels.length; i += 4) n += pixels[i] > 180 && pixels[i + 1] < 90; return n; };
  const side = [[-2, -2.4, 0.4], [2, -2.4, 0.4], [2, -1.4, 0.4], [-2, -1.4, 0.4]].map(([x, y, z]) => [pose.x + x, pose.y + y, pose.z + z]);
  const free = seen({}, above, { marks: 0 });
  view.layMarks([side]);
  return {
    braking: red(seen({ brake: 1 }, behind)) - red(seen({}, behind)),
    steered: changed(seen({ steering: 1 }, ahead), seen({}, ahead)),
    rolled: changed(seen({ distance: 0.2 }, [0, 6, 0.6]), seen({}, [0, 6, 0.6])),
    mirrors: changed(...[{ mirror: 0 }, {}].map((mirror) => seen({}, [-0.4, 0, 0.6], { inside: 0, ...mirror }).filter((_, i) => (i >> 2) % 200 < 40))),
    within: changed(seen({}, [-1.2, 0, 0.55], { inside: 0 }), seen({}, [-1.2, 0, 0.55])),
    marked: changed(free, seen({}, above, { marks: 1 })), before: changed(free, seen({}, above, { marks: 0 })),
    dusty: changed(free, seen({}, above, { marks: 0 }, [{ place: [pose.x - 2, pose.y, pose.z + 1], size: 1, colour: [200, 180, 140], opacity: 0.5 }])),
  };
}

// How finely pictures are drawn that come so many ms apart, and one that stands still.
function fineness({ newPace }, apart) {
  const pace = newPace();
  let now = 0;
  return apart.map((time) => (time === null ? pace((now += 16), false) : pace((now += time), true)).share);
}

async function traces({ marksBetween, raisedBy, slides }, { openCircuit }) {
  const { circuit } = JSON.parse(document.getElementById("race").textContent);
  const made = { circuit, ...(await openCircuit(circuit)) };
  const at = (name, share = 0) => [made.line[name].x[9] * (1 - share) + made.line.right.x[9] * share, made.line[name].y[9] * (1 - share) + made.line.right.y[9] * share];
  const car = ([x, y], yaw) => ({ x, y, z: 0, yaw, speed: 30 });
  const ahead = Math.atan2(made.line.left.y[10] - made.line.left.y[9], made.line.left.x[10] - made.line.left.x[9]);
  const moved = ([x, y]) => [x + 3 * Math.cos(ahead), y + 3 * Math.sin(ahead)];
  const distance = 9.5 * circuit.lap / circuit.rows;
  const raised = (place, yaw) => raisedBy(made, car(place, yaw), car(moved(place), yaw), distance);
  return {
    straight: slides(car([0, 0], 0), car([3, 0], 0)), sideways: slides(car([0, 0], 0.4), car([3, 0], 0.4)),
    slow: slides(car([0, 0], 0.4), { ...car([3, 0], 0.4), speed: 2 }), marks: marksBetween(car([0, 0], 0), car([3, 0], 0), [[1, 1, 0], [1, -1, 0]]).length,
    road: raised(at("left", 0.5), ahead), beside: raised(at("wall_left"), ahead), smoke: raised(at("left", 0.5), ahead + 0.4)?.colour,
  };
}
