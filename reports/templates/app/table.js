// A table that sorts by its heads and filters by a field; both are kept in the address.

// columns (those that are false are left out): key, head, and optionally kind (class), value (row => what it sorts by), cell (row => what is shown),
// first ("descending" unless said otherwise), title. Without `value` a column does not sort.
function dataTable(id, columns, rows, { sort, text = null, prefix = "", grouped = null, label = id, shown = 200 }) {
  const { params } = here();
  let [descending, by] = /^(-?)(.*)$/.exec(params.get(`${prefix}sort`) ?? sort).slice(1);
  let query = params.get(`${prefix}q`) ?? "";
  let limit = shown;
  columns = columns.filter(Boolean);
  const column = () => columns.find((one) => one.key === by && one.value) ?? columns.find((one) => one.value);
  const compare = (a, b) => (typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true }));
  const absent = (value) => value === null || value === undefined;

  const body = h("tbody");
  const heads = columns.map((one) => {
    const button = one.value && h("button", { type: "button", title: one.title, onclick: () => order(one) }, one.head);
    return h("th", { scope: "col", class: one.kind ?? "number" }, button ?? (one.head ? one.head : h("span", { class: "unseen" }, one.unseen ?? "")));
  });
  const table = h("table", { id, class: "sortable" }, h("thead", {}, h("tr", {}, heads)), body);
  const said = h("p", { class: "note", "aria-live": "polite" });
  const more = h("button", { type: "button", class: "more", onclick: () => { limit = Infinity; fill(); } });

  function order(one) {
    if (one === column()) descending = descending ? "" : "-";
    else [by, descending] = [one.key, one.first === "ascending" ? "" : "-"];
    keep(`${prefix}sort`, descending + by === sort ? "" : descending + by);
    fill();
  }

  function fill() {
    const { value, key } = column();
    const sign = descending ? -1 : 1;
    const wanted = query.trim().toLowerCase();
    const found = wanted ? rows.filter((row) => text(row).toLowerCase().includes(wanted)) : rows;
    const sorted = [...found].sort((a, b) => {
      const [x, y] = [value(a), value(b)];
      return absent(x) - absent(y) || (absent(x) ? 0 : sign * compare(x, y));
    });
    body.replaceChildren(
      ...sorted.slice(0, limit).map((row, i) => {
        const opens = grouped && key === grouped.key && i > 0 && value(sorted[i - 1]) !== value(row);
        return h("tr", { class: opens ? "opens" : null }, columns.map((one) => cell(one, row)));
      }),
    );
    table.classList.toggle("grouped", Boolean(grouped && key === grouped.key));
    heads.forEach((head, i) => {
      if (columns[i].key === key && columns[i].value) head.setAttribute("aria-sort", descending ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    });
    more.hidden = sorted.length <= limit;
    more.textContent = `Show all ${number(sorted.length)}`;
    said.textContent = wanted ? `${number(found.length)} of ${number(rows.length)}` : "";
  }

  function cell(one, row) {
    const shown = one.cell ? one.cell(row) : one.value(row);
    if (shown instanceof HTMLTableCellElement) return shown;
    const heading = (one.kind ?? "").split(" ")[0] === "name";
    return h(heading ? "th" : "td", { class: one.kind ?? "number", scope: heading ? "row" : null }, shown ?? ABSENT);
  }

  const filter =
    text &&
    h("label", { class: "filter" }, "Filter ", h("input", {
      type: "search", value: query, placeholder: "name", "aria-label": `Filter ${label}`,
      oninput: (event) => { query = event.target.value; keep(`${prefix}q`, query); fill(); },
    }));
  fill();
  return [filter && h("div", { class: "controls" }, filter, said), scroll(label, table), more];
}

// What another world measures of a seat.
const ownColumns = () => [
  measured("score") && { key: "score", head: "Score", value: (row) => row.score, cell: (row) => number(row.score, 2) },
  ...ownNames.map((name) => ({ key: `own-${name}`, head: plain(name), value: (row) => row.own[name] ?? null, cell: (row) => number(row.own[name] ?? null, 2) })),
  !onCircuit && measured("distance_m") && { key: "distance", head: "Distance, m", value: (row) => row.distance_m, cell: (row) => number(row.distance_m, 1) },
];

const entrantColumn = (extra = () => null) => ({
  key: "name", head: "Entrant", kind: "name", first: "ascending",
  value: (row) => nameOf(row.entrant),
  cell: (row) => [entrantLink(row.entrant), " ", chips(row.entrant), extra(row)],
});
const RANKS = "Ranks that are possible: the best is 1 + the number of entrants proven better, the worst lies ahead of those only that are proven worse, after Holm's correction.";
const rankColumn = {
  key: "rank", head: "Rank", kind: "rank", first: "ascending", title: RANKS,
  value: (row) => row.rank,
  cell: rankText,
};
