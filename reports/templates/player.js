
"use strict";

const race = JSON.parse(document.getElementById("race").textContent);
const at = (id) => document.getElementById(id);
const TRAIL_S = 3;
const TRACE_S = 20;
const NEWS_S = 4;
const ALARM = "#f06a6a";
const QUIET = "#99a1ac";

// Rows of whole numbers, as reports/player.py packs them.
async function unpacked(text, width) {
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  const count = planes.length / 4;
  const rows = [];
  for (let start = 0; start < count; start += width) {
    const row = new Int32Array(width);
    let sum = 0;
    for (let i = 0; i < width; i++) {
      const k = start + i;
      sum += planes[k] | (planes[k + count] << 8) | (planes[k + 2 * count] << 16) | (planes[k + 3 * count] << 24);
      row[i] = sum;
    }
    rows.push(row);
  }
  return rows;
}

async function start() {
  const cars = race.cars.length;
  const [[ticks], rows, outline, ground] = await Promise.all([
    race.ticks ? unpacked(race.time, race.ticks) : [new Int32Array()],
    race.ticks ? unpacked(race.samples, race.ticks) : [],
    unpacked(race.circuit.points, race.circuit.rows),
    unpacked(race.circuit.runoff, race.circuit.rows),
  ]);
  const time = Array.from(ticks, (ms) => ms / 1000);
  const end = time.at(-1) ?? 0;
  const samples = {};
  race.columns.forEach(({ name, step }, c) => {
    samples[name] = rows.slice(c * cars, (c + 1) * cars).map((row) => Float64Array.from(row, (v) => v * step));
  });
  const bits = Object.fromEntries(race.flags.map((name, bit) => [name, 1 << bit]));
  const line = {};
  race.circuit.lines.forEach((name, i) => {
    const scaled = (row) => Float64Array.from(row, (v) => v * race.circuit.step);
    line[name] = { x: scaled(outline[2 * i]), y: scaled(outline[2 * i + 1]) };
  });

  const state = {
    now: 0, playing: false, rate: 1, followed: race.followed, zoom: 1, moved: null,
  };

  // Samples

  function tickAt(seconds) {
    let low = 0;
    let high = time.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (time[middle] <= seconds) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  function value(name, car, tick, part) {
    const column = samples[name][car];
    return part ? column[tick] * (1 - part) + column[tick + 1] * part : column[tick];
  }

  function moment(seconds) {
    const tick = tickAt(seconds);
    const next = Math.min(tick + 1, time.length - 1);
    return [tick, next > tick ? Math.min(Math.max((seconds - time[tick]) / (time[next] - time[tick]), 0), 1) : 0];
  }

  // Seconds since the car in front of all was where this car is now; its distance never falls much.
  function gap(car, leader, tick) {
    const distance = samples.distance[car][tick];
    const there = samples.distance[leader];
    let low = 0;
    let high = tick;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (there[middle] < distance) low = middle + 1;
      else high = middle;
    }
    if (!low) return 0;
    const part = (distance - there[low - 1]) / (there[low] - there[low - 1] || 1);
    return Math.max(time[tick] - (time[low - 1] + Math.min(Math.max(part, 0), 1) * (time[low] - time[low - 1])), 0);
  }

  const fastest = Math.max(1, ...samples.speed.map((column) => column.reduce((a, b) => Math.max(a, b), 1)));
  const has = (car, tick, flag) => (samples.flags[car][tick] & bits[flag]) !== 0;

  // The scene

  const scene = at("scene");
  const view = scene.getContext("2d");
  const bounds = [line.wall_left, line.wall_right].reduce(
    (box, { x, y }) => {
      for (let i = 0; i < x.length; i++) {
        box = [Math.min(box[0], x[i]), Math.min(box[1], y[i]), Math.max(box[2], x[i]), Math.max(box[3], y[i])];
      }
      return box;
    },
    [Infinity, Infinity, -Infinity, -Infinity],
  );

  // Strips between two lines: rows that are alike share one path, which is built once.
  function strips(first, second, kindOf) {
    const paths = new Map();
    const n = first.x.length;
    for (let i = 0; i < n; i++) {
      const kind = kindOf(i);
      if (kind === null) continue;
      if (!paths.has(kind)) paths.set(kind, new Path2D());
      const path = paths.get(kind);
      const j = (i + 1) % n;
      path.moveTo(first.x[i], first.y[i]);
      path.lineTo(second.x[i], second.y[i]);
      path.lineTo(second.x[j], second.y[j]);
      path.lineTo(first.x[j], first.y[j]);
      path.closePath();
    }
    return [...paths];
  }

  function closed({ x, y }) {
    const path = new Path2D();
    for (let i = 0; i < x.length; i++) path.lineTo(x[i], y[i]);
    path.closePath();
    return path;
  }

  const fills = [];
  for (const [side, row] of [["left", 0], ["right", 1]]) {
    const surface = (i) => race.circuit.surfaces[ground[row][i]];
    fills.push(...strips(line[`wall_${side}`], line[`kerb_${side}`], surface));
    const [edge, kerb] = [line[side], line[`kerb_${side}`]];
    const wide = (i) => Math.hypot(edge.x[i] - kerb.x[i], edge.y[i] - kerb.y[i]) > 0.1;
    fills.push(...strips(kerb, edge, (i) => (wide(i) ? race.circuit.kerb[(i >> 1) % 2] : null)));
  }
  fills.push(...strips(line.left, line.right, () => race.circuit.road));
  const zone = strips(line.left, line.right, (i) => (ground[2][i] ? "#f2b134" : null));
  const edges = [closed(line.left), closed(line.right)];
  const walls = [closed(line.wall_left), closed(line.wall_right)];
  const startLine = new Path2D();
  startLine.moveTo(line.left.x[0], line.left.y[0]);
  startLine.lineTo(line.right.x[0], line.right.y[0]);

  // A car in half lengths and half widths, nose to the right.
  const shape = [[1, 0.35], [0.93, 0.72], [0.6, 0.88], [0.1, 0.84], [-0.45, 0.9], [-0.92, 0.9], [-1, 0.6]];
  const glass = [[[0.3, 0.58], [0.06, 0.68]], [[-0.38, 0.62], [-0.58, 0.5]]];
  const [half, side] = [race.length / 2, race.width / 2];
  const mirrored = (points) => [...points, ...points.toReversed().map(([x, y]) => [x, -y])];
  const polygon = (points) => {
    const path = new Path2D();
    for (const [x, y] of mirrored(points)) path.lineTo(x * half, y * side);
    path.closePath();
    return path;
  };
  const body = polygon(shape);
  const windows = glass.map(polygon);
  const wing = new Path2D();
  wing.rect(-half, -side, 0.14 * half, 2 * side);
  const tyres = new Path2D();
  for (const x of [-0.62, 0.62]) for (const y of [-1, 1]) tyres.rect(x * half - 0.33, y * (side - 0.13) - 0.15, 0.66, 0.3);

  function sized(canvas) {
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    return [width, height, ratio];
  }

  function drawScene() {
    const [width, height, ratio] = sized(scene);
    const [tick, part] = moment(state.now);
    const whole = Math.min(width / (bounds[2] - bounds[0]), height / (bounds[3] - bounds[1])) * 0.94;
    let scale = whole * state.zoom;
    let centre = [(bounds[0] + bounds[2]) / 2, (bounds[1] + bounds[3]) / 2];
    if (state.followed >= 0 && time.length) {
      scale = (width / 110) * state.zoom;
      centre = [value("x", state.followed, tick, part), value("y", state.followed, tick, part)];
    } else if (state.moved) {
      centre = state.moved;
    }
    state.scale = scale;
    state.centre = centre;
    const near = scale > 1.5 * ratio;
    view.setTransform(1, 0, 0, 1, 0, 0);
    view.fillStyle = near ? "#26302a" : "#121519";
    view.fillRect(0, 0, width, height);
    const [left, top] = [width / 2 - centre[0] * scale, height / 2 + centre[1] * scale];
    view.setTransform(scale, 0, 0, -scale, left, top);
    for (const [colour, path] of fills) {
      view.fillStyle = colour;
      view.fill(path);
    }
    // Far away the road would be a hair.
    if (!near) {
      view.strokeStyle = "#565b64";
      view.lineWidth = (3.5 * ratio) / scale;
      view.stroke(edges[0]);
      view.stroke(edges[1]);
    }
    view.globalAlpha = 0.3;
    for (const [colour, path] of zone) {
      view.fillStyle = view.strokeStyle = colour;
      view.lineWidth = near ? 0.3 : (4 * ratio) / scale;
      view.fill(path);
      if (!near) view.stroke(path);
    }
    view.globalAlpha = 1;
    if (near) {
      view.lineWidth = 0.18;
      view.strokeStyle = "#e1e2de";
      edges.forEach((edge) => view.stroke(edge));
      view.lineWidth = 0.4;
      view.strokeStyle = "#cdd0d4";
      walls.forEach((wall) => view.stroke(wall));
    }
    view.lineWidth = near ? 0.5 : (2 * ratio) / scale;
    view.strokeStyle = "#fff";
    view.stroke(startLine);
    if (!time.length) return;
    const order = [...Array(cars).keys()].sort((a, b) => (a === state.followed) - (b === state.followed));
    order.forEach((car) => drawTrail(car, tick, part, near, ratio));
    drawIncidents(near, ratio);
    if (near) order.forEach((car) => drawDraught(car, tick, part));
    order.forEach((car) => drawCar(car, tick, part, near, ratio));
  }

  function drawTrail(car, tick, part, near, ratio) {
    view.strokeStyle = race.cars[car].colour;
    view.lineWidth = near ? 0.5 : (2 * ratio) / state.scale;
    view.lineCap = "round";
    let [x, y] = [value("x", car, tick, part), value("y", car, tick, part)];
    for (let k = tick; k >= 0 && time[k] > state.now - TRAIL_S; k--) {
      view.globalAlpha = 0.7 * (1 - (state.now - time[k]) / TRAIL_S);
      view.beginPath();
      view.moveTo(x, y);
      [x, y] = [samples.x[car][k], samples.y[car][k]];
      view.lineTo(x, y);
      view.stroke();
    }
    view.globalAlpha = 1;
  }

  // The hole in the air in front of a car, the brighter the deeper the car sits in it.
  function drawDraught(car, tick, part) {
    const share = value("slipstream", car, tick, part);
    if (share < 0.03 || !has(car, tick, "driving")) return;
    view.save();
    view.translate(value("x", car, tick, part), value("y", car, tick, part));
    view.rotate(value("yaw", car, tick, part));
    const reach = 14;
    const fade = view.createLinearGradient(half, 0, half + reach, 0);
    fade.addColorStop(0, `rgba(150, 215, 255, ${0.75 * share})`);
    fade.addColorStop(1, "rgba(150, 215, 255, 0)");
    view.fillStyle = fade;
    view.beginPath();
    view.moveTo(half, -0.8 * side);
    view.lineTo(half + reach, -0.5 * side);
    view.lineTo(half + reach, 0.5 * side);
    view.lineTo(half, 0.8 * side);
    view.fill();
    view.restore();
  }

  function drawCar(car, tick, part, near, ratio) {
    const [x, y] = [value("x", car, tick, part), value("y", car, tick, part)];
    const driving = has(car, tick, "driving");
    view.globalAlpha = driving ? 1 : 0.45;
    view.save();
    view.translate(x, y);
    if (near) {
      view.rotate(value("yaw", car, tick, part));
      view.fillStyle = "#16171a";
      view.fill(tyres);
      view.fillStyle = race.cars[car].colour;
      view.fill(body);
      view.fillStyle = "#1c222a";
      windows.forEach((pane) => view.fill(pane));
      view.fill(wing);
      if (value("brake", car, tick, part) > 0.05) {
        view.fillStyle = "#ff463c";
        for (const y of [-0.86, 0.42]) view.fillRect(-1.04 * half, y * side, 0.3, 0.44 * side);
      }
    } else {
      const radius = ((car === state.followed ? 7 : 5) * ratio) / state.scale;
      view.beginPath();
      view.arc(0, 0, radius, 0, 2 * Math.PI);
      view.fillStyle = race.cars[car].colour;
      view.fill();
      view.lineWidth = (1.5 * ratio) / state.scale;
      view.strokeStyle = "#121519";
      view.stroke();
    }
    view.restore();
    view.globalAlpha = 1;
    label(near ? race.cars[car].name : String(car), x, y, near ? 14 : 11, ratio, driving ? "#fff" : QUIET);
  }

  function drawIncidents(near, ratio) {
    for (const incident of race.incidents) {
      const age = state.now - incident.time;
      if (incident.notice || age < 0 || age > NEWS_S || !incident.cars.length) continue;
      const [tick, part] = moment(incident.time);
      const car = incident.cars[0];
      view.globalAlpha = 1 - age / NEWS_S;
      view.strokeStyle = ALARM;
      view.lineWidth = (2 * ratio) / state.scale;
      view.beginPath();
      const radius = near ? 4 + 2 * age : ((8 + 4 * age) * ratio) / state.scale;
      view.arc(value("x", car, tick, part), value("y", car, tick, part), radius, 0, 2 * Math.PI);
      view.stroke();
    }
    view.globalAlpha = 1;
  }

  function label(text, x, y, above, ratio, colour) {
    const [px, py] = [(x - state.centre[0]) * state.scale + scene.width / 2, scene.height / 2 - (y - state.centre[1]) * state.scale];
    if (px < -100 || py < -20 || px > scene.width + 100 || py > scene.height + 20) return;
    view.save();
    view.setTransform(1, 0, 0, 1, 0, 0);
    view.font = `${12 * ratio}px system-ui, sans-serif`;
    view.textAlign = "center";
    view.lineWidth = 3 * ratio;
    view.strokeStyle = "#101317c0";
    view.strokeText(text, px, py - above * ratio);
    view.fillStyle = colour;
    view.fillText(text, px, py - above * ratio);
    view.restore();
  }

  // Traces of the followed car

  function drawTraces() {
    const canvas = at("traces");
    const pen = canvas.getContext("2d");
    const [width, height, ratio] = sized(canvas);
    pen.clearRect(0, 0, width, height);
    const car = state.followed >= 0 ? state.followed : leader();
    at("dials-of").textContent = race.cars[car]?.name ?? "";
    if (!time.length) return;
    const [tick, part] = moment(state.now);
    const traces = [
      ["speed", "#e6e8eb", 0, 0.44, (v) => v / fastest, (v) => `${Math.round(3.6 * v)} km/h`],
      ["throttle", "#60c86e", 0.5, 0.22, (v) => v, (v) => `throttle ${Math.round(100 * v)} %`],
      ["brake", "#e84a42", 0.5, 0.22, (v) => v, (v) => `brake ${Math.round(100 * v)} %`],
      ["steering", "#fac850", 0.78, 0.22, (v) => 0.5 + v / 2, (v) => `steering ${Math.round(100 * v)} %`],
    ];
    const first = tickAt(state.now - TRACE_S);
    const said = {};
    for (const [name, colour, from, share, scaled, words] of traces) {
      pen.strokeStyle = colour;
      pen.lineWidth = 1.5 * ratio;
      pen.beginPath();
      const point = (seconds, v) =>
        pen.lineTo(
          width * (1 - (state.now - seconds) / TRACE_S),
          height * (from + share) - 2 * ratio - scaled(v) * (share * height - 5 * ratio),
        );
      for (let k = first; k <= tick; k++) point(time[k], samples[name][car][k]);
      point(state.now, value(name, car, tick, part));
      pen.stroke();
      pen.fillStyle = colour;
      pen.font = `${11 * ratio}px system-ui, sans-serif`;
      said[from] = (said[from] ?? 0) + 1;
      const place = [words(value(name, car, tick, part)), (4 + 96 * (said[from] - 1)) * ratio, height * from + 11 * ratio];
      pen.strokeStyle = "#1a1e24";
      pen.lineWidth = 4 * ratio;
      pen.strokeText(...place);
      pen.fillText(...place);
    }
    pen.strokeStyle = "#ffffff22";
    pen.lineWidth = ratio;
    for (const y of [0.47, 0.75]) {
      pen.beginPath();
      pen.moveTo(0, y * height);
      pen.lineTo(width, y * height);
      pen.stroke();
    }
  }

  const leader = () => (time.length ? order(tickAt(state.now))[0] : 0);
  const order = (tick) => [...Array(cars).keys()].sort((a, b) => samples.place[a][tick] - samples.place[b][tick]);

  // The order

  const standings = at("order").tBodies[0];
  const cells = race.cars.map(() => {
    const row = standings.insertRow();
    const place = row.insertCell();
    const name = row.insertCell();
    const button = document.createElement("button");
    button.type = "button";
    const chip = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    const square = document.createElementNS("http://www.w3.org/2000/svg", "rect");
    square.setAttribute("width", 10);
    square.setAttribute("height", 10);
    chip.append(square);
    const text = document.createTextNode("");
    button.append(chip, text);
    name.append(button);
    const shown = { row, place, button, square, text, gap: row.insertCell(), speed: row.insertCell(), car: 0 };
    button.addEventListener("click", () => follow(shown.car));
    return shown;
  });

  function showOrder() {
    if (!time.length) return;
    const tick = tickAt(state.now);
    const standing = order(tick);
    standing.forEach((car, i) => {
      const shown = cells[i];
      shown.car = car;
      shown.place.textContent = i + 1;
      shown.square.setAttribute("fill", race.cars[car].colour);
      shown.text.data = race.cars[car].name;
      shown.button.title = race.cars[car].name;
      const penalty = samples.penalty[car][tick];
      const driving = has(car, tick, "driving");
      shown.gap.textContent = penalty > 0 ? `P ${penalty.toFixed(0)}` : i ? `+${gap(car, standing[0], tick).toFixed(1)}` : `lap ${samples.lap[car][tick] + 1}`;
      shown.gap.title = penalty > 0 ? "penalty to serve, s" : "";
      shown.speed.textContent = driving ? Math.round(3.6 * samples.speed[car][tick]) : "–";
      shown.row.classList.toggle("out", !driving);
      shown.row.toggleAttribute("aria-current", car === state.followed);
    });
  }

  // Incidents

  const marks = at("marks");
  marks.setAttribute("viewBox", `0 0 ${end || 1} 9`);
  const items = race.incidents.map((incident) => {
    const item = document.createElement("li");
    item.classList.toggle("notice", incident.notice);
    const button = document.createElement("button");
    button.type = "button";
    const when = document.createElement("span");
    when.textContent = clock(incident.time);
    const what = document.createElement("span");
    what.textContent = incident.text;
    button.append(when, what);
    button.addEventListener("click", () => {
      if (incident.cars.length) follow(incident.cars[0]);
      seek(incident.time - 2);
    });
    item.append(button);
    const mark = document.createElementNS("http://www.w3.org/2000/svg", "line");
    for (const [name, v] of Object.entries({ x1: incident.time, x2: incident.time, y1: 1, y2: 9 })) mark.setAttribute(name, v);
    mark.setAttribute("stroke", incident.notice ? QUIET : ALARM);
    mark.setAttribute("stroke-width", 1.5);
    mark.setAttribute("vector-effect", "non-scaling-stroke");
    marks.append(mark);
    return item;
  });
  at("incidents").append(...items);
  let passed = -1;

  function showIncidents() {
    const now = race.incidents.filter((incident) => incident.time <= state.now).length;
    const last = race.incidents.findLast((incident) => incident.time <= state.now && !incident.notice);
    const news = last && state.now - last.time < NEWS_S ? last.text : "";
    if (at("news").textContent !== news) at("news").textContent = news;
    if (now === passed) return;
    items.forEach((item, i) => item.classList.toggle("passed", i < now));
    const shown = items[Math.max(now - 1, 0)];
    const list = at("incidents");
    if (shown) list.scrollTop = shown.offsetTop - list.offsetTop - list.clientHeight / 2;
    passed = now;
  }

  // Controls

  function clock(seconds) {
    const tenths = Math.max(Math.round(seconds * 10), 0);
    return `${Math.floor(tenths / 600)}:${String(Math.floor(tenths / 10) % 60).padStart(2, "0")}.${tenths % 10}`;
  }

  const scrub = at("scrub");
  scrub.max = end;
  for (const [car, { name }] of race.cars.entries()) at("follow").add(new Option(name, car));

  function show() {
    scrub.value = state.now;
    scrub.setAttribute("aria-valuetext", clock(state.now));
    at("clock").textContent = clock(state.now);
    showOrder();
    showIncidents();
    drawScene();
    drawTraces();
  }

  let wanted = false;
  function refresh() {
    if (wanted) return;
    wanted = true;
    requestAnimationFrame(() => {
      wanted = false;
      show();
    });
  }

  function seek(seconds) {
    state.now = Math.min(Math.max(seconds, 0), end);
    refresh();
  }

  function follow(car) {
    state.followed = car;
    state.zoom = 1;
    state.moved = null;
    at("follow").value = car;
    refresh();
  }

  let before = 0;
  function frame(milliseconds) {
    if (!state.playing) return;
    const passedS = Math.min((milliseconds - before) / 1000, 0.25);
    before = milliseconds;
    seek(state.now + passedS * state.rate);
    if (state.now >= end) play(false);
    requestAnimationFrame(frame);
  }

  function play(on) {
    if (on && state.now >= end) state.now = 0;
    state.playing = on && end > 0;
    at("play").textContent = state.playing ? "Pause" : "Play";
    at("play").setAttribute("aria-pressed", state.playing);
    if (state.playing) {
      before = performance.now();
      requestAnimationFrame(frame);
    }
  }

  at("play").addEventListener("click", () => play(!state.playing));
  scrub.addEventListener("input", () => seek(Number(scrub.value)));
  at("rate").addEventListener("change", (event) => (state.rate = Number(event.target.value)));
  at("follow").addEventListener("change", (event) => follow(Number(event.target.value)));
  window.addEventListener("resize", refresh);
  scene.addEventListener("wheel", (event) => {
    event.preventDefault();
    state.zoom = Math.min(Math.max(state.zoom * Math.exp(-event.deltaY / 600), 0.15), 60);
    refresh();
  }, { passive: false });
  scene.addEventListener("pointermove", (event) => {
    if (!event.buttons || state.followed >= 0) return;
    const ratio = (window.devicePixelRatio || 1) / state.scale;
    state.moved = [state.centre[0] - event.movementX * ratio, state.centre[1] + event.movementY * ratio];
    refresh();
  });

  function nextIncident(direction) {
    const times = race.incidents.filter((incident) => !incident.notice).map((incident) => incident.time);
    const there = direction > 0 ? times.find((t) => t > state.now + 0.01) : times.findLast((t) => t < state.now - 0.01);
    if (there !== undefined) seek(there);
  }

  const keys = {
    " ": () => play(!state.playing),
    ArrowRight: (event) => seek(state.now + (event.shiftKey ? 10 : 1)),
    ArrowLeft: (event) => seek(state.now - (event.shiftKey ? 10 : 1)),
    ".": () => seek(state.now + 0.1),
    ",": () => seek(state.now - 0.1),
    ArrowDown: () => follow((state.followed + 1) % cars),
    ArrowUp: () => follow((Math.max(state.followed, 0) + cars - 1) % cars),
    "]": () => nextIncident(1),
    "[": () => nextIncident(-1),
    Home: () => seek(0),
    End: () => seek(end),
    m: () => follow(-1),
  };
  document.addEventListener("keydown", (event) => {
    const elsewhere = event.target.closest("select, button");
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (event.ctrlKey || event.metaKey || event.altKey || !keys[key]) return;
    if (elsewhere && (key === " " || event.target.tagName === "SELECT")) return;
    event.preventDefault();
    keys[key](event);
  });

  at("follow").value = state.followed;
  show();
  document.body.dataset.ready = "yes";
}

start();
