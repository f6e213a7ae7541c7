// Numbers and names as the page of test drives writes them.

import { ABSENT, clock } from "../numbers.js";

/** @param {number} share */
export const percent = (share) => `${Math.round(100 * share)} %`;

/** @param {number} seconds */
export const lapTime = (seconds) => (Number.isFinite(seconds) ? clock(seconds, 3) : ABSENT);

/** @type {Record<string, string>} */
const ENDS = { one: "st", two: "nd", few: "rd", other: "th" };
/** @param {number} place */
export const ordinal = (place) => `${place}${ENDS[new Intl.PluralRules("en", { type: "ordinal" }).select(place)]}`;

/**
 * What somebody is called in the order and the menu: built-in drivers in plain words, people by their names.
 * @param {string} name
 */
export function called(name) {
  const [, number = "", source] = /** @type {RegExpExecArray} */ (/^(\d+ )?(.*)$/.exec(name));
  if (source.startsWith("human:")) return number + source.slice("human:".length);
  if (!/^driver(:|$)/.test(source)) return name;
  const { pace, ...others } = Object.fromEntries(source.slice("driver:".length).split(",").filter(Boolean).map((one) => one.split("=")));
  const told = [pace && `${percent(Number(pace))} pace`, ...Object.entries(others).map(([what, value]) => (what === "temper" ? value : `${what} ${value}`))];
  return `${number}Built-in driver${told.some(Boolean) ? `, ${told.filter(Boolean).join(", ")}` : ""}`;
}

/** @param {string} name of a circuit or a car, or its file */
export function titled(name) {
  const words = name.replace(/(\/circuit)?\.toml$/, "").split("/").at(-1) ?? "";
  return words.split("-").map((word) => (/^[a-z]+\d+$/.test(word) ? word.toUpperCase() : word[0].toUpperCase() + word.slice(1))).join(" ");
}
