const SVG = "http://www.w3.org/2000/svg";
const data = JSON.parse(document.getElementById("data").textContent);
const many = data.dimensions.map((dimension, n) => n).filter((n) => data.dimensions[n].levels.length > 1);
const WORDS = ["no sign", "unconfirmed", "worse"];
const state = { measure: -1, down: new Set(many.filter((n) => ["scenario", "place"].includes(data.dimensions[n].field))), chosen: null };

function element(name, attributes = {}, text = null, space = null) {
  const made = space ? document.createElementNS(space, name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== null) made.textContent = text;
  return made;
}

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
  const room = Math.max(400, document.getElementById("grid").clientWidth);
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
  const svg = element("svg", { width: left + side * columns.length + 12, height: top + height * rows.length + 4, tabindex: 0, role: "img", "aria-label": "heat map of all cells" }, null, SVG);
  /* A heading stands once over all that it has in common; left out where it would not fit. */
  across.forEach((_, k) => {
    for (let first = 0; first < columns.length;) {
      let last = first + 1;
      while (last < columns.length && columns[last].slice(0, k + 1).join() === columns[first].slice(0, k + 1).join()) last++;
      const text = named(across, columns[first])[k], width = side * (last - first);
      const fits = Math.floor((width - 4) / 6.6);
      const x = left + side * first;
      if (upright[k]) svg.append(element("text", { x: 0, y: 0, transform: `translate(${x + side / 2 + 4} ${top - 8}) rotate(-90)` }, text, SVG));
      else if (fits >= 3) svg.append(element("text", { x: x + 2, y: tops[k] + 13 }, text.length > fits ? "…" + text.slice(1 - fits) : text, SVG));
      if (first) svg.append(element("line", { class: "split", x1: x - 0.5, x2: x - 0.5, y1: tops[k], y2: top }, null, SVG));
      first = last;
    }
  });
  let x = 0;
  down.forEach((_, k) => {
    rows.forEach((key, n) => {
      if (n && rows[n - 1].slice(0, k + 1).join() === key.slice(0, k + 1).join()) return;
      svg.append(element("text", { x, y: top + height * n + height / 2 + 4 }, named(down, key)[k], SVG));
      if (n && k === 0) svg.append(element("line", { class: "split", x1: 0, x2: left, y1: top + height * n - 0.5, y2: top + height * n - 0.5 }, null, SVG));
    });
    x += gutter[k];
  });
  places = new Map();
  data.cells.forEach((cell, number) => {
    const row = rowOf.get(down.map((n) => cell[0][n]).join()), column = columnOf.get(across.map((n) => cell[0][n]).join());
    places.set(`${row},${column}`, number);
    const seen = look(cell), at = { x: left + side * column, y: top + height * row };
    svg.append(element("rect", { ...at, width: side, height, class: shade(seen.value), "data-cell": number, "data-at": `${row},${column}` }, null, SVG));
    if (seen.verdict === 2) svg.append(element("circle", { cx: at.x + side / 2, cy: at.y + height / 2, r: 2.6 }, null, SVG));
  });
  const frame = element("rect", { class: "chosen", width: side, height, visibility: "hidden" }, null, SVG);
  svg.append(frame);
  const choose = (number) => {
    const rect = svg.querySelector(`[data-cell="${number}"]`);
    if (!rect) return;
    state.chosen = number;
    frame.setAttribute("x", rect.getAttribute("x"));
    frame.setAttribute("y", rect.getAttribute("y"));
    frame.setAttribute("visibility", "visible");
    tell(data.cells[number]);
  };
  svg.addEventListener("pointerover", (event) => { if (event.target.dataset.cell) choose(Number(event.target.dataset.cell)); });
  svg.addEventListener("click", (event) => {
    const path = event.target.dataset.cell && data.cells[Number(event.target.dataset.cell)][3];
    if (path) location.href = path;
  });
  svg.addEventListener("keydown", (event) => {
    const step = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] }[event.key];
    if (!step) return;
    event.preventDefault();
    const rect = state.chosen === null ? null : svg.querySelector(`[data-cell="${state.chosen}"]`);
    let [row, column] = rect ? rect.dataset.at.split(",").map(Number) : [-step[0], -step[1]];
    for (let tries = 0; tries < Math.max(rows.length, columns.length); tries++) {
      row += step[0];
      column += step[1];
      if (places.has(`${row},${column}`)) return choose(places.get(`${row},${column}`));
    }
  });
  document.getElementById("grid").replaceChildren(svg);
  if (state.chosen !== null) choose(state.chosen);
}

