"use strict";
// Charts: Vega-Lite descriptions, in the page's colours, of the specs that the legend shows.

// As the page's theme has them, now and when it is turned or printed.
const INK = "currentColor", PAPER = "var(--paper)", RULE = "var(--rule)";

// Specs that are shown, each with the place in COLORS and SHAPES that is its own for as long as it is.
const shown = new Map(PAGE.specs.slice(0, PAGE.colors.length).map((spec, index) => [spec, index]));
const drawn = new Set(); // places of charts

function styled(description) {
  const values = description.data?.values.map((value) => {
    const slot = shown.get(value.spec);
    return { ...value, shown: slot !== undefined, color: PAGE.colors[slot], shape: PAGE.shapes[slot] };
  });
  const rows = new Set(values?.filter((value) => value.shown).map((value) => value.row)).size, { row } = description.usermeta ?? {};
  const set = { ink: INK, paper: PAPER };
  const text = { labelColor: INK, titleColor: INK };
  return {
    ...description,
    data: { values },
    height: row ? row * rows + 12 : description.height,
    params: description.params.map((param) => param.name in set ? { ...param, value: set[param.name] } : param),
    config: { ...description.config, background: "transparent", legend: { ...description.config.legend, ...text }, axis: { ...description.config.axis, ...text, gridColor: RULE, domainColor: RULE, tickColor: RULE } },
  };
}

async function draw(place, description, pointed) {
  place.view?.finalize();
  place.hidden = !description;
  if (place.nextElementSibling?.matches("p")) place.nextElementSibling.hidden = Boolean(description);
  drawn.add(place);
  place.again = () => draw(place, description, pointed);
  if (!description) return void place.replaceChildren();
  const { view } = await vegaEmbed(place, styled(description), { actions: false, renderer: "svg" });
  place.view = view;
  if (pointed) view.addEventListener("click", (_, item) => item?.datum?.spec && pointed(item.datum));
}

const redraw = () => Promise.all([...drawn].filter((place) => place.isConnected).map((place) => place.again()));

// The front's zoom by buttons, about the middle of its domains, both of them log.
function zoomed(place, factor) {
  place.whole ??= { zoom_ms: place.view.scale("x").domain(), zoom_drawn: place.view.scale("y").domain() };
  const now = { zoom_ms: place.view.scale("x").domain(), zoom_drawn: place.view.scale("y").domain() };
  for (const [signal, whole] of Object.entries(place.whole)) {
    const middle = Math.sqrt(now[signal][0] * now[signal][1]);
    place.view.signal(signal, factor ? now[signal].map((end) => middle * (end / middle) ** factor) : whole);
  }
  place.view.runAsync();
}

// Legends, all alike: a button a spec. As many are shown as there are colours; another takes the place of one turned off.
function legends() {
  for (const box of document.querySelectorAll(".legend")) {
    const specs = PAGE.specs.filter((spec) => !box.dataset.specs || JSON.parse(box.dataset.specs).includes(spec));
    const full = shown.size >= PAGE.colors.length;
    box.replaceChildren(...specs.map((spec) => {
      const slot = shown.get(spec), on = slot !== undefined, button = document.createElement("button");
      Object.assign(button, { type: "button", disabled: !on && full });
      button.setAttribute("aria-pressed", on);
      button.dataset.spec = spec;
      button.innerHTML = `<svg viewBox="-8 -8 16 16" width="15" height="15" aria-hidden="true">${on ? `<path d="${PAGE.outlines[PAGE.shapes[slot]]}" fill="${PAGE.colors[slot]}"/>` : ""}</svg><span></span>`;
      button.lastChild.append(...breakable(spec));
      button.addEventListener("click", () => {
        if (on) shown.delete(spec);
        else shown.set(spec, PAGE.colors.findIndex((_, index) => ![...shown.values()].includes(index)));
        legends();
        box.querySelector(`[data-spec="${CSS.escape(spec)}"]`).focus();
        redraw();
      });
      return button;
    }));
    box.nextElementSibling.hidden = specs.length <= shown.size;
  }
}

// A spec that may be broken between its parameters.
const breakable = (text) => text.split(/(?<=[,:(])/).flatMap((piece) => [piece, document.createElement("wbr")]);
