"use strict";
// The page's state: the chosen run, scene and picture, which determine everything shown.

const panelOf = (id) => PAGE.panels.find((panel) => panel.id === id);

let currentPanel = null; // id
let pictureScene = null; // id of the panel whose pictures are shown
let errorsView = null; // whose errors are shown
let restoring = true; // while the address decides what is shown, not the reader
let written = null; // the choices as they were last restored from the address or written into it
const first = byId("viewer") && new Viewer(byId("viewer"), (cell) => {
  for (const button of document.querySelectorAll(".matrix button")) {
    const { spec, size, scene } = button.dataset;
    button.ariaPressed = !button.matches(".none") && scene === pictureScene && spec === cell?.spec && (size || null) == cell.size;
  }
  remember();
  return errorsView === first.gallery.views[first.viewName] || showErrors();
});

// Shows a configuration in the viewer: in the current scene or, in the panel of all scenes, in the given one.
function showPicture(spec, size, scene) {
  const id = panelOf(currentPanel).scenes ? scene : currentPanel, { gallery } = data(id);
  return gallery && openGallery(id, gallery.cells.find((one) => one.spec === spec && one.size === (size || null)) ?? { spec, size });
}

// asked: what an address says, which goes before the cell.
async function openGallery(id, cell, asked) {
  const { gallery } = data(id), sameScene = id === pictureScene;
  for (const node of document.querySelectorAll("#viewer, #errors")) node.hidden = !gallery;
  byId("notes").textContent = gallery?.notes.join(" ");
  byId("no-pictures").hidden = Boolean(gallery);
  if (!gallery) return;
  if (!sameScene) {
    const sizes = [...new Set(gallery.cells.map((one) => one.size).filter(Boolean))].sort((a, b) => a - b), choice = byId("errors-size");
    choice.replaceChildren(...sizes.map((size) => new Option(size, size)));
    choice.value = sizes[(sizes.length - 1) >> 1] ?? "";
    choice.closest("label").hidden = sizes.length < 2;
    decoded.clear();
  }
  pictureScene = id;
  byId("scene-shown").textContent = panelOf(id).title;
  if (!asked) return first.open(gallery, cell?.view ?? (sameScene ? first.viewName : undefined), cell);
  const view = gallery.views[asked.get("view")] ? asked.get("view") : undefined;
  const [left, right] = ["left", "right"].map((side) => gallery.cells.find((one) => inAddress(one) === asked.get(side)));
  await first.open(gallery, view, left ?? cell, right ?? null);
  if (asked.get("left") === inAddress(null)) await first.pick("a", -1);
}

const PAGE_ERRORS = 48; // thumbnails, each of two pictures that are decoded

// Fills the thumbnails: one per spec, at the chosen map size or the nearest available, in the chosen order of errors.
async function showErrors(shown = PAGE_ERRORS) {
  const size = Number(byId("errors-size").value) || 1024, view = errorsView = first.gallery.views[first.viewName];
  const far = (cell) => Math.abs(Math.log2((cell.size ?? size) / size)), sign = byId("errors-order").value === "worst" ? -1 : 1;
  const place = (cell) => cell.error === null ? Infinity : sign * cell.error; // without a score last in both orders
  const nearest = new Map([...first.cells].sort((a, b) => far(b) - far(a)).map((cell) => [cell.spec, cell]));
  const cells = [...nearest.values()].sort((a, b) => place(a) - place(b) || 0), more = byId("errors").querySelector(".more");
  more.hidden = cells.length <= shown;
  more.textContent = `${shown} of ${cells.length} are shown; show ${PAGE_ERRORS} more`;
  more.onclick = () => showErrors(shown + PAGE_ERRORS);
  const made = await Promise.all(cells.slice(0, shown).map(async (cell) => {
    const lines = [...cell.faults, cell.own].filter(Boolean).map((line) => make("small", {}, line));
    const onclick = async () => {
      first.mode = "difference";
      await first.pick("a", first.cells.indexOf(cell));
      const [x, y] = worstTile(await load(view, cell)) ?? [0.5, 0.5];
      first.update({ scale: 8, x: 8 * x - 0.5, y: 8 * y - 0.5 });
      byId("viewer").scrollIntoView({ block: "nearest" });
    };
    return make(
      "button", { type: "button", title: PAGE.names[cell.spec] ? cell.spec : "", onclick },
      ...await thumbnail(view, cell), make("b", {}, cell.score), make("span", {}, ...breakable(nameOf(cell))), ...lines,
    );
  }));
  if (view === errorsView) byId("errors").querySelector(".sheet").replaceChildren(...made);
}

