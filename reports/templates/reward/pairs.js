// The page in which two clips are compared.

import { all, byId, dataOf } from "../race/element.js";
import { racePlayer } from "../race/player.js";
import { openRecording } from "../race/recording.js";

function start() {
  const { circuit, pairs, car, socket: address, token } = dataOf("data");
  const socket = new WebSocket(address);
  const [stands, answer, remark] = [byId("stands"), byId("answer"), byId("remark", HTMLInputElement)];
  /** @type {number | null} */
  let shown = null;
  /** @type {import("../race/player.js").Player | null} */
  let player = null;

  async function show(pair) {
    shown = pair;
    const [first, second] = await Promise.all(pairs[pair].map((race) => openRecording(race, circuit)));
    if (shown !== pair) return;
    player?.play(false);
    player = racePlayer(first, { followed: car, beside: second });
    byId("race").replaceChildren(player.node);
    remark.value = "";
    answer.hidden = false;
    player.play(true);
    document.body.dataset.pair = String(pair);
  }

  function say(words) {
    if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(words));
  }

  socket.onopen = () => socket.send(token);
  socket.onmessage = ({ data }) => {
    const { left } = JSON.parse(data);
    stands.textContent = left.length ? `${pairs.length - left.length + 1} of ${pairs.length}` : "All are compared. Thank you; the window can be closed.";
    if (!left.length) {
      answer.hidden = true;
      player?.play(false);
    } else if (shown !== left[0]) show(left[0]);
  };
  socket.onclose = () => {
    answer.hidden = true;
    if (!stands.textContent.startsWith("All")) stands.textContent = "The design goes on, or has been stopped. The window can be closed.";
  };
  for (const node of all("[data-better]")) {
    node.addEventListener("click", () => say({ pair: shown, better: Number(node.dataset.better), remark: remark.value }));
  }
  byId("enough").addEventListener("click", () => say({ enough: true }));
  answer.addEventListener("submit", (event) => event.preventDefault());
  document.addEventListener("keydown", (event) => {
    if (event.target !== remark) player?.key(event);
  });
}

start();
