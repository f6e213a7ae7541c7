// Numbers and names as the page of test drives writes them.

export const percent = (share) => `${Math.round(100 * share)} %`;

/** @param {number} seconds */
export function lapTime(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  const ms = Math.round(seconds * 1000);
  return `${Math.floor(ms / 60000)}:${String(Math.floor(ms / 1000) % 60).padStart(2, "0")}.${String(ms % 1000).padStart(3, "0")}`;
}

export const ordinal = (place) => `${place}${{ one: "st", two: "nd", few: "rd", other: "th" }[new Intl.PluralRules("en", { type: "ordinal" }).select(place)]}`;

// What somebody is called in the order and the menu: built-in drivers in plain words, people by their names.
export function called(name) {
  const [, number = "", source] = /** @type {RegExpExecArray} */ (/^(\d+ )?(.*)$/.exec(name));
  if (source.startsWith("human:")) return number + source.slice("human:".length);
  if (!/^driver(:|$)/.test(source)) return name;
  const { pace, ...others } = Object.fromEntries(source.slice("driver:".length).split(",").filter(Boolean).map((one) => one.split("=")));
  const told = [pace && `${percent(Number(pace))} pace`, ...Object.entries(others).map(([what, value]) => (what === "temper" ? value : `${what} ${value}`))];
  return `${number}Built-in driver${told.some(Boolean) ? `, ${told.filter(Boolean).join(", ")}` : ""}`;
}

export function titled(name) {
  const words = name.replace(/(\/circuit)?\.toml$/, "").split("/").at(-1);
  return words.split("-").map((word) => (/^[a-z]+\d+$/.test(word) ? word.toUpperCase() : word[0].toUpperCase() + word.slice(1))).join(" ");
}
