// The page of two races from one start.

import { byId, dataOf, h, shown } from "../race/element.js";
import { keepMoment, keyHints, momentOf, racePlayer } from "../race/player.js";
import { openRecording } from "../race/recording.js";
import { twinCharts } from "./charts.js";
import { openSeen, seenView } from "./seen.js";

async function start() {
  const { circuit, car, at: takenOver, parted, sides } = dataOf("twins");
  const recordings = await Promise.all(sides.map(({ race }) => openRecording(race, circuit)));
  const mark = takenOver ?? parted;
  // A policy that drives from the start parts later from the one before it.
  const first = { followed: car, now: Math.max((parted ?? mark ?? 0) - 1, 0), ...momentOf(new URLSearchParams(location.hash.slice(1))) };
  const player = racePlayer(recordings[0], { ...first, beside: recordings[1], scrolls: true });
  byId("races").append(player.node);
  // Below the page, so that it stays in reach.
  byId("foot").append(...shown([player.node.querySelector(".transport"), keyHints()]));
  if (mark !== null) {
    byId("marks", SVGSVGElement).append(h("svg:line", { id: "parted", x1: mark, x2: mark, y1: -3, y2: 24, stroke: "#f06a6a", "stroke-width": 2, "vector-effect": "non-scaling-stroke" }));
  }
  byId("charts").append(...twinCharts(player, recordings, car, mark));
  if (sides.every(({ seen }) => seen)) {
    byId("seen").append(seenView(player, await Promise.all(sides.map(({ seen }) => openSeen(seen))), mark));
  }
  document.addEventListener("keydown", player.key);
  keepMoment(player, (moment) => history.replaceState(null, "", `#${new URLSearchParams(moment)}`));
  player.on.push(() => (document.body.dataset.ready = "yes"));
  player.seek(first.now);
}

start();
