// Where cars go by each other: in this race and in the others of the run that were recorded.

import { clock, number } from "../numbers.js";
import { h } from "../race/element.js";
import { chart, extent, tip } from "./charts.js";
import { data } from "./data.js";
import { empty, note } from "./dom.js";
import { d3, Plot } from "./libraries.js";

export function passesView(player) {
  const { recording } = player;
  const { race, circuit, line } = recording;
  const all = data.recordings.flatMap((one) => one.passes.map((pass) => ({ ...pass, own: one === race })));
  if (!all.length) return empty("There was no pass in the recorded races.");
  const own = all.filter((pass) => pass.own).sort((a, b) => a.time - b.time);
  const sections = [...circuit.sections.map(({ name }) => name), ...(all.some(({ section }) => section < 0) ? ["between sections"] : [])];
  const sectionOf = (pass) => sections.at(pass.section);
  const shown = d3.sort(all, (pass) => !pass.own).map((pass) => ({ ...pass, name: sectionOf(pass) }));
  const road = Array.from({ length: Math.floor(circuit.rows / 8) + 1 }, (_, i) => (8 * i) % circuit.rows)
    .map((i) => [(line.left.x[i] + line.right.x[i]) / 2, (line.left.y[i] + line.right.y[i]) / 2]);
  const [width, height] = [0, 1].map((axis) => extent(road, (point) => point[axis])).map(([low, high]) => high - low);
  const about = (pass) => `${race.cars[pass.car].name}\npasses ${race.cars[pass.passed].name}\nfor place ${pass.place}, ${clock(pass.time)}`;
  const key = h("p", { class: "key" }, h("i", { class: "survivor" }), `this race, ${number(own.length)}`, h("i", { class: "field" }), `the other recorded races, ${number(all.length - own.length)}`);
  return [
    note("A pass: behind for 2 s, then ahead for 2 s. Not counted: the first 10 s, and cars that left the course, served a penalty or crawled."),
    key,
    h("div", { class: "charts" },
      chart(null, (wide) => Plot.plot({
        width: wide, height: 60 + 22 * sections.length, marginLeft: 130, marginBottom: 40, ariaLabel: "Passes by section",
        x: { label: "passes", labelAnchor: "center", labelArrow: "none", grid: true, interval: 1, tickFormat: "d" }, y: { domain: sections, label: null, tickSize: 0 },
        marks: [Plot.barX(shown, Plot.groupY({ x: "count" }, { y: "name", fill: (pass) => (pass.own ? "var(--survivor)" : "var(--field)"), insetTop: 3, insetBottom: 3 }))],
      })),
      chart(null, (wide) => Plot.plot({
        width: wide, height: Math.min(420, Math.max(160, (wide * height) / width)), margin: 12, inset: 8, aspectRatio: 1, axis: null, ariaLabel: "Passes on the map",
        marks: [
          Plot.line(road, { stroke: "var(--strong-rule)", strokeWidth: 5, strokeLinejoin: "round" }),
          Plot.dot(shown.filter((pass) => !pass.own), { x: "x", y: "y", r: 4.5, fill: "var(--field)", stroke: "var(--paper)" }),
          Plot.dot(own, { x: "x", y: "y", r: 5.5, fill: "var(--survivor)", stroke: "var(--paper)" }),
          Plot.tip(own, Plot.pointer({ ...tip, x: "x", y: "y", title: about })),
        ],
      }))),
    own.length > 0 && h("ol", { class: "moments" }, own.map((pass) => h("li", {},
      momentButton(player, pass.time - 4, pass.car, clock(pass.time)), ` ${race.cars[pass.car].name} passes ${race.cars[pass.passed].name} for place ${pass.place}, ${sectionOf(pass)}`))),
  ];
}

// Has the player show a moment.
export const momentButton = (player, seconds, car, text) =>
  h("button", { type: "button", class: "moment", onclick: () => {
    player.follow(car);
    player.seek(seconds);
    player.node.scrollIntoView({ block: "center" });
  } }, text);
