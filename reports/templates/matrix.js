// The map of a matrix: every cell, in the colours of a measure.

import { byId, dataOf, h } from "./race/element.js";

const data = dataOf("data");
const many = [...data.dimensions.keys()].filter((n) => data.dimensions[n].levels.length > 1);
const WORDS = ["no sign", "unconfirmed", "worse"];
/** @type {{ measure: number, down: Set<number>, chosen: number | null }} */
const state = { measure: -1, down: new Set(many.filter((n) => ["scenario", "place"].includes(data.dimensions[n].field))), chosen: null };

/* By how many margins a finding is worse; what has no margin is seen in widths of its interval. */
function margins(finding, measure) {
  if (finding[0] === null) return null;
  const unit = data.measures[measure].margin || (finding[2] - finding[1]) / 2;
  return unit > 0 ? finding[0] / unit : 0;
}

function look(cell) {
  const shown = state.measure < 0 ? cell[2].map((_, n) => n) : [state.measure];
  const all = shown.map((n) => margins(cell[2][n], n)).filter((value) => value !== null);
  return { value: all.length ? Math.max(...all) : null, verdict: Math.max(...shown.map((n) => cell[2][n][5])) };
}

function shade(value) {
  if (value === null) return "c-0";
  if (value > 4) return "c-n4";
  if (value > 2) return "c-n3";
  if (value > 1) return "c-n2";
  if (value > 0.25) return "c-n1";
  if (value < -2) return "c-p3";
  if (value < -1) return "c-p2";
  if (value < -0.25) return "c-p1";
  return "c-0";
}

/* The combinations of levels along an axis that any cell has, in order. */
function axis(dimensions) {
  const seen = new Map();
  for (const cell of data.cells) {
    const key = dimensions.map((n) => cell[0][n]);
    seen.set(key.join(), key);
  }
  return [...seen.values()].sort((a, b) => { for (let k = 0; k < a.length; k++) if (a[k] !== b[k]) return a[k] - b[k]; return 0; });
}

let places = new Map();

function draw() {
  const down = many.filter((n) => state.down.has(n)), across = many.filter((n) => !state.down.has(n));
  const rows = axis(down), columns = axis(across);
  const rowOf = new Map(rows.map((key, n) => [key.join(), n])), columnOf = new Map(columns.map((key, n) => [key.join(), n]));
  const room = Math.max(400, byId("grid").clientWidth);
  const named = (dimensions, key) => dimensions.map((n, k) => data.dimensions[n].levels[key[k]]);
  const gutter = down.map((n) => 14 + 7.1 * Math.max(...data.dimensions[n].levels.map((text) => text.length)));
  const left = gutter.reduce((sum, width) => sum + width, 0) + 4;
  const side = Math.max(11, Math.min(34, Math.floor((room - left - 12) / Math.max(columns.length, 1))));
  const height = Math.min(side, 22);
  /* Names over the narrowest columns stand upright where they would not fit. */
  const upright = across.map((n, k) => k === across.length - 1 && data.dimensions[n].levels.some((text) => 6.6 * text.length + 4 > side));
  const heights = across.map((n, k) => (upright[k] ? 12 + 6.3 * Math.max(...data.dimensions[n].levels.map((text) => text.length)) : 18));
  const tops = heights.map((_, k) => heights.slice(0, k).reduce((sum, one) => sum + one, 0));
  const top = heights.reduce((sum, one) => sum + one, 0) + 6;
  const svg = h("svg:svg", { width: left + side * columns.length + 12, height: top + height * rows.length + 4, tabindex: 0, role: "img", "aria-label": "heat map of all cells" });
  /* A heading stands once over all that it has in common; left out where it would not fit. */
  across.forEach((_, k) => {
    for (let first = 0; first < columns.length;) {
      let last = first + 1;
      while (last < columns.length && columns[last].slice(0, k + 1).join() === columns[first].slice(0, k + 1).join()) last++;
      const text = named(across, columns[first])[k], width = side * (last - first);
      const fits = Math.floor((width - 4) / 6.6);
      const x = left + side * first;
      if (upright[k]) svg.append(h("svg:text", { x: 0, y: 0, transform: `translate(${x + side / 2 + 4} ${top - 8}) rotate(-90)` }, text));
      else if (fits >= 3) svg.append(h("svg:text", { x: x + 2, y: tops[k] + 13 }, text.length > fits ? `…${text.slice(1 - fits)}` : text));
      if (first) svg.append(h("svg:line", { class: "split", x1: x - 0.5, x2: x - 0.5, y1: tops[k], y2: top }));
      first = last;
    }
  });
  let x = 0;
  down.forEach((_, k) => {
    rows.forEach((key, n) => {
      if (n && rows[n - 1].slice(0, k + 1).join() === key.slice(0, k + 1).join()) return;
      svg.append(h("svg:text", { x, y: top + height * n + height / 2 + 4 }, named(down, key)[k]));
      if (n && k === 0) svg.append(h("svg:line", { class: "split", x1: 0, x2: left, y1: top + height * n - 0.5, y2: top + height * n - 0.5 }));
    });
    x += gutter[k];
  });
  places = new Map();
  const rects = data.cells.map((cell, number) => {
    const [row, column] = [rowOf.get(down.map((n) => cell[0][n]).join()) ?? 0, columnOf.get(across.map((n) => cell[0][n]).join()) ?? 0];
    places.set(`${row},${column}`, number);
    const seen = look(cell), at = { x: left + side * column, y: top + height * row };
    const rect = h("svg:rect", { ...at, width: side, height, class: shade(seen.value), "data-cell": number, "data-at": `${row},${column}` });
    svg.append(rect);
    if (seen.verdict === 2) svg.append(h("svg:circle", { cx: at.x + side / 2, cy: at.y + height / 2, r: 2.6 }));
    return rect;
  });
  const frame = h("svg:rect", { class: "chosen", width: side, height, visibility: "hidden" });
  svg.append(frame);
  const choose = (number) => {
    const rect = rects[number];
    if (!rect) return;
    state.chosen = number;
    for (const name of ["x", "y"]) frame.setAttribute(name, rect.getAttribute(name) ?? "");
    frame.setAttribute("visibility", "visible");
    tell(data.cells[number]);
  };
  /** The cell of an event, if it has one. */
  const cellOf = (/** @type {Event} */ { target }) => (target instanceof SVGElement && target.dataset.cell ? Number(target.dataset.cell) : null);
  svg.addEventListener("pointerover", (event) => {
    const over = cellOf(event);
    if (over !== null) choose(over);
  });
  svg.addEventListener("click", (event) => {
    const pressed = cellOf(event);
    const path = pressed !== null && data.cells[pressed][3];
    if (path) location.href = path;
  });
  svg.addEventListener("keydown", (event) => {
    const step = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] }[event.key];
    if (!step) return;
    event.preventDefault();
    const at = state.chosen === null ? null : rects[state.chosen].dataset.at;
    let [row, column] = at ? at.split(",").map(Number) : [-step[0], -step[1]];
    for (let tries = 0; tries < Math.max(rows.length, columns.length); tries++) {
      row += step[0];
      column += step[1];
      if (places.has(`${row},${column}`)) return choose(places.get(`${row},${column}`));
    }
  });
  byId("grid").replaceChildren(svg);
  if (state.chosen !== null) choose(state.chosen);
}

