// How a race is watched: on the map or in three dimensions, by which camera, in slow motion, on the whole screen.

import { h } from "./element.js";
import { calm, CAMERAS } from "./space.js";

const NO_SPACE = "This browser has no WebGL, so the race stays on the map.";

// `controls` stand beside those of the player, `keys` are added to its own, and `changed` is called when there is something else to
// draw. What is chosen is in state.space, state.camera and state.slow.
export function watching(stages, state, whole, changed) {
  const lacking = h("p", { class: "lacking", role: "status" });
  const button = h("button", {
    type: "button", class: "in-space", "aria-pressed": "false", onclick: () => turn(!state.space), disabled: !stages[0].recording.time.length,
  }, "3-D");
  const camera = h("select", { class: "camera", onchange: () => choose(camera.value) },
    Object.entries(CAMERAS).map(([value, name]) => h("option", { value }, name)));
  const slow = h("input", { type: "checkbox", class: "slow", disabled: calm(), onchange: () => (state.slow = slow.checked) });
  const full = document.fullscreenEnabled && h("button", { type: "button", class: "full", onclick: fill }, "Full screen");
  const chosen = h("label", { hidden: true }, "Camera ", camera);

  function turn(on) {
    const can = on && stages.every(({ space }) => space.open());
    lacking.textContent = on && !can ? NO_SPACE : "";
    state.space = can;
    button.setAttribute("aria-pressed", can);
    chosen.hidden = !can;
    for (const { scene, space } of stages) [scene.hidden, space.node.hidden] = [can, !can];
    changed();
  }

  function choose(kind) {
    camera.value = state.camera = kind;
    changed();
  }

  function fill() {
    if (document.fullscreenElement) document.exitFullscreen();
    else whole.requestFullscreen();
  }

  const kinds = Object.keys(CAMERAS);
  return {
    controls: [button, chosen, h("label", { title: calm() && "This system asks for reduced motion." }, slow, " slow motion on incidents"), full, lacking],
    keys: {
      v: () => turn(!state.space),
      c: () => state.space && choose(kinds[(kinds.indexOf(state.camera) + 1) % kinds.length]),
      f: () => full && fill(),
    },
  };
}
