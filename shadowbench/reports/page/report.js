"use strict";
// What is chosen: a run, a scene of it or all, and a picture. All else on the page follows.

const byId = (id) => document.getElementById(id);
const read = (id) => JSON.parse(byId(id).textContent);
const partOf = (id) => PAGE.parts.find((part) => part.id === id);
const memory = new Map();
const data = (id) => memory.get(id) ?? memory.set(id, read(`data-${id}`)).get(id);

let now = null; // the part that is shown
let seen = null; // the scene whose pictures are
const first = byId("viewer") && new Viewer(byId("viewer"), (cell) => marked(cell));

function marked(cell) {
  for (const button of document.querySelectorAll(".matrix button")) {
    const { spec, size, scene } = button.dataset;
    button.setAttribute("aria-pressed", !button.matches(".none") && scene === seen && spec === cell?.spec && (size || null) == cell.size);
  }
}

// A configuration in the viewer: in the scene that is shown, or for all scenes in the one given.
function look(spec, size, scene) {
  const id = partOf(now).scenes ? scene : now;
  if (!data(id).gallery) return;
  const cell = data(id).gallery.cells.find((one) => one.spec === spec && one.size === (size || null));
  return pictures(id, cell ?? { spec, size });
}

async function pictures(id, cell) {
  const { gallery } = data(id);
  for (const node of document.querySelectorAll("#viewer, #wrong")) node.hidden = !gallery;
  byId("no-pictures").textContent = gallery ? gallery.notes.join(" ") : data(id).no_gallery;
  if (!gallery) return;
  if (id !== seen) decoded.clear();
  const again = id === seen;
  seen = id;
  byId("scene-shown").textContent = partOf(id).title;
  await first.open(gallery, cell?.place ?? (again ? first.where : undefined), cell);
  if (!again) {
    const sizes = [...new Set(gallery.cells.map((one) => one.size).filter(Boolean))].sort((a, b) => a - b);
    byId("wrong-size").replaceChildren(...sizes.map((size) => new Option(size, size)));
    byId("wrong-size").value = sizes[(sizes.length - 1) >> 1] ?? "";
    byId("wrong-size").closest("label").hidden = sizes.length < 2;
    await wrong();
  }
}

// A thumbnail of every spec, at the map size or the nearest it has.
async function wrong() {
  const { gallery } = first, size = Number(byId("wrong-size").value) || 1024, place = gallery.places[first.where];
  const far = (cell) => Math.abs(Math.log2((cell.size ?? size) / size));
  const cells = [...new Set(first.cells.map((cell) => cell.spec))].map((spec) => first.cells.filter((cell) => cell.spec === spec).sort((a, b) => far(a) - far(b))[0]);
  const made = await Promise.all(cells.map(async (cell) => {
    const button = document.createElement("button"), score = document.createElement("b"), label = document.createElement("span");
    button.type = "button";
    score.textContent = cell.iou;
    label.append(...breakable(nameOf(cell)));
    button.append(...await thumbnail(place, cell), score, label);
    button.addEventListener("click", async () => {
      first.mode = "difference";
      await first.pick("a", first.cells.indexOf(cell));
      first.look(await worst(place, cell) ?? [0.5, 0.5]);
      byId("viewer").scrollIntoView({ block: "nearest" });
    });
    return button;
  }));
  byId("wrong").querySelector(".sheet").replaceChildren(...made);
}

async function show(id) {
  now = id;
  const part = partOf(id), { charts, rows, columns } = data(id);
  for (const node of document.querySelectorAll("[data-part]")) node.hidden = node.dataset.part !== id;
  for (const node of document.querySelectorAll(".title-shown")) node.textContent = part.title;
  byId("run").value = part.run;
  fillTable(rows, columns, (row) => look(row.spec, row.map, row.scene));
  const jobs = [drawCharts(charts)];
  const start = part.start ?? {};
  if (first) jobs.push(pictures(part.scenes ? start.scene : id, start));
  await Promise.all(jobs);
}

