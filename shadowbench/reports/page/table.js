"use strict";
// The table of configurations, which is sorted by any column, and shows some of them at first.

const table = { sort: null, down: false };

function fillTable(rows, columns, shown, onChoose) {
  const box = byId("table"), refill = () => fillTable(rows, columns, shown, onChoose), every = box.querySelector("input");
  const names = columns.filter((name) => every.checked || shown.includes(name)), head = box.querySelector("thead tr");
  every.onchange = refill;
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
  box.querySelector("tbody").replaceChildren(...(table.sort ? [...rows].sort(order) : rows).map((row) => {
    const button = make("button", { type: "button", onclick: () => onChoose(row) }, ...breakable(row.label));
    const cells = names.map((name) => make("td", {}, row.values[name]?.[1] ?? "–"));
    return make("tr", { className: row.front ? "front" : "" }, make("th", { scope: "row", title: row.full }, button), ...cells);
  }));
}
