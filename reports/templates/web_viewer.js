// The page of the viewer that Rerun hands out.

import { byId } from "./race/element.js";

async function start() {
  await wasm_bindgen({ module_or_path: "re_viewer_bg.wasm" });
  const canvas = byId("viewer");
  const viewer = new wasm_bindgen.WebHandle({
    url: [`${location.origin}/race.rrd`],
    hide_welcome_screen: true,
    persist: false,
    enable_history: false,
    notebook: false,
  });
  canvas.hidden = false;
  await viewer.start(canvas);
  byId("news").remove();
  document.body.dataset.ready = "yes";
}

start().catch((error) => {
  byId("viewer").hidden = true;
  byId("news").textContent = `The viewer cannot start in this browser: ${error}`;
});