async function show(id, asked) {
  currentPanel = id;
  const panel = panelOf(id);
  for (const node of document.querySelectorAll("[data-panel]")) node.hidden = node.dataset.panel !== id;
  for (const node of document.querySelectorAll(".title-shown")) node.textContent = panel.title;
  byId("scene").value = id;
  fillTable(data(id), (row) => showPicture(row.spec, row.map, row.scene));
  const start = panel.start ?? {}, pictured = PAGE.panels.find((one) => one.run === panel.run && one.title === asked?.get("picture"));
  await Promise.all([drawCharts(data(id).charts), openGallery(panel.scenes ? pictured?.id ?? start.scene : id, start, asked)]);
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
  const asked = new URLSearchParams(location.hash.slice(1)), modes = ["shaded", "mask", "difference"];
  const found = PAGE.panels.find((one) => one.run === Number(asked.get("run")) && one.title === asked.get("scene"));
  restoring = true;
  byId("errors-order").value = asked.get("order") === "best" ? "best" : "worst";
  first.mode = modes.includes(asked.get("mode")) ? asked.get("mode") : modes[0];
  legendOf(byId("charts")).wanted = asked.has("spec") ? asked.getAll("spec").filter(Boolean) : null;
  errorsView = null;
  await show((found ?? PAGE.panels[0]).id, asked);
  written = choices();
  restoring = false;
}

addEventListener("hashchange", () => {
  const hash = location.hash.slice(1);
  if (first && hash !== written && (!hash || new URLSearchParams(hash).has("scene"))) window.drawn = restore();
});

function drawCharts({ front, sizes, biases, passes, pass_size }) {
  const chartElement = (kind) => document.querySelector(`.chart.${kind}`), choice = byId("pass-size");
  const sweeps = byId("biases"), swept = Object.entries(biases);
  const points = [front, sizes, ...passes.map(([, chart]) => chart)].flatMap((chart) => chart?.data.values ?? []);
  fillLegend(legendOf(byId("charts")), new Set(points.map((point) => point.spec)), PAGE.specs, remember);
  const rowOf = (point) => data(currentPanel).rows.find((row) => row.spec === point.spec && row.map === point.size);
  const onClick = (point) => showPicture(point.spec, point.size, rowOf(point)?.scene);
  choice.replaceChildren(...passes.map(([size], at) => new Option(size, at, false, size === pass_size)));
  choice.closest("label").hidden = passes.length < 2;
  chartElement("passes").closest("section").hidden = !passes.length;
  choice.onchange = () => draw(chartElement("passes"), passes[choice.value]?.[1]);
  sweeps.hidden = !swept.length;
  sweeps.querySelector(".pair").replaceChildren(...swept.map(([spec]) => {
    const caption = make("figcaption", {}, ...breakable(PAGE.names[spec] ?? spec));
    return make("figure", {}, caption, make("div", { className: "chart bias" }));
  }));
  const elements = [chartElement("front"), chartElement("sizes"), ...sweeps.querySelectorAll(".chart")];
  const jobs = [front, sizes, ...Object.values(biases)].map((chart, at) => draw(elements[at], chart, onClick));
  return Promise.all([...jobs, choice.onchange()]);
}

async function begin() {
  const jobs = [...document.querySelectorAll(".stability")].map(stability);
  if (first) {
    byId("scene").addEventListener("change", () => { window.drawn = show(byId("scene").value); });
    for (const button of document.querySelectorAll(".matrix button")) {
      button.addEventListener("click", () => { window.drawn = showPicture(button.dataset.spec, Number(button.dataset.size), button.dataset.scene); });
    }
    byId("errors-size").addEventListener("change", () => showErrors());
    byId("errors-order").addEventListener("change", () => { window.drawn = showErrors(); remember(); });
    jobs.push(restore());
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