function number(value, measure, sign) {
  if (value === null) return "";
  const shown = sign && data.measures[measure].relative ? 100 * value : value;
  const text = Math.abs(shown) >= 100 ? shown.toFixed(0) : String(Number(shown.toPrecision(3)));
  return sign && shown > 0 ? `+${text}` : text.replace("-", "−");
}

function tell(cell) {
  const detail = byId("detail");
  const title = many.map((n) => data.dimensions[n].levels[cell[0][n]]).join(", ") || "the only cell";
  const table = h("table"), head = h("tr");
  for (const text of ["Measure", data.names[0], data.names[1], "Worse by", "95 % interval", "Decision"]) head.append(h("th", { scope: "col" }, text));
  const body = h("tbody");
  cell[2].forEach((finding, n) => {
    const [worse, low, high, policy, baseline, verdict] = finding, { name, unit, relative } = data.measures[n], row = h("tr");
    row.append(h("th", { scope: "row" }, name));
    row.append(h("td", {}, `${number(policy, n, false)} ${policy === null ? "" : unit}`), h("td", {}, `${number(baseline, n, false)} ${baseline === null ? "" : unit}`));
    row.append(h("td", {}, worse === null ? "not measured" : `${number(worse, n, true)} ${relative ? "%" : unit}`), h("td", {}, worse === null ? "" : `${number(low, n, true)} to ${number(high, n, true)}`));
    row.append(h("td", { class: ["", "cannot", "fail"][verdict] }, WORDS[verdict]));
    body.append(row);
  });
  const thead = h("thead");
  thead.append(head);
  table.append(thead, body);
  const runs = h("p", { class: "note" }, `${cell[1]} runs of each. `);
  if (cell[3]) runs.append(h("a", { href: cell[3] }, "the worst run, side by side"));
  detail.replaceChildren(h("h3", {}, title), table, runs);
}

function remember() {
  const down = [...state.down].map((n) => data.dimensions[n].field).join("+");
  history.replaceState(null, "", `#measure=${state.measure < 0 ? "worst" : data.measures[state.measure].name}&down=${down}`);
}

function recall() {
  const said = new URLSearchParams(location.hash.slice(1));
  const measure = data.measures.findIndex((one) => one.name === said.get("measure"));
  state.measure = measure;
  const down = said.get("down");
  if (down !== null) state.down = new Set(many.filter((n) => down.split("+").join(" ").split(" ").includes(data.dimensions[n].field)));
}

function controls() {
  const select = byId("measure", HTMLSelectElement);
  select.append(h("option", { value: -1 }, "the worst measure"));
  data.measures.forEach((measure, n) => select.append(h("option", { value: n }, measure.name)));
  select.value = String(state.measure);
  select.addEventListener("change", () => { state.measure = Number(select.value); remember(); draw(); });
  const axes = byId("axes");
  for (const n of many) {
    const label = h("label"), box = h("input", { type: "checkbox", value: n });
    box.checked = state.down.has(n);
    box.addEventListener("change", () => { state.down[box.checked ? "add" : "delete"](n); remember(); draw(); });
    label.append(box, data.dimensions[n].name);
    axes.append(label);
  }
  const key = byId("key");
  for (const [name, text] of [["c-p3", "better"], ["c-0", "alike"], ["c-n1", "worse"], ["c-n2", "by a margin"], ["c-n4", "by four"]]) {
    const entry = h("span");
    entry.append(h("i", { class: name }), text);
    key.append(entry);
  }
  key.append(h("span", {}, "● proven"));
}

recall();
controls();
draw();
addEventListener("resize", draw);
