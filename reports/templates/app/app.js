// Which view is shown follows from the address alone.

const VIEWS = {
  tonight: ["Tonight", tonight],
  leaderboard: ["Leaderboard", leaderboard],
  pareto: ["Pareto", pareto],
  "n-athlon": ["n-athlon", nAthlon],
  matchups: ["Matchups", matchups],
  committee: ["Committee", committee],
  compare: [null, compare],
  matchup: [null, matchup],
  race: [null, raceView],
  checkpoint: [null, checkpoint],
};
const missing = (what) => [h("h1", {}, "Not here"), h("p", {}, `This report has no such ${what}. `, link(to("tonight"), "Back to tonight"))];

const main = document.querySelector("main");
function show() {
  const { view, rest } = here();
  main.replaceChildren(...[(VIEWS[view]?.[1] ?? (() => missing("view")))(rest)].flat(Infinity).filter(Boolean));
  document.title = view === "tonight" ? data.title : `${main.querySelector("h1").textContent} – ${data.title}`;
  for (const item of document.querySelectorAll("nav a")) {
    if (item.dataset.view === view) item.setAttribute("aria-current", "page");
    else item.removeAttribute("aria-current");
  }
}

document.querySelector("nav").append(
  ...Object.entries(VIEWS).filter(([, [title]]) => title).map(([view, [title]]) => h("a", { href: to(view), "data-view": view }, title)),
);
// Addresses with a hash are views, so this link cannot be one.
document.querySelector(".skip").addEventListener("click", (event) => {
  event.preventDefault();
  main.focus();
});
window.addEventListener("hashchange", () => {
  show();
  scrollTo(0, 0);
  main.focus({ preventScroll: true });
});
show();
