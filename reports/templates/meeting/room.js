// The room: what comes from the server, and the views of it.

import { number } from "../numbers.js";
import { byId, dataOf, h } from "../race/element.js";
import { questionView } from "./decision.js";
import { empty } from "./figures.js";
import { connect, takeToken } from "./link.js";
import { logView, racesView } from "./races.js";

const VIEWS = ["questions", "report", "races", "log"];
const DONE = { vote: "Your ballot is cast.", compare: "Noted.", decide: "Decided.", reopen: "The question is open again." };
const STAGES = { pareto: "filter", battery: "n-athlon", tournament: "round robin" };
const TOLD_MS = 6000;

function start() {
  const { socket, longest } = dataOf("session");
  const token = takeToken();
  const questions = new Map();
  const runs = byId("run", HTMLSelectElement);
  let you = "";
  /** @type {any} what the server has said last, with its runs */
  let room = null;
  /** @type {string | null} */
  let wanted = null;
  let hiding = 0;

  function tell(kind, text) {
    clearTimeout(hiding);
    byId("told").className = kind;
    byId("told").textContent = text;
    byId("told").hidden = !text;
    if (kind === "done") hiding = setTimeout(() => tell("", ""), TOLD_MS);
  }

  const say = connect(socket, token, () => ({ type: "look", run: wanted }), {
    onState: (trouble) => {
      byId("stands").classList.toggle("lost", Boolean(trouble));
      if (trouble) byId("stands").textContent = trouble;
      else if (room) stands();
    },
    onWords: (words) => {
      if (words.type === "welcome") {
        you = words.you;
        byId("who").replaceChildren("You are ", h("b", {}, you));
        enter();
      } else if (words.type === "refused") tell("refused", words.why);
      else if (words.type === "done") tell("done", DONE[words.what]);
      else if (words.type === "state") show(words);
    },
  });
  const speak = (words) => say(words) || tell("refused", "The server is gone, so this was not sent.");

  // With the token in a header the browser gets a pass for files, which links and frames can send.
  async function enter() {
    const { ok } = await fetch("/enter", { headers: { Authorization: `Bearer ${token}` } });
    if (ok) renew();
  }

  function stands() {
    const own = room.runs.find(({ name }) => name === room.run);
    const { progress } = room;
    byId("stands").textContent = progress ? `${STAGES[progress.stage] ?? progress.stage}: ${number(progress.done)} of ${number(progress.total)} matches` : room.outcome ?? own.status;
  }

  function show(state) {
    const other = room?.run !== state.run;
    const news = other || JSON.stringify(room.stands) !== JSON.stringify(state.stands);
    room = state;
    runs.replaceChildren(...[...room.runs].reverse().map(({ name }) => h("option", { value: name, selected: name === room.run }, name)));
    stands();
    if (other) questions.clear();
    const open = room.decisions.filter((decision) => decision.open);
    const shown = [...open, ...room.decisions.filter((decision) => !decision.open).reverse()];
    for (const decision of shown) {
      if (!questions.has(decision.decision)) questions.set(decision.decision, questionView(decision, you, longest, speak));
      questions.get(decision.decision).show(decision, room);
    }
    const nodes = shown.map((decision) => questions.get(decision.decision).node);
    const held = byId("questions");
    // Whoever types into a form must not lose the place.
    if (nodes.length !== held.children.length || nodes.some((node, i) => node !== held.children[i])) held.replaceChildren(...(nodes.length ? nodes : [empty("The committee has not been asked anything in this run yet.")]));
    byId("races").replaceChildren(...racesView(room));
    byId("log").replaceChildren(...logView(room));
    if (news) renew(other);
  }

  // The report as it stands now, at the place where it was read.
  function renew(other = false) {
    if (!room || byId("report").hidden) {
      byId("report").dataset.stale = "yes";
      return;
    }
    delete byId("report").dataset.stale;
    const frame = byId("report").querySelector("iframe");
    if (!frame || other) {
      const onload = () => byId("report").dataset.stale && renew();
      byId("report").replaceChildren(h("iframe", { src: room.report, title: `Report of ${room.run}`, onload }));
      return;
    }
    try {
      const shown = /** @type {Window} */ (frame.contentWindow);
      const { scrollX, scrollY } = shown;
      frame.addEventListener("load", () => frame.contentWindow?.scrollTo(scrollX, scrollY), { once: true });
      shown.location.reload();
    } catch {
      // A race is played there, which is no part of the room. The report is renewed when somebody goes back to it.
      byId("report").dataset.stale = "yes";
    }
  }

  function view() {
    const asked = location.hash.slice(2);
    const chosen = VIEWS.includes(asked) ? asked : VIEWS[0];
    for (const name of VIEWS) byId(name).hidden = name !== chosen;
    for (const link of /** @type {HTMLCollectionOf<HTMLAnchorElement>} */ (byId("views").children)) {
      if (link.hash === `#/${chosen}`) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
    if (chosen === "report" && byId("report").dataset.stale) renew(true);
  }

  runs.addEventListener("change", () => {
    const latest = room.runs.at(-1).name;
    wanted = runs.value === latest ? null : runs.value;
    speak({ type: "look", run: wanted });
  });
  addEventListener("hashchange", () => {
    // Another member's address in the same tab.
    if (location.hash && !location.hash.startsWith("#/")) location.reload();
    else view();
  });
  view();
}

start();
