
"use strict";

// Sorting: a button in each header; absent values (empty keys) stay last either way.
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  const body = table.tBodies[0];
  const markGroups = () => table.classList.toggle("by-rank", heads[0].ariaSort === "ascending");
  const compare = (a, b) =>
    a === "" || b === "" ? 0 : isNaN(a) || isNaN(b) ? a.localeCompare(b, "en", { numeric: true }) : a - b;
  heads.forEach((head, column) => {
    const button = head.querySelector("button");
    button?.addEventListener("click", () => {
      const before = head.getAttribute("aria-sort");
      const order = before ? (before === "ascending" ? "descending" : "ascending") : button.dataset.first;
      const sign = order === "ascending" ? 1 : -1;
      const key = (row) => row.cells[column].dataset.value;
      const rows = [...body.rows].sort(
        (a, b) => (key(a) === "") - (key(b) === "") || sign * compare(key(a), key(b)),
      );
      body.append(...rows);
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", order);
      markGroups();
    });
  });
  markGroups();
}

// The Pareto filter's charts.
const source = document.getElementById("pareto-points");
if (source) {
  const columns = JSON.parse(source.textContent);
  const points = columns.name.map((name, i) => ({
    name,
    lap: columns.lap[i],
    off: columns.off[i],
    contacts: columns.contacts[i],
    survives: columns.survives[i],
    rank: columns.rank[i],
  }));
  const field = points.filter((point) => !point.survives);
  const survivors = points.filter((point) => point.survives && point.rank === null);
  const finalists = points.filter((point) => point.rank !== null);
  // Finalists get their labels first, in their order; a label that would cover another is left to the tip.
  const toLabel = [...finalists.sort((a, b) => a.rank - b.rank), ...survivors];
  const shortened = (name) => (name.length > 28 ? `${name.slice(0, 27)}…` : name);
  const describe = (point) =>
    `${shortened(point.name)}\nlap ${point.lap.toFixed(3)} s\noff course ${(100 * point.off).toFixed(2)} %\n` +
    `${point.contacts.toFixed(2)} contacts per km` +
    (point.rank !== null ? `\nrank ${point.rank} in the round robin` : point.survives ? "\nsurvives" : "");

  const laps = d3.extent(points, (point) => point.lap);
  // 1, 2, 5, 10, ...: a square-root axis crowds the small ones, so those too near their neighbour are left out.
  const rootTicks = (largest) => {
    const ticks = [];
    for (const decade of [100, 10, 1, 0.1, 0.01, 0.001])
      for (const tick of [5 * decade, 2 * decade, decade]) {
        const above = ticks.length ? Math.sqrt(ticks[0]) : Infinity;
        const room = Math.min(above - Math.sqrt(tick), Math.sqrt(tick));
        if (tick <= largest && room > 0.07 * Math.sqrt(largest)) ticks.unshift(tick);
      }
    return [0, ...ticks];
  };
  const chart = (value, width, format, labels) => {
    const at = { x: "lap", y: value };
    const top = d3.max(points, (point) => point[value]);
    const plot = Plot.plot({
      width,
      height: Math.round(Math.min(420, Math.max(300, width * 0.68))),
      marginLeft: 44,
      insetLeft: 10,
      insetRight: 10,
      marginRight: 16,
      marginBottom: 40,
      x: { type: "log", label: "Mean best lap, s" },
      y: { type: "sqrt", label: null, grid: true, tickFormat: format, ticks: rootTicks(top), domain: [0, top || 1] },
      ariaLabel: `Lap time against ${value === "off" ? "off-course share" : "contacts per km"}`,
      marks: [
        Plot.axisX(d3.ticks(...laps, width / 70), { text: String, labelAnchor: "center", labelArrow: "none" }),
        Plot.dot(field, { ...at, r: 1.9, fill: "var(--field)", fillOpacity: 0.55 }),
        Plot.dot(survivors, { ...at, r: 3.4, fill: "var(--survivor)" }),
        Plot.dot(finalists, { ...at, r: 4.6, fill: "var(--finalist)", symbol: "diamond" }),
        ...["start", "end"].map((anchor) =>
          Plot.text(labels.filter((label) => label.anchor === anchor), {
            ...at,
            text: (point) => shortened(point.name),
            textAnchor: anchor,
            dx: anchor === "start" ? 8 : -8,
            fill: "currentColor",
            stroke: "var(--paper)",
            strokeWidth: 4,
          }),
        ),
        Plot.tip(
          points,
          Plot.pointer({ ...at, title: describe, maxRadius: 30, lineWidth: 30, lineHeight: 1.35, fontSize: 12, stroke: "var(--strong-rule)" }),
        ),
      ],
    });
    // The page's own style sheet has these rules: its content policy admits no other style.
    plot.querySelector("style")?.remove();
    return plot;
  };

  const placeLabels = (plot, value, width) => {
    const x = plot.scale("x");
    const y = plot.scale("y");
    const taken = toLabel.map((point) => [x.apply(point.lap) - 4, y.apply(point[value]) - 4, 8, 8]);
    const clear = (box) =>
      taken.every(([left, top, w, h]) => box[0] > left + w || left > box[0] + box[2] || box[1] > top + h || top > box[1] + box[3]);
    const placed = [];
    for (const point of toLabel) {
      const w = 6.6 * shortened(point.name).length;
      const [px, py] = [x.apply(point.lap), y.apply(point[value])];
      for (const [anchor, left] of [["start", px + 8], ["end", px - 8 - w]]) {
        const box = [left, py - 7, w, 14];
        if (left > 44 && left + w < width && clear(box)) {
          taken.push(box);
          placed.push({ ...point, anchor });
          break;
        }
      }
    }
    return placed;
  };

  const draw = (host, value, format) => {
    const width = Math.floor(host.clientWidth);
    const labels = placeLabels(chart(value, width, format, []), value, width);
    host.querySelector("svg")?.remove();
    host.append(chart(value, width, format, labels));
  };

  for (const [id, value, format] of [["off-chart", "off", "~p"], ["contact-chart", "contacts", "~r"]]) {
    const host = document.getElementById(id);
    let drawn = 0;
    new ResizeObserver(() => {
      if (host.clientWidth === drawn) return;
      drawn = host.clientWidth;
      draw(host, value, format);
    }).observe(host);
  }
}
