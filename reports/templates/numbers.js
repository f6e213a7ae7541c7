// Numbers as they are written everywhere.

export const ABSENT = "–";
const MINUS = "−";
/** @type {Map<number, Intl.NumberFormat>} */
const formats = new Map();

/**
 * A number; what rounds to zero has no minus.
 * @param {number | null | undefined} value
 */
export const number = (value, digits = 0) => {
  if (value === null || value === undefined) return ABSENT;
  const format = formats.get(digits) ?? new Intl.NumberFormat("en", { minimumFractionDigits: digits, maximumFractionDigits: digits });
  formats.set(digits, format);
  return format.format(value).replace(/^-(?=0[.0]*$)/, "").replace("-", MINUS);
};

/**
 * A number, with + where more than zero of it is left.
 * @param {number | null | undefined} value
 */
export const signed = (value, digits = 1) => ((value ?? 0) > 0 && /[1-9]/.test(number(value, digits)) ? "+" : "") + number(value, digits);

/**
 * A difference, with its sign in any case.
 * @param {number} value
 * @param {number} digits
 */
export function difference(value, digits) {
  const text = Math.abs(value).toFixed(digits);
  return `${value < 0 && Number(text) > 0 ? MINUS : "+"}${text}`;
}

/**
 * A share in per cent, without the sign.
 * @param {number | null | undefined} share
 */
export const percent = (share, digits = 0) => (share === null || share === undefined ? ABSENT : number(100 * share, digits));

/**
 * How many there are of something.
 * @param {number} value
 * @param {string} what one of them
 */
export const count = (value, what) => `${number(value)} ${what}${value === 1 ? "" : "s"}`;

/**
 * A time as minutes and seconds.
 * @param {number} seconds
 */
export function clock(seconds, digits = 1) {
  const [units, second] = [Math.max(Math.round(seconds * 10 ** digits), 0), 10 ** digits];
  return `${Math.floor(units / second / 60)}:${((units % (60 * second)) / second).toFixed(digits).padStart(3 + digits, "0")}`;
}

/** @param {string} text */
export const capital = (text) => text[0].toUpperCase() + text.slice(1);

/**
 * A name in so many letters at most: how it begins and how it ends.
 * @param {string} name
 * @param {number} letters
 */
export const shortened = (name, letters) =>
  name.length <= letters ? name : `${name.slice(0, Math.ceil((letters - 1) / 2))}…${name.slice(-Math.floor((letters - 1) / 2))}`;
