"use strict";
// The table of configurations, which is sorted by any column, filtered by technique, and has the columns that the reader chooses.

const PAGE_ROWS = 500; // listed at first, and more at each press of the button
const table = { sort: null, down: false, columns: {} }; // columns: the chosen ones, by those of a kind of scene at first

function fillTable({ rows, columns, shown }, onChoose) {
  const box = byId("table"), chosen = table.columns[shown] ??= new Set(shown);
  const fill = () => fillRows(rows, columns.filter((name) => chosen.has(name)), onChoose);
  const techniques = [...new Set(rows.map((row) => row.technique))], filter = box.querySelector("select"), before = filter.value;
  filter.replaceChildren(new Option("all", ""), ...techniques.map((name) => new Option(name)));
  filter.value = techniques.includes(before) ? before : "";
  filter.onchange = fill;
  box.querySelector(".columns").replaceChildren(...columns.map((name) => {
    const input = make("input", { type: "checkbox", checked: chosen.has(name) });
    input.onchange = () => {
      chosen[input.checked ? "add" : "delete"](name);
      fill();
    };
    return make("label", {}, input, name);
  }));
  fill();
}

function fillRows(rows, names, onChoose, most = PAGE_ROWS) {
  const box = byId("table"), head = box.querySelector("thead tr"), more = box.querySelector(".more"), technique = box.querySelector("select").value;
  head.replaceChildren(...["spec", ...names].map((name, at) => {
    const onclick = () => {
      Object.assign(table, { sort: name, down: name === table.sort && !table.down });
      fillRows(rows, names, onChoose, most);
      head.cells[at].firstChild.focus();
    };
    const button = make("button", { type: "button", textContent: name, title: `sort by ${name}`, onclick });
    return make("th", { scope: "col", ariaSort: name !== table.sort ? "none" : table.down ? "descending" : "ascending" }, button);
  }));
  const value = (row) => table.sort === "spec" ? row.spec : row.values[table.sort]?.[0] ?? null;
  const order = (a, b) => {
    const [x, y] = [value(a), value(b)];
    if (x === null || y === null) return (x === null) - (y === null); // missing values come last in both directions
    return (x < y ? -1 : x > y ? 1 : 0) * (table.down ? -1 : 1);
  };
  const found = rows.filter((row) => !technique || row.technique === technique);
  if (table.sort) found.sort(order);
  more.hidden = found.length <= most;
  more.textContent = `${most} of ${found.length} configurations are listed; list ${PAGE_ROWS} more`;
  more.onclick = () => fillRows(rows, names, onChoose, most + PAGE_ROWS);
  box.querySelector("tbody").replaceChildren(...found.slice(0, most).map((row) => {
    const button = make("button", { type: "button", onclick: () => onChoose(row) }, ...breakable(row.label));
    const cells = names.map((name) => make("td", {}, row.values[name]?.[1] ?? "–"));
    return make("tr", { className: row.front ? "front" : "" }, make("th", { scope: "row", title: row.full }, button), ...cells);
  }));
}
