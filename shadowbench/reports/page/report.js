"use strict";
// The page's data and state: the chosen scene and picture, which determine everything shown.

const byId = (id) => document.getElementById(id);
const PAGE = JSON.parse(byId("page").textContent);

function make(tag, properties, ...children) {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
}

// The text of a spec with line breaks allowed between its parameters.
const breakable = (text) => text.split(/(?<=[,:(])/).flatMap((piece) => [piece, document.createElement("wbr")]);

const data = (id) => PAGE.data[id];
const panelOf = (id) => PAGE.panels.find((panel) => panel.id === id);

let currentPanel = null; // id
let pictureScene = null; // id of the panel whose pictures are shown
const first = byId("viewer") && new Viewer(byId("viewer"), (cell) => {
  for (const button of document.querySelectorAll(".matrix button")) {
    const { spec, size, scene } = button.dataset;
    button.ariaPressed = !button.matches(".none") && scene === pictureScene && spec === cell?.spec && (size || null) == cell.size;
  }
});

// Shows a configuration in the viewer: in the current scene or, in the panel of all scenes, in the given one.
function showPicture(spec, size, scene) {
  const id = panelOf(currentPanel).scenes ? scene : currentPanel, { gallery } = data(id);
  return gallery && openGallery(id, gallery.cells.find((one) => one.spec === spec && one.size === (size || null)) ?? { spec, size });
}

async function openGallery(id, cell) {
  const { gallery } = data(id), sameScene = id === pictureScene;
  byId("viewer").hidden = !gallery;
  byId("notes").textContent = gallery?.notes.join(" ");
  byId("no-pictures").hidden = Boolean(gallery);
  if (!gallery) return;
  if (!sameScene) decoded.clear();
  pictureScene = id;
  byId("scene-shown").textContent = panelOf(id).title;
  await first.open(gallery, cell.view ?? (sameScene ? first.viewName : undefined), cell);
}

function show(id) {
  currentPanel = id;
  const { title, scenes, start } = panelOf(id);
  for (const node of document.querySelectorAll("[data-panel]")) node.hidden = node.dataset.panel !== id;
  for (const node of document.querySelectorAll(".title-shown")) node.textContent = title;
  byId("scene").value = id;
  fillTable(data(id));
  return Promise.all([drawCharts(data(id).charts), openGallery(scenes && start ? start.scene : id, start ?? {})]);
}

// The table of configurations, which is sorted by any column.

const sorting = { name: null, down: false };

function fillTable(table) {
  const { rows, columns } = table, box = byId("table"), head = box.querySelector("thead tr"), { name: sorted, down } = sorting;
  head.replaceChildren(...["spec", ...columns].map((name, at) => {
    const onclick = () => {
      Object.assign(sorting, { name, down: name === sorted && !down });
      fillTable(table);
      head.cells[at].firstChild.focus();
    };
    const button = make("button", { type: "button", textContent: name, title: `sort by ${name}`, onclick });
    return make("th", { scope: "col", ariaSort: name !== sorted ? "none" : down ? "descending" : "ascending" }, button);
  }));
  const value = (row) => sorted === "spec" ? row.spec : row.values[sorted]?.[0] ?? null;
  const order = (a, b) => {
    const [x, y] = [value(a), value(b)];
    if (x === null || y === null) return (x === null) - (y === null); // missing values come last in both directions
    return (x < y ? -1 : x > y ? 1 : 0) * (down ? -1 : 1);
  };
  box.querySelector("tbody").replaceChildren(...(sorted ? rows.toSorted(order) : rows).map((row) => {
    const onclick = () => { window.drawn = showPicture(row.spec, row.map, row.scene); };
    const button = make("button", { type: "button", onclick }, ...breakable(row.label));
    const cells = columns.map((name) => make("td", {}, row.values[name][1]));
    return make("tr", { className: row.front ? "front" : "" }, make("th", { scope: "row", title: row.full }, button), ...cells);
  }));
}

function drawCharts({ front, sizes, passes }) {
  const chartElement = (kind) => document.querySelector(`.chart.${kind}`);
  const points = [front, sizes, passes].flatMap((chart) => chart?.data.values ?? []);
  fillLegend(legendOf(byId("charts")), new Set(points.map((point) => point.spec)), PAGE.specs);
  const rowOf = (point) => data(currentPanel).rows.find((row) => row.spec === point.spec && row.map === point.size);
  const onClick = (point) => showPicture(point.spec, point.size, rowOf(point)?.scene);
  chartElement("passes").closest("section").hidden = !passes;
  return Promise.all([
    draw(chartElement("front"), front, onClick), draw(chartElement("sizes"), sizes, onClick), draw(chartElement("passes"), passes),
  ]);
}

async function begin() {
  const jobs = [...document.querySelectorAll(".stability")].map(stability);
  if (first) {
    byId("scene").addEventListener("change", () => { window.drawn = show(byId("scene").value); });
    for (const button of document.querySelectorAll(".matrix button")) {
      button.addEventListener("click", () => { window.drawn = showPicture(button.dataset.spec, Number(button.dataset.size), button.dataset.scene); });
    }
    jobs.push(show(PAGE.panels[0].id));
  }
  await Promise.all(jobs);
}

async function stability(box) {
  const { charts, gallery, specs } = data(box.id), elements = [...box.querySelectorAll(".chart")], legend = box.querySelector(".legend");
  if (legend) fillLegend(legend, new Set(specs), specs);
  for (const select of box.querySelectorAll("[data-signal]")) {
    select.addEventListener("change", () => {
      for (const { dataset, parentElement, view } of elements) {
        parentElement.hidden = !dataset.metrics.split("|").includes(box.querySelector("[data-signal=metric]").value);
        view.signal(select.dataset.signal, select.value).runAsync();
      }
      dispatchEvent(new Event("resize")); // charts have no width while hidden
    });
  }
  const jobs = elements.map((element) => draw(element, charts[element.dataset.axis]));
  await Promise.all(gallery ? [...jobs, new Viewer(box.querySelector(".viewer")).open(gallery)] : jobs);
}

window.drawn = begin();
