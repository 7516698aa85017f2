"use strict";
// The table of configurations, with sorting, a filter by technique, and a choice of columns.

const table = { sort: null, down: false, technique: "", columns: {} }; // columns: chosen ones, by those shown at first

function fillTable(rows, columns, shown, onChoose) {
  const box = byId("table"), refill = () => fillTable(rows, columns, shown, onChoose);
  const chosen = table.columns[shown] ??= new Set(shown), names = columns.filter((name) => chosen.has(name));
  const techniques = [...new Set(rows.map((row) => row.technique))], filter = box.querySelector("select");
  if (!techniques.includes(table.technique)) table.technique = "";
  filter.replaceChildren(new Option("all", ""), ...techniques.map((one) => new Option(one, one)));
  filter.value = table.technique;
  filter.onchange = () => refill(table.technique = filter.value);
  box.querySelector(".columns").replaceChildren(...columns.map((name) => {
    const input = make("input", { type: "checkbox", checked: chosen.has(name) });
    input.onchange = () => refill(chosen[input.checked ? "add" : "delete"](name));
    return make("label", {}, input, ` ${name}`);
  }));
  const head = box.querySelector("thead tr");
  head.replaceChildren(...["spec", ...names].map((name, at) => {
    const onclick = () => {
      Object.assign(table, { sort: name, down: name === table.sort && !table.down });
      refill();
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
  const visible = rows.filter((row) => !table.technique || row.technique === table.technique);
  if (table.sort) visible.sort(order);
  box.querySelector("tbody").replaceChildren(...visible.map((row) => {
    const button = make("button", { type: "button", onclick: () => onChoose(row) }, ...breakable(row.label));
    const cells = names.map((name) => make("td", {}, row.values[name]?.[1] ?? "–"));
    return make("tr", { className: row.front ? "front" : "" }, make("th", { scope: "row", title: row.full }, button), ...cells);
  }));
}
