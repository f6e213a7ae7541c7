// The page of its own: the player with traces of the followed car and what the stewards noted.

import { clock } from "./numbers.js";
import { byId, dataOf, h } from "./race/element.js";
import { orderTable } from "./race/order.js";
import { keepMoment, keyHints, momentOf, racePlayer } from "./race/player.js";
import { openRecording } from "./race/recording.js";
import { penOf, sized } from "./race/scene.js";

const TRACE_S = 20;

function tracesOf(player, canvas, of) {
  const { state, recording } = player;
  const { race, time, samples, tickAt, moment, value } = recording;
  const fastest = Math.max(1, ...samples.speed.map((column) => column.reduce((a, b) => Math.max(a, b), 1)));
  player.on.push(() => {
    const pen = penOf(canvas);
    const [width, height, ratio] = sized(canvas);
    pen.clearRect(0, 0, width, height);
    const car = state.followed >= 0 ? state.followed : time.length ? recording.order(tickAt(state.now))[0] : 0;
    of.textContent = race.cars[car]?.name ?? "";
    if (!time.length) return;
    const [tick, part] = moment(state.now);
    /** @type {[import("./race/recording.js").SampleName, string, number, number, (v: number) => number, (v: number) => string][]} */
    const traces = [
      ["speed", "#e6e8eb", 0, 0.44, (v) => v / fastest, (v) => `${Math.round(3.6 * v)} km/h`],
      ["throttle", "#60c86e", 0.5, 0.22, (v) => v, (v) => `throttle ${Math.round(100 * v)} %`],
      ["brake", "#e84a42", 0.5, 0.22, (v) => v, (v) => `brake ${Math.round(100 * v)} %`],
      ["steering", "#fac850", 0.78, 0.22, (v) => 0.5 + v / 2, (v) => `steering ${Math.round(100 * v)} %`],
    ];
    const first = tickAt(state.now - TRACE_S);
    /** @type {Record<number, number>} */
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
      /** @type {[string, number, number]} */
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
  });
}

function stewardsOf(player, list) {
  const { race } = player.recording;
  const items = race.incidents.map((incident) => h("li", { class: incident.notice && "notice" }, h("button", {
    type: "button",
    onclick: () => {
      if (incident.cars.length) player.follow(incident.cars[0]);
      player.seek(incident.time - 2);
    },
  }, h("span", {}, clock(incident.time)), h("span", {}, incident.text))));
  list.append(...items);
  let passed = -1;
  player.on.push((state) => {
    const now = race.incidents.filter((incident) => incident.time <= state.now).length;
    if (now === passed) return;
    items.forEach((item, i) => item.classList.toggle("passed", i < now));
    const shown = items[Math.max(now - 1, 0)];
    if (shown) list.scrollTop = shown.offsetTop - list.offsetTop - list.clientHeight / 2;
    passed = now;
  });
}

async function start() {
  const { race, circuit, followed } = dataOf("race");
  const recording = await openRecording(race, circuit);
  const player = racePlayer(recording, { followed, ...momentOf(new URLSearchParams(location.hash.slice(1))) });
  tracesOf(player, byId("traces", HTMLCanvasElement), byId("dials-of"));
  stewardsOf(player, byId("incidents"));
  byId("side").prepend(orderTable(player));
  byId("main").prepend(player.node);
  byId("foot").append(keyHints());
  document.addEventListener("keydown", player.key);
  keepMoment(player, (moment) => history.replaceState(null, "", `#${new URLSearchParams(moment)}`));
  player.on.push(() => (document.body.dataset.ready = "yes"));
}

start();
