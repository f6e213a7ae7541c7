// The page of a reward's design.

import { all, byId, dataOf } from "../race/element.js";
import { racePlayer } from "../race/player.js";
import { openRecording } from "../race/recording.js";

async function start() {
  const { circuit, clips, car } = dataOf("data");
  const [left, right, from] = ["left", "right", "from"].map((id) => byId(id, HTMLSelectElement));
  /** @type {import("../race/player.js").Player | null} */
  let player = null;
  let asked = 0;

  async function show() {
    const mine = ++asked;
    const number = Number(from.value);
    const names = [left.value, right.value].filter((name, i) => name && clips[name] && (i === 0 || name !== left.value));
    const [own, beside = null] = await Promise.all(names.map((name) => openRecording(clips[name][number], circuit)));
    if (mine !== asked || !own) return;
    player?.play(false);
    player = racePlayer(own, { followed: car, beside, scrolls: true });
    byId("race").replaceChildren(player.node);
    player.seek(0);
    document.body.dataset.ready = names.join(" beside ");
  }

  for (const choice of [left, right, from]) choice.addEventListener("change", show);
  for (const node of all(".watch")) {
    node.addEventListener("click", async () => {
      left.value = node.dataset.name ?? "";
      await show();
      byId("clips-head").scrollIntoView({ block: "start" });
      player?.play(true);
    });
  }
  document.addEventListener("keydown", (event) => player?.key(event));
  if (left.value) await show();
}

start();
