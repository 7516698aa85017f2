"use strict";
// The page's state: the chosen run, scene and picture, which determine everything shown.

const byId = (id) => document.getElementById(id);
const read = (id) => JSON.parse(byId(id).textContent);
const panelOf = (id) => PAGE.panels.find((panel) => panel.id === id);
const cache = new Map();
const data = (id) => cache.get(id); // once it is loaded
const loaded = async (id) => cache.get(id) ?? cache.set(id, PAGE.data ? await fetched(PAGE.data[id]) : read(`data-${id}`)).get(id);

let currentPanel = null; // id
let pictureScene = null; // id of the panel whose pictures are shown
let errorsView = null; // whose errors are shown
let restoring = true; // while the address decides what is shown, not the reader
let written = null; // the choices as they were last restored from the address or written into it
const first = byId("viewer") && new Viewer(byId("viewer"), (cell) => {
  markCell(cell);
  remember();
  return errorsView === first.gallery.views[first.viewName] || showErrors();
});

// Highlights the cells of the cost matrix whose picture is shown.
function markCell(cell) {
  for (const button of document.querySelectorAll(".matrix button")) {
    const { spec, size, scene } = button.dataset;
    button.setAttribute("aria-pressed", !button.matches(".none") && scene === pictureScene && spec === cell?.spec && (size || null) == cell.size);
  }
}

// Shows a configuration in the viewer: in the current scene or, in the panel of all scenes, in the given one.
async function showPicture(spec, size, scene) {
  const id = panelOf(currentPanel).scenes ? scene : currentPanel;
  const { gallery } = await loaded(id);
  if (!gallery) return;
  const cell = gallery.cells.find((one) => one.spec === spec && one.size === (size || null));
  return openGallery(id, cell ?? { spec, size });
}

// asked: what an address says, which goes before the cell.
async function openGallery(id, cell, asked) {
  const { gallery } = await loaded(id);
  for (const node of document.querySelectorAll("#viewer, #errors")) node.hidden = !gallery;
  byId("no-pictures").textContent = gallery ? gallery.notes.join(" ") : data(id).no_gallery;
  if (!gallery) return;
  const sameScene = id === pictureScene;
  if (!sameScene) decoded.clear();
  pictureScene = id;
  byId("scene-shown").textContent = panelOf(id).title;
  if (!sameScene) {
    const sizes = [...new Set(gallery.cells.map((one) => one.size).filter(Boolean))].sort((a, b) => a - b);
    byId("errors-size").replaceChildren(...sizes.map((size) => new Option(size, size)));
    byId("errors-size").value = sizes[(sizes.length - 1) >> 1] ?? "";
    byId("errors-size").closest("label").hidden = sizes.length < 2;
  }
  if (!asked) return first.open(gallery, cell?.view ?? (sameScene ? first.viewName : undefined), cell);
  const view = gallery.views[asked.get("view")] ? asked.get("view") : undefined;
  const [left, right] = ["left", "right"].map((side) => gallery.cells.find((one) => inAddress(one) === asked.get(side)));
  await first.open(gallery, view, left ?? cell, right ?? null);
  if (asked.get("left") === inAddress(null)) await first.pick("a", -1);
}

const PAGE_ERRORS = 48; // thumbnails, each of two pictures that are decoded

// Fills the thumbnails: one per spec, at the chosen map size or the nearest available, in the chosen order of errors.
async function showErrors(shown = PAGE_ERRORS) {
  const { gallery } = first, size = Number(byId("errors-size").value) || 1024, view = errorsView = gallery.views[first.viewName];
  const far = (cell) => Math.abs(Math.log2((cell.size ?? size) / size)), sign = byId("errors-order").value === "worst" ? -1 : 1;
  const place = (cell) => cell.error === null ? Infinity : sign * cell.error; // without a score last in both orders
  const cells = [...new Set(first.cells.map((cell) => cell.spec))].map((spec) => first.cells.filter((cell) => cell.spec === spec).sort((a, b) => far(a) - far(b))[0]).sort((a, b) => place(a) - place(b) || 0);
  const more = byId("errors").querySelector(".more");
  more.hidden = cells.length <= shown;
  more.textContent = `${shown} of ${cells.length} are shown; show ${PAGE_ERRORS} more`;
  more.onclick = () => showErrors(shown + PAGE_ERRORS);
  const made = await Promise.all(cells.slice(0, shown).map(async (cell) => {
    const button = document.createElement("button"), score = document.createElement("b"), label = document.createElement("span");
    Object.assign(button, { type: "button", title: PAGE.names[cell.spec] ? cell.spec : "" });
    score.textContent = cell.score;
    label.append(...breakable(nameOf(cell)));
    button.append(...await thumbnail(view, cell), score, label, ...[...cell.faults, cell.own].filter(Boolean).map((line) => Object.assign(document.createElement("small"), { textContent: line })));
    button.addEventListener("click", async () => {
      first.mode = "difference";
      await first.pick("a", first.cells.indexOf(cell));
      first.zoomTo(await worstTile(view, cell) ?? [0.5, 0.5]);
      byId("viewer").scrollIntoView({ block: "nearest" });
    });
    return button;
  }));
  if (view === errorsView) byId("errors").querySelector(".sheet").replaceChildren(...made);
}

