// Which view is shown follows from the address alone.

import { all, byId, h, shown } from "../race/element.js";
import { checkpoint } from "./checkpoint.js";
import { committee } from "./committee.js";
import { data, met } from "./data.js";
import { here, missing, to } from "./dom.js";
import { compare, leaderboard } from "./leaderboard.js";
import { matchup, matchups } from "./matchups.js";
import { nAthlon } from "./n_athlon.js";
import { pareto } from "./pareto.js";
import { raceView } from "./race.js";
import { tonight } from "./tonight.js";

/** @type {Record<string, [string | null, (rest: any) => import("../race/element.js").Child]>} */
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

const main = byId("main");
function show() {
  const { view, rest } = here();
  main.replaceChildren(...shown([(VIEWS[view]?.[1] ?? (() => missing("view")))(rest)]));
  document.title = view === "tonight" ? data.title : `${all("h1", main)[0].textContent} – ${data.title}`;
  for (const item of all("nav a")) {
    if (item.dataset.view !== view) item.removeAttribute("aria-current");
    else {
      item.setAttribute("aria-current", "page");
      item.scrollIntoView({ block: "nearest" });
    }
  }
}

const links = Object.entries(VIEWS).filter(([view, [title]]) => title && (met || view !== "matchups")).map(([view, [title]]) => h("a", { href: to(view), "data-view": view }, title));

// Light or dark: what the system prefers, until the button says otherwise; it says nothing where both agree.
const prefersDark = matchMedia("(prefers-color-scheme: dark)");
const preferred = () => (prefersDark.matches ? "dark" : "light");
const THEME = "nathlon-theme";
/** @type {string | null} */
let chosen = null;
try {
  chosen = localStorage.getItem(THEME);
} catch {} // Browsers that keep nothing for a page from the disk.
const themeButton = h("button", { type: "button", class: "theme", onclick: () => {
  const next = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
  chosen = next === preferred() ? null : next;
  try {
    if (chosen) localStorage.setItem(THEME, chosen);
    else localStorage.removeItem(THEME);
  } catch {}
  paint();
} });
function paint() {
  const theme = chosen ?? preferred();
  document.documentElement.dataset.theme = theme;
  themeButton.textContent = theme === "dark" ? "Light" : "Dark";
  themeButton.setAttribute("aria-label", `${themeButton.textContent} colours`);
}
all("nav")[0].append(h("div", { class: "views" }, links), themeButton);
prefersDark.addEventListener("change", paint);
paint();

// On paper nothing opens or scrolls: tables are whole, and as narrow as the sheet.
const SHEET_PX = 1020;
window.addEventListener("beforeprint", () => {
  for (const more of all(".more:not([hidden])")) more.click();
  for (const folded of main.querySelectorAll("details")) folded.open = true;
  for (const wide of all(".scroll > table")) wide.style.zoom = String(Math.min(1, SHEET_PX / wide.scrollWidth));
});
window.addEventListener("afterprint", () => {
  for (const wide of all(".scroll > table")) wide.style.zoom = "";
});

// Addresses with a hash are views, so this link cannot be one.
all(".skip")[0].addEventListener("click", (event) => {
  event.preventDefault();
  main.focus();
});
window.addEventListener("hashchange", () => {
  show();
  scrollTo(0, 0);
  main.focus({ preventScroll: true });
});
addEventListener("chosen", show);
show();
