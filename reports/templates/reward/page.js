// The page of a reward's design.

import { racePlayer } from "../race/player.js";
import { openRecording } from "../race/recording.js";

async function start() {
  const at = (id) => document.getElementById(id);
  const { circuit, clips, car } = JSON.parse(at("data").textContent);
  const stage = at("race");
  let player = null;
  let asked = 0;

  async function show() {
    const mine = ++asked;
    const number = Number(at("from").value);
    const names = [at("left").value, at("right").value].filter((name, i) => name && clips[name] && (i === 0 || name !== at("left").value));
    const [own, beside = null] = await Promise.all(names.map((name) => openRecording(clips[name][number], circuit)));
    if (mine !== asked || !own) return;
    player?.play(false);
    player = racePlayer(own, { followed: car, beside, scrolls: true });
    stage.replaceChildren(player.node);
    player.seek(0);
    document.body.dataset.ready = names.join(" beside ");
  }

  for (const id of ["left", "right", "from"]) at(id).addEventListener("change", show);
  for (const node of document.querySelectorAll(".watch")) {
    node.addEventListener("click", async () => {
      at("left").value = node.dataset.name;
      await show();
      at("clips-head").scrollIntoView({ block: "start" });
      player?.play(true);
    });
  }
  document.addEventListener("keydown", (event) => player?.key(event));
  if (at("left").value) await show();
}

start();