async function show(id, asked) {
  currentPanel = id;
  const panel = panelOf(id), { charts, rows, columns, shown } = await loaded(id);
  if (id !== currentPanel) return; // another was chosen while this was loaded
  for (const node of document.querySelectorAll("[data-panel]")) node.hidden = node.dataset.panel !== id;
  for (const node of document.querySelectorAll(".title-shown")) node.textContent = panel.title;
  byId("run").value = panel.run;
  fillTable(rows, columns, shown, (row) => showPicture(row.spec, row.map, row.scene));
  const jobs = [drawCharts(charts)];
  const start = panel.start ?? {}, pictured = PAGE.panels.find((one) => one.run === panel.run && one.title === asked?.get("picture"));
  if (first) jobs.push(openGallery(panel.scenes ? pictured?.id ?? start.scene : id, start, asked));
  await Promise.all(jobs);
  remember();
}

// The address holds what is chosen, so that a link shows the same and the browser goes back to it.

const inAddress = (cell) => cell ? `${cell.spec}${cell.size ? ` at ${cell.size}` : ""}` : "truth";

function choices() {
  const { run, title, scenes } = panelOf(currentPanel), { gallery, viewName, a, b, mode } = first, { wanted } = legendOf(byId("charts"));
  const some = [
    ["run", run || null], ["scene", title], ["picture", scenes && pictureScene ? panelOf(pictureScene).title : null],
    ...(gallery ? [["view", Object.keys(gallery.views).length > 1 ? viewName : null], ["left", inAddress(a)], ["right", inAddress(b)], ["mode", mode]] : []),
    ["order", byId("errors-order").value], ...(wanted?.length === 0 ? [""] : wanted ?? []).map((spec) => ["spec", spec]),
  ];
  return new URLSearchParams(some.filter(([, value]) => value !== null)).toString();
}

function remember() {
  if (!restoring && choices() !== written) location.hash = written = choices();
}

async function restore() {
  const asked = new URLSearchParams(location.hash.slice(1)), run = Number(asked.get("run")), title = asked.get("scene");
  const panel = PAGE.panels.find((one) => one.run === run && one.title === title) ?? PAGE.panels[0];
  restoring = true;
  fillScenes(panel.run);
  byId("scene").value = panel.id;
  const order = byId("errors-order"), before = order.value, modes = [...byId("viewer").querySelectorAll(".modes input")].map((one) => one.value);
  order.value = asked.get("order") === "best" ? "best" : "worst";
  first.mode = modes.includes(asked.get("mode")) ? asked.get("mode") : modes[0];
  legendOf(byId("charts")).wanted = asked.has("spec") ? asked.getAll("spec").filter(Boolean) : null;
  if (order.value !== before) errorsView = null;
  await show(panel.id, asked);
  written = choices();
  restoring = false;
}

addEventListener("hashchange", () => {
  const hash = location.hash.slice(1);
  if (PAGE.panels.length && hash !== written && (!hash || new URLSearchParams(hash).has("scene"))) window.drawn = restore();
});

