// The page in which two clips are compared.

import { racePlayer } from "../race/player.js";
import { openRecording } from "../race/recording.js";

function start() {
  const at = (id) => document.getElementById(id);
  const { circuit, pairs, car, socket: address, token } = JSON.parse(at("data").textContent);
  const socket = new WebSocket(address);
  let shown = null;
  let player = null;

  async function show(pair) {
    shown = pair;
    const [first, second] = await Promise.all(pairs[pair].map((race) => openRecording(race, circuit)));
    if (shown !== pair) return;
    player?.play(false);
    player = racePlayer(first, { followed: car, beside: second });
    at("race").replaceChildren(player.node);
    at("remark").value = "";
    at("answer").hidden = false;
    player.play(true);
    document.body.dataset.pair = pair;
  }

  function say(words) {
    if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(words));
  }

  socket.onopen = () => socket.send(token);
  socket.onmessage = ({ data }) => {
    const { left } = JSON.parse(data);
    at("stands").textContent = left.length ? `${pairs.length - left.length + 1} of ${pairs.length}` : "All are compared. Thank you; the window can be closed.";
    if (!left.length) {
      at("answer").hidden = true;
      player?.play(false);
    } else if (shown !== left[0]) show(left[0]);
  };
  socket.onclose = () => {
    at("answer").hidden = true;
    if (!at("stands").textContent.startsWith("All")) at("stands").textContent = "The design goes on, or has been stopped. The window can be closed.";
  };
  for (const node of document.querySelectorAll("[data-better]")) {
    node.addEventListener("click", () => say({ pair: shown, better: Number(node.dataset.better), remark: at("remark").value }));
  }
  at("enough").addEventListener("click", () => say({ enough: true }));
  at("answer").addEventListener("submit", (event) => event.preventDefault());
  document.addEventListener("keydown", (event) => {
    if (event.target !== at("remark")) player?.key(event);
  });
}

start();
