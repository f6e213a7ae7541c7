// The race just driven, played in the page of its result, by the cameras beside the circuit.

import { byId, h } from "../race/element.js";
import { calm, spaceScene } from "../race/space.js";
import { clock } from "../numbers.js";
import { called } from "./words.js";

/**
 * What plays it; it stops when it leaves the page. Null where the browser has no WebGL.
 * @param {import("../race/recording.js").Recording} recording
 * @param {number} own the person's car
 */
export function playedAgain(recording, own) {
  for (const car of recording.race.cars) car.name = called(car.name);
  const state = /** @type {any} */ ({ now: 0, followed: own, camera: "trackside", playing: !calm() });
  const space = spaceScene(recording, state, "again");
  const shown = h("output", {}, clock(0));
  const bar = h("input", { type: "range", min: 0, max: recording.end, step: 0.01, value: 0, "aria-label": "Time in the race", oninput: () => seek(Number(bar.value)) });
  const button = h("button", { type: "button", onclick: () => turn(!state.playing) }, state.playing ? "Pause" : "Play");
  const node = h("div", { class: "again" }, h("div", { class: "stage" }, space.node), h("div", { class: "transport" }, button, shown, bar));
  let before = performance.now();

  function seek(seconds) {
    state.now = Math.min(seconds, recording.end);
    bar.value = String(state.now);
    shown.textContent = clock(state.now);
    space.draw();
  }

  function turn(on) {
    state.playing = on;
    button.textContent = on ? "Pause" : "Play";
  }

  function frame(milliseconds) {
    if (!node.isConnected || !byId("result", HTMLDialogElement).open) return;
    const passed = Math.min((milliseconds - before) / 1000, 0.25);
    before = milliseconds;
    if (state.playing) seek(state.now + passed);
    if (state.now >= recording.end) turn(false);
    requestAnimationFrame(frame);
  }

  return {
    node,
    // Once it is in the page.
    begin() {
      if (!recording.end || !space.open()) return node.remove();
      space.node.hidden = false;
      seek(0);
      requestAnimationFrame(frame);
    },
  };
}
