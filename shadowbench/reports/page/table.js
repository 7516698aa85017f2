"use strict";
// The table of configurations, with sorting, a filter by technique, and a choice of columns.

const PAGE_ROWS = 500;
const table = { sort: null, down: false, technique: "", columns: {}, rows: PAGE_ROWS }; // columns: chosen ones, by those shown at first

function fillTable(rows, columns, shown, onChoose) {
  const box = document.getElementById("table"), head = box.querySelector("thead tr"), body = box.querySelector("tbody");
  const chosen = table.columns[shown] ??= new Set(shown), names = columns.filter((name) => chosen.has(name));
  const refill = () => fillTable(rows, columns, shown, onChoose);
  const techniques = [...new Set(rows.map((row) => row.technique))];
  if (!techniques.includes(table.technique)) table.technique = "";
  const filter = box.querySelector("select");
  filter.replaceChildren(new Option("all", ""), ...techniques.map((one) => new Option(one, one)));
  filter.value = table.technique;
  filter.onchange = () => refill(table.technique = filter.value);
  box.querySelector(".columns").replaceChildren(...columns.map((name) => {
    const label = document.createElement("label"), input = document.createElement("input");
    Object.assign(input, { type: "checkbox", checked: chosen.has(name) });
    input.addEventListener("change", () => refill(chosen[input.checked ? "add" : "delete"](name)));
    label.append(input, ` ${name}`);
    return label;
  }));
  head.replaceChildren(...["spec", ...names].map((name) => {
    const cell = document.createElement("th"), button = document.createElement("button");
    cell.scope = "col";
    if (name === table.sort) cell.setAttribute("aria-sort", table.down ? "descending" : "ascending");
    Object.assign(button, { type: "button", textContent: name, title: `sort by ${name}` });
    button.addEventListener("click", () => {
      Object.assign(table, { sort: name, down: name === table.sort && !table.down });
      refill();
      [...head.querySelectorAll("button")].find((one) => one.textContent === name).focus();
    });
    cell.append(button);
    return cell;
  }));
  const value = (row) => table.sort === "spec" ? row.spec : row.values[table.sort]?.[0] ?? null;
  const order = (a, b) => {
    const [x, y] = [value(a), value(b)];
    if (x === null || y === null) return (x === null) - (y === null); // missing values come last in both directions
    return (x < y ? -1 : x > y ? 1 : 0) * (table.down ? -1 : 1);
  };
  const visible = rows.filter((row) => !table.technique || row.technique === table.technique);
  if (table.sort) visible.sort(order);
  const more = box.querySelector(".more");
  more.hidden = visible.length <= table.rows;
  more.textContent = `${table.rows} of ${visible.length} configurations are listed; list ${PAGE_ROWS} more`;
  more.onclick = () => refill(table.rows += PAGE_ROWS);
  body.replaceChildren(...visible.slice(0, table.rows).map((row) => {
    const line = document.createElement("tr"), head = document.createElement("th"), button = document.createElement("button");
    line.classList.toggle("front", row.front);
    Object.assign(head, { scope: "row", title: row.full });
    Object.assign(button, { type: "button", disabled: !row.scene });
    button.append(...breakable(row.label));
    button.addEventListener("click", () => onChoose(row));
    head.append(button);
    line.append(head, ...names.map((name) => Object.assign(document.createElement("td"), { textContent: row.values[name]?.[1] ?? "–" })));
    return line;
  }));
}
