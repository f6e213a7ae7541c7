// Elements. All text goes through text nodes, so nothing in it is markup.

/** @typedef {Node | string | number | boolean | null | undefined | Child[]} Child */

/**
 * An element with attributes, of which functions are what hears an event, and with children; neither has what is null or false.
 * @template {string} Tag
 * @param {Tag} tag `svg:` before it makes an element of a drawing
 * @param {{ [name: string]: any }} [attributes]
 * @param {Child[]} children
 * @returns {Tag extends keyof HTMLElementTagNameMap ? HTMLElementTagNameMap[Tag]
 *   : Tag extends `svg:${infer Name extends keyof SVGElementTagNameMap}` ? SVGElementTagNameMap[Name] : Element}
 */
export const h = (tag, attributes = {}, ...children) => {
  const drawn = tag.startsWith("svg:");
  const node = drawn ? document.createElementNS("http://www.w3.org/2000/svg", tag.slice(4)) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...shown(children));
  return /** @type {any} */ (node);
};

/**
 * Children without those that are left out.
 * @param {Child[]} children
 * @returns {(Node | string)[]}
 */
export const shown = (children) =>
  /** @type {any[]} */ (children).flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false);

/**
 * The page's element of an id.
 * @template {Element} [Kind=HTMLElement]
 * @param {string} id
 * @param {new () => Kind} [kind] of element
 * @returns {Kind}
 */
export function byId(id, kind = /** @type {any} */ (HTMLElement)) {
  const found = document.getElementById(id);
  if (!(found instanceof kind)) throw new Error(`The page has no ${kind.name} of the id ${id}.`);
  return found;
}

/**
 * What Python has written into the page as JSON.
 * @param {string} id
 */
export const dataOf = (id) => JSON.parse(byId(id).textContent ?? "");

/**
 * All elements of the page that a selector finds.
 * @param {string} selector
 * @param {ParentNode} [within]
 * @returns {HTMLElement[]}
 */
export const all = (selector, within = document) => [.../** @type {NodeListOf<HTMLElement>} */ (within.querySelectorAll(selector))];
