"use strict";
// Drawing of Vega-Lite charts in the theme's colours, limited to the specs enabled in the legend.

// CSS variables, so that charts follow a change of theme, also for printing.
const INK = "currentColor", PAPER = "var(--paper)", RULE = "var(--rule)";

// The shown specs, each with its index into the page's colours and shapes, unique while it is shown.
const shown = new Map(PAGE.specs.slice(0, PAGE.colors.length).map((spec, index) => [spec, index]));
const drawn = new Set(); // elements of charts

function styled(description) {
  const values = description.data?.values.map((value) => {
    const slot = shown.get(value.spec);
    return { ...value, shown: slot !== undefined, color: PAGE.colors[slot], shape: PAGE.shapes[slot] };
  });
  const rows = new Set(values?.filter((value) => value.shown).map((value) => value.row)).size, { row } = description.usermeta ?? {};
  const signals = { ink: INK, paper: PAPER };
  const text = { labelColor: INK, titleColor: INK };
  return {
    ...description,
    data: { values },
    height: row ? row * rows + 12 : description.height,
    params: description.params.map((param) => param.name in signals ? { ...param, value: signals[param.name] } : param),
    config: { ...description.config, background: "transparent", legend: { ...description.config.legend, ...text }, axis: { ...description.config.axis, ...text, gridColor: RULE, domainColor: RULE, tickColor: RULE } },
  };
}

async function draw(element, description, onClick) {
  element.view?.finalize();
  element.hidden = !description;
  if (element.nextElementSibling?.matches("p")) element.nextElementSibling.hidden = Boolean(description);
  drawn.add(element);
  element.redraw = () => draw(element, description, onClick);
  if (!description) return void element.replaceChildren();
  const { view } = await vegaEmbed(element, styled(description), { actions: false, renderer: "svg" });
  element.view = view;
  if (onClick) view.addEventListener("click", (_, item) => item?.datum?.spec && onClick(item.datum));
}

const redraw = () => Promise.all([...drawn].filter((element) => element.isConnected).map((element) => element.redraw()));

// Zoom of the error-cost chart about the centre of its logarithmic domains; resets for a factor of 0.
function zoomed(element, factor) {
  element.initial ??= { zoom_ms: element.view.scale("x").domain(), zoom_drawn: element.view.scale("y").domain() };
  const current = { zoom_ms: element.view.scale("x").domain(), zoom_drawn: element.view.scale("y").domain() };
  for (const [signal, initial] of Object.entries(element.initial)) {
    const middle = Math.sqrt(current[signal][0] * current[signal][1]);
    element.view.signal(signal, factor ? current[signal].map((end) => middle * (end / middle) ** factor) : initial);
  }
  element.view.runAsync();
}

// Fills all legends with a button per spec. At most as many specs as there are colours can be shown at a time.
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
      button.lastChild.append(...breakable(PAGE.names[spec] ?? spec));
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

// The text of a spec with line breaks allowed between its parameters.
const breakable = (text) => text.split(/(?<=[,:(])/).flatMap((piece) => [piece, document.createElement("wbr")]);