function number(value, measure, sign) {
  if (value === null) return "";
  const shown = sign && data.measures[measure].relative ? 100 * value : value;
  const text = Math.abs(shown) >= 100 ? shown.toFixed(0) : String(Number(shown.toPrecision(3)));
  return sign && shown > 0 ? `+${text}` : text.replace("-", "−");
}

function tell(cell) {
  const detail = document.getElementById("detail");
  const title = many.map((n) => data.dimensions[n].levels[cell[0][n]]).join(", ") || "the only cell";
  const table = element("table"), head = element("tr");
  for (const text of ["Measure", data.names[0], data.names[1], "Worse by", "95 % interval", "Decision"]) head.append(element("th", { scope: "col" }, text));
  const body = element("tbody");
  cell[2].forEach((finding, n) => {
    const [worse, low, high, policy, baseline, verdict] = finding, { name, unit, relative } = data.measures[n], row = element("tr");
    row.append(element("th", { scope: "row" }, name));
    row.append(element("td", {}, `${number(policy, n, false)} ${policy === null ? "" : unit}`), element("td", {}, `${number(baseline, n, false)} ${baseline === null ? "" : unit}`));
    row.append(element("td", {}, worse === null ? "not measured" : `${number(worse, n, true)} ${relative ? "%" : unit}`), element("td", {}, worse === null ? "" : `${number(low, n, true)} to ${number(high, n, true)}`));
    row.append(element("td", { class: ["", "cannot", "fail"][verdict] }, WORDS[verdict]));
    body.append(row);
  });
  const thead = element("thead");
  thead.append(head);
  table.append(thead, body);
  const runs = element("p", { class: "note" }, `${cell[1]} runs of each. `);
  if (cell[3]) runs.append(element("a", { href: cell[3] }, "the worst run, side by side"));
  detail.replaceChildren(element("h3", {}, title), table, runs);
}

function remember() {
  const down = [...state.down].map((n) => data.dimensions[n].field).join("+");
  history.replaceState(null, "", `#measure=${state.measure < 0 ? "worst" : data.measures[state.measure].name}&down=${down}`);
}

function recall() {
  const said = new URLSearchParams(location.hash.slice(1));
  const measure = data.measures.findIndex((one) => one.name === said.get("measure"));
  state.measure = measure;
  if (said.has("down")) state.down = new Set(many.filter((n) => said.get("down").split("+").join(" ").split(" ").includes(data.dimensions[n].field)));
}

function controls() {
  const select = document.getElementById("measure");
  select.append(element("option", { value: -1 }, "the worst measure"));
  data.measures.forEach((measure, n) => select.append(element("option", { value: n }, measure.name)));
  select.value = state.measure;
  select.addEventListener("change", () => { state.measure = Number(select.value); remember(); draw(); });
  const axes = document.getElementById("axes");
  for (const n of many) {
    const label = element("label"), box = element("input", { type: "checkbox", value: n });
    box.checked = state.down.has(n);
    box.addEventListener("change", () => { state.down[box.checked ? "add" : "delete"](n); remember(); draw(); });
    label.append(box, data.dimensions[n].name);
    axes.append(label);
  }
  const key = document.getElementById("key");
  for (const [name, text] of [["c-p3", "better"], ["c-0", "alike"], ["c-n1", "worse"], ["c-n2", "by a margin"], ["c-n4", "by four"]]) {
    const entry = element("span");
    entry.append(element("i", { class: name }), text);
    key.append(entry);
  }
  key.append(element("span", {}, "● proven"));
}

recall();
controls();
draw();
addEventListener("resize", draw);
