// The order of a race at the player's moment; a car that is chosen is followed.

import { ABSENT, number } from "../numbers.js";
import { h } from "./element.js";

const ENDING = 10; // letters of a name that stay where there is no room for all: names of a run differ in their ends

/** @param {import("./player.js").Player} player */
export function orderTable(player) {
  const { recording, state } = player;
  const { race, samples, time } = recording;
  const rows = race.cars.map(() => {
    const square = h("svg:rect", { width: 10, height: 10 });
    const [begins, ends] = [h("span", {}), h("span", {})];
    const button = h("button", { type: "button", onclick: () => player.follow(shown.car) }, h("svg:svg", {}, square), begins, ends);
    const [place, gap, speed] = [h("td"), h("td"), h("td")];
    const shown = { car: 0, square, begins, ends, button, place, gap, speed, row: h("tr", {}, place, h("td", {}, button), gap, speed) };
    return shown;
  });

  function show() {
    if (!time.length) return;
    const tick = recording.tickAt(state.now);
    const order = recording.order(tick);
    order.forEach((car, i) => {
      const shown = rows[i];
      shown.car = car;
      shown.place.textContent = String(i + 1);
      shown.square.setAttribute("fill", race.cars[car].colour);
      const { name } = race.cars[car];
      shown.button.title = shown.button.ariaLabel = name;
      [shown.begins.textContent, shown.ends.textContent] = [name.slice(0, -ENDING), name.slice(-ENDING)];
      const penalty = samples.penalty[car][tick];
      const driving = recording.drives(car, tick);
      const behind = i ? `+${recording.gap(car, order[0], tick).toFixed(1)}` : `lap ${samples.lap[car][tick] + 1}`;
      shown.gap.textContent = penalty > 0 ? `P ${penalty.toFixed(0)}` : behind;
      shown.gap.title = penalty > 0 ? "penalty to serve, s" : "";
      shown.speed.textContent = driving ? number(3.6 * samples.speed[car][tick]) : ABSENT;
      shown.row.classList.toggle("out", !driving);
      shown.row.toggleAttribute("aria-current", car === state.followed);
    });
  }

  player.on.push(show);
  return h("table", { id: "order" },
    h("caption", { class: "unseen" }, "The order; choose a car to follow it"),
    h("thead", {}, h("tr", {}, ["Pos", "Car", "Gap s", "km/h"].map((head) => h("th", { scope: "col" }, head)))),
    h("tbody", {}, rows.map(({ row }) => row)));
}