function drawCharts({ front, sizes, passes, pass_size, biases }) {
  const place = (kind) => document.querySelector(`.chart.${kind}`);
  const pointed = (point) => look(point.spec, point.size, rowOf(point)?.scene);
  for (const kind of ["front", "sizes", "passes"]) place(kind).whole = undefined;
  const choice = byId("pass-size");
  choice.replaceChildren(...passes.map(([size], at) => new Option(size, at, false, size === pass_size)));
  choice.closest("label").hidden = passes.length < 2;
  place("passes").closest("section").hidden = !passes.length;
  choice.onchange = () => draw(place("passes"), passes[choice.value][1]);
  const bias = byId("biases");
  bias.hidden = !biases.length;
  bias.querySelector(".pair").replaceChildren(...biases.map(([home]) => {
    const figure = document.createElement("figure"), caption = document.createElement("figcaption"), chart = document.createElement("div");
    caption.append(...breakable(home));
    chart.className = "chart biases";
    figure.append(caption, chart);
    return figure;
  }));
  return Promise.all([
    draw(place("front"), front, pointed),
    draw(place("sizes"), sizes, pointed),
    draw(place("passes"), passes.find(([size]) => size === pass_size)?.[1]),
    ...[...bias.querySelectorAll(".chart")].map((chart, at) => draw(chart, biases[at][1])),
  ]);
}

const rowOf = (point) => data(now).rows.find((row) => row.spec === point.spec && row.map === point.size);

function fillScenes(run, title) {
  const parts = PAGE.parts.filter((part) => part.run === run);
  byId("scene").replaceChildren(...parts.map((part) => new Option(part.title, part.id)));
  return (parts.find((part) => part.title === title) ?? parts[0]).id;
}

async function begin() {
  legends();
  const jobs = [];
  if (PAGE.parts.length) {
    const start = fillScenes(PAGE.parts[0].run);
    byId("scene").addEventListener("change", () => { window.drawn = show(byId("scene").value); });
    byId("run").addEventListener("change", () => {
      byId("scene").value = fillScenes(Number(byId("run").value), partOf(now).title);
      window.drawn = show(byId("scene").value);
    });
    for (const button of document.querySelectorAll(".matrix button")) {
      button.addEventListener("click", () => { window.drawn = look(button.dataset.spec, Number(button.dataset.size) || null, button.dataset.scene); });
    }
    byId("wrong-size")?.addEventListener("change", wrong);
    for (const button of document.querySelectorAll("[data-zoom]")) button.addEventListener("click", () => zoomed(document.querySelector(".chart.front"), Number(button.dataset.zoom)));
    jobs.push(show(start));
  }
  for (const box of document.querySelectorAll(".stability")) jobs.push(stability(box));
  await Promise.all(jobs);
}

async function stability(box) {
  const charts = [...box.querySelectorAll(".chart.axis")];
  for (const select of box.querySelectorAll("[data-signal]")) {
    select.addEventListener("change", () => {
      for (const chart of charts) {
        chart.closest("figure").hidden = !chart.dataset.metrics.split("|").includes(box.querySelector("[data-signal=metric]").value);
        chart.view.signal(select.dataset.signal, select.value).runAsync();
      }
      dispatchEvent(new Event("resize")); // what was hidden has had no width
    });
  }
  const viewer = box.querySelector(".viewer");
  if (viewer) new Viewer(viewer).open(read(viewer.dataset.gallery));
  await Promise.all(charts.map((chart) => draw(chart, read(chart.dataset.chart))));
}

byId("theme").addEventListener("click", () => {
  const root = document.documentElement;
  root.dataset.theme = root.dataset.theme === "other" ? "own" : "other";
});
addEventListener("beforeprint", () => {
  for (const details of document.querySelectorAll("details")) details.open = true;
});
window.drawn = begin();