function drawCharts({ front, sizes, passes, pass_size, biases }) {
  const chartElement = (kind) => document.querySelector(`.chart.${kind}`);
  const all = [front, sizes, ...passes.map(([, chart]) => chart)].flatMap((chart) => chart?.data.values ?? []);
  fillLegend(legendOf(byId("charts")), new Set(all.map((point) => point.spec)), remember);
  const onClick = (point) => showPicture(point.spec, point.size, rowOf(point)?.scene);
  for (const kind of ["front", "sizes", "passes"]) chartElement(kind).initial = undefined;
  const choice = byId("pass-size");
  choice.replaceChildren(...passes.map(([size], at) => new Option(size, at, false, size === pass_size)));
  choice.closest("label").hidden = passes.length < 2;
  chartElement("passes").closest("section").hidden = !passes.length;
  choice.onchange = () => draw(chartElement("passes"), passes[choice.value][1]);
  const bias = byId("biases");
  bias.hidden = !biases.length;
  bias.querySelector(".pair").replaceChildren(...biases.map(([base]) => {
    const figure = document.createElement("figure"), caption = document.createElement("figcaption"), chart = document.createElement("div");
    caption.append(...breakable(base));
    chart.className = "chart biases";
    figure.append(caption, chart);
    return figure;
  }));
  return Promise.all([
    draw(chartElement("front"), front, onClick),
    draw(chartElement("sizes"), sizes, onClick),
    draw(chartElement("passes"), passes.find(([size]) => size === pass_size)?.[1]),
    ...[...bias.querySelectorAll(".chart")].map((chart, at) => draw(chart, biases[at][1])),
  ]);
}

const rowOf = (point) => data(currentPanel).rows.find((row) => row.spec === point.spec && row.map === point.size);

function fillScenes(run, title) {
  const panels = PAGE.panels.filter((panel) => panel.run === run);
  byId("scene").replaceChildren(...panels.map((panel) => new Option(panel.title, panel.id)));
  return (panels.find((panel) => panel.title === title) ?? panels[0]).id;
}

async function begin() {
  const jobs = [];
  if (PAGE.panels.length) {
    byId("scene").addEventListener("change", () => { window.drawn = show(byId("scene").value); });
    byId("run").addEventListener("change", () => {
      byId("scene").value = fillScenes(Number(byId("run").value), panelOf(currentPanel).title);
      window.drawn = show(byId("scene").value);
    });
    for (const button of document.querySelectorAll(".matrix button")) {
      button.addEventListener("click", () => { window.drawn = showPicture(button.dataset.spec, Number(button.dataset.size) || null, button.dataset.scene); });
    }
    byId("errors-size").addEventListener("change", () => showErrors());
    byId("errors-order").addEventListener("change", () => { window.drawn = showErrors(); remember(); });
    for (const button of document.querySelectorAll("[data-zoom]")) button.addEventListener("click", () => zoomed(document.querySelector(".chart.front"), Number(button.dataset.zoom)));
    jobs.push(restore());
  }
  for (const box of document.querySelectorAll(".stability")) jobs.push(stability(box));
  await Promise.all(jobs);
}

async function stability(box) {
  const charts = [...box.querySelectorAll(".chart.axis")], legend = box.querySelector(".legend");
  if (legend) fillLegend(legend, new Set(JSON.parse(legend.dataset.specs)));
  for (const select of box.querySelectorAll("[data-signal]")) {
    select.addEventListener("change", () => {
      for (const chart of charts) {
        chart.closest("figure").hidden = !chart.dataset.metrics.split("|").includes(box.querySelector("[data-signal=metric]").value);
        chart.view.signal(select.dataset.signal, select.value).runAsync();
      }
      dispatchEvent(new Event("resize")); // charts have no width while hidden
    });
  }
  const viewer = box.querySelector(".viewer");
  if (viewer) new Viewer(viewer).open(read(viewer.dataset.gallery));
  await Promise.all(charts.map((chart) => draw(chart, read(chart.dataset.chart))));
}

for (const link of document.querySelectorAll('a[href^="#"]')) link.addEventListener("click", (event) => {
  event.preventDefault(); // which would replace the choices in the address
  const target = document.querySelector(link.getAttribute("href"));
  target.tabIndex = -1;
  target.focus();
  target.scrollIntoView();
});
byId("theme").addEventListener("click", () => {
  const root = document.documentElement;
  root.dataset.theme = root.dataset.theme === "other" ? "own" : "other";
});
addEventListener("beforeprint", () => {
  for (const details of document.querySelectorAll("details")) details.open = true;
});
window.drawn = begin();
