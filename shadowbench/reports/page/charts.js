"use strict";
// Drawing of Vega-Lite charts in the theme's colours, limited to the specs enabled in the legend of their part of the page.

// CSS variables, so that charts follow a change of theme, also for printing.
const INK = "currentColor", PAPER = "var(--paper)", RULE = "var(--rule)";

const drawn = new Set(); // elements of charts

// A legend's `shown` has the specs that its charts show, each with its index into the page's colours and shapes, unique
// while it is shown; its `wanted` those that the reader chose, null before a choice.
const legendOf = (element) => element.closest("#charts, .stability").querySelector(".legend");

function styled(description, shown) {
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
  const { view } = await vegaEmbed(element, styled(description, legendOf(element).shown), { actions: false, renderer: "svg" });
  element.view = view;
  if (onClick) view.addEventListener("click", (_, item) => item?.datum?.spec && onClick(item.datum));
}

const redraw = (box) => Promise.all([...drawn].filter((element) => element.isConnected && legendOf(element) === box).map((element) => element.redraw()));

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

// Fills a legend with a button for each spec with points. Turned on are those that the reader chose or, if none of them
// has points, the first; at most as many as there are colours.
function fillLegend(box, points, onChoose = () => {}) {
  const own = JSON.parse(box.dataset.specs), specs = PAGE.specs.filter((spec) => points.has(spec));
  const none = (own.length ? own : PAGE.specs).filter((spec) => !points.has(spec));
  const wanted = box.wanted?.filter((spec) => points.has(spec)), count = PAGE.colors.length;
  const lit = (wanted?.length || box.wanted?.length === 0 ? wanted : specs).slice(0, count);
  box.shown = new Map([...box.shown ?? []].filter(([spec]) => lit.includes(spec))); // what stays on keeps its look
  for (const spec of lit.filter((one) => !box.shown.has(one))) {
    const taken = new Set(box.shown.values()), at = PAGE.specs.indexOf(spec);
    box.shown.set(spec, PAGE.colors.map((_, step) => (at + step) % count).find((slot) => !taken.has(slot)));
  }
  box.replaceChildren(...specs.map((spec) => {
    const slot = box.shown.get(spec), on = slot !== undefined, button = document.createElement("button");
    Object.assign(button, { type: "button", disabled: !on && box.shown.size >= count, title: PAGE.names[spec] ? spec : "" });
    button.setAttribute("aria-pressed", on);
    button.dataset.spec = spec;
    button.innerHTML = `<svg viewBox="-8 -8 16 16" width="15" height="15" aria-hidden="true">${on ? `<path d="${PAGE.outlines[PAGE.shapes[slot]]}" fill="${PAGE.colors[slot]}"/>` : ""}</svg><span></span>`;
    button.lastChild.append(...breakable(PAGE.names[spec] ?? spec));
    button.addEventListener("click", () => {
      const others = [...box.shown.keys()].filter((one) => one !== spec);
      box.wanted = on ? others : [...others, spec];
      fillLegend(box, points, onChoose);
      box.querySelector(`[data-spec="${CSS.escape(spec)}"]`).focus();
      redraw(box);
      onChoose();
    });
    return button;
  }));
  const [most, absent] = [box.nextElementSibling, box.nextElementSibling.nextElementSibling];
  most.hidden = specs.length <= box.shown.size;
  absent.hidden = !none.length || !specs.length;
  absent.textContent = `Without points here: ${none.map((spec) => PAGE.names[spec] ?? spec).join(", ")}.`;
}

// The text of a spec with line breaks allowed between its parameters.
const breakable = (text) => text.split(/(?<=[,:(])/).flatMap((piece) => [piece, document.createElement("wbr")]);
