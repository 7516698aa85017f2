"use strict";
// Charts: Vega-Lite descriptions beside their places. Pictures: JSON beside theirs. Both are drawn when they are near.

const read = (id) => JSON.parse(document.getElementById(id).textContent);

const narrow = matchMedia("(max-width: 760px)");

async function draw(place) {
  const chart = narrow.matches && place.dataset.narrow || place.dataset.chart;
  const { view } = await vegaEmbed(place, read(chart), { actions: false, renderer: "svg" });
  place.view = view;
  if (place.matches(".front")) {
    place.domains = { zoom_ms: view.scale("x").domain(), zoom_drawn: view.scale("y").domain() };
  }
}

// A domain around its own middle, in logarithms: both axes of the front are log.
function scaled([low, high], factor) {
  const middle = Math.sqrt(low * high);
  return [middle * (low / middle) ** factor, middle * (high / middle) ** factor];
}

function zoom(place, factor) {
  const now = { zoom_ms: place.view.scale("x").domain(), zoom_drawn: place.view.scale("y").domain() };
  for (const [signal, whole] of Object.entries(place.domains)) {
    place.view.signal(signal, factor ? scaled(now[signal], factor) : whole);
  }
  place.view.runAsync();
}

// A spec that may be broken between its parameters.
const breakable = (text) => text.split(/(?<=[,:(])/).flatMap((piece) => [piece, document.createElement("wbr")]);

function pick(article, spec) {
  for (const place of article.querySelectorAll(".chart.front, .chart.sizes, .chart.axis")) {
    if (place.view) place.view.signal("pick", spec).runAsync();
  }
}

function legend(article) {
  const buttons = [...article.querySelectorAll(".legend button")];
  const pinned = () => buttons.find((button) => button.getAttribute("aria-pressed") === "true");
  for (const button of buttons) {
    const back = () => pick(article, pinned()?.dataset.spec ?? null);
    button.addEventListener("pointerenter", () => pick(article, button.dataset.spec));
    button.addEventListener("pointerleave", back);
    button.addEventListener("click", () => {
      const on = button !== pinned();
      for (const other of buttons) other.setAttribute("aria-pressed", String(on && other === button));
      pick(article, on ? button.dataset.spec : null);
    });
  }
}

function gallery(box) {
  const { cells, truths, start } = JSON.parse(box.querySelector("script").textContent);
  const find = (selector) => box.querySelector(selector);
  const [specs, sizes, places] = [find(".spec"), find(".size"), find(".place")];
  const distinct = (key, of = cells) => [...new Set(of.map((cell) => cell[key]))];
  const fill = (select, values, chosen) => {
    select.replaceChildren(...values.map((value) => new Option(value ?? "none", value ?? "")));
    select.value = chosen ?? "";
    select.disabled = values.length < 2;
  };
  const image = (kind, source) => {
    for (const node of box.getElementsByClassName(kind)) {
      node.style.visibility = source ? "visible" : "hidden";
      if (source) node.src = source;
      else node.removeAttribute("src");
    }
  };
  const name = (kind, text) => {
    for (const node of box.getElementsByClassName(kind)) node.alt = text;
  };
  // The place that is magnified, in percent of the picture.
  const viewer = find(".viewer");
  let middle = [50, 50];
  function magnify(x, y) {
    const factor = Number(find(".magnify").value);
    middle = [x, y];
    // What keeps the place in the middle of the frame, as far as the picture reaches.
    const origin = (at) => factor === 1 ? 50 : Math.min(100, Math.max(0, (at * factor - 50) / (factor - 1)));
    const style = {
      "--factor": factor,
      "--origin": `${origin(x)}% ${origin(y)}%`,
      "--left": `${origin(x) * (1 - 1 / factor)}%`,
      "--top": `${origin(y) * (1 - 1 / factor)}%`,
    };
    for (const [key, value] of Object.entries(style)) viewer.style.setProperty(key, value);
    find(".region").hidden = factor === 1;
  }
  // The cell of a spec nearest to a map size; what has no map has one cell.
  const nearest = (spec, size, place) => cells
    .filter((cell) => cell.spec === spec && cell.place === place)
    .sort((a, b) => Math.abs(Math.log2((a.size ?? size) / size)) - Math.abs(Math.log2((b.size ?? size) / size)))[0];
  let now = cells[start];
  let wanted = now.size ?? 1024; // the map size asked for, also while a technique without a map is shown

  function show(cell) {
    now = cell;
    fill(specs, distinct("spec"), cell.spec);
    const able = cells.filter((other) => other.spec === cell.spec && other.place === cell.place);
    fill(sizes, distinct("size", able), cell.size);
    const anywhere = distinct("place");
    fill(places, anywhere, cell.place);
    find(".place-label").hidden = anywhere.length < 2;
    find(".scores").textContent = cell.said;
    image("of-mask", cell.mask);
    image("of-truth", truths[cell.place]);
    image("of-picture", cell.picture);
    image("of-difference", cell.difference);
    magnify(...(cell.worst ?? [50, 50]));
    const what = `${cell.spec}${cell.size ? ` at ${cell.size}` : ""}`;
    name("of-picture", `Picture with the shadows of ${what}`);
    name("of-mask", `Mask of ${what}`);
    name("of-truth", "Ray-traced truth");
    name("of-difference", `Difference of ${what} from the truth: ${cell.iou}`);
    sheet();
  }

  function sheet() {
    const shown = distinct("spec").map((spec) => nearest(spec, wanted, now.place)).filter(Boolean);
    find(".sheet").replaceChildren(...shown.map((cell) => {
      const button = document.createElement("button");
      button.type = "button";
      button.setAttribute("aria-pressed", String(cell === now));
      if (cell.difference) {
        const picture = new Image();
        picture.src = cell.difference;
        picture.alt = "";
        button.append(picture);
      }
      const score = document.createElement("b");
      score.textContent = cell.iou;
      const label = document.createElement("span");
      label.append(...breakable(`${cell.spec}${cell.size ? ` at ${cell.size}` : ""}`));
      button.append(score, label);
      button.addEventListener("click", () => {
        const at = [...find(".sheet").children].indexOf(button);
        show(cell);
        find(".sheet").children[at].focus({ preventScroll: true });
      });
      return button;
    }));
  }

  // A spec need not have a cell at every place.
  specs.addEventListener("change", () => show(nearest(specs.value, wanted, now.place) ?? cells.find((cell) => cell.spec === specs.value)));
  sizes.addEventListener("change", () => {
    wanted = Number(sizes.value) || wanted;
    show(nearest(now.spec, wanted, now.place));
  });
  places.addEventListener("change", () => show(nearest(now.spec, wanted, places.value) ?? cells.find((cell) => cell.place === places.value)));
  find(".magnify").addEventListener("change", () => magnify(...middle));
  for (const frame of box.querySelectorAll(".frame, .wipe")) {
    frame.addEventListener("click", (event) => {
      const shown = frame.querySelector("img").getBoundingClientRect();
      const at = [(event.clientX - shown.left) / shown.width, (event.clientY - shown.top) / shown.height];
      if (find(".magnify").value === "1") find(".magnify").value = "4";
      magnify(100 * at[0], 100 * at[1]);
    });
  }
  const slider = find("input[type=range]");
  const wipe = () => find(".wipe").style.setProperty("--cut", `${slider.value}%`);
  slider.addEventListener("input", wipe);
  wipe();
  show(now);
}

for (const article of document.querySelectorAll("article")) legend(article);
for (const box of document.querySelectorAll(".gallery")) gallery(box);
for (const button of document.querySelectorAll("[data-zoom]")) {
  button.addEventListener("click", () => zoom(button.closest("figure").querySelector(".chart"), Number(button.dataset.zoom)));
}
for (const select of document.querySelectorAll("[data-signal]")) {
  select.addEventListener("change", () => {
    const article = select.closest("article");
    for (const figure of article.querySelectorAll("[data-metrics]")) {
      figure.hidden = !figure.dataset.metrics.split("|").includes(article.querySelector("[data-signal=metric]").value);
    }
    for (const place of article.querySelectorAll(".chart.axis")) place.view.signal(select.dataset.signal, select.value).runAsync();
    dispatchEvent(new Event("resize")); // what was hidden has had no width
  });
}
for (const select of document.querySelectorAll(".pass-size")) {
  select.addEventListener("change", () => {
    const place = select.closest("article").querySelector(".passes");
    place.dataset.chart = select.value;
    place.view.finalize();
    draw(place);
  });
}
addEventListener("beforeprint", () => {
  for (const details of document.querySelectorAll("details")) details.open = true;
});
window.drawn = Promise.all([...document.querySelectorAll(".chart")].map(draw));
