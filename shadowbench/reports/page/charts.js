"use strict";
// Drawing of Vega-Lite charts in the theme's colours, limited to the specs enabled in the legend of their part of the page.

// CSS variables, so that charts follow a change of theme.
const SIGNALS = { ink: "currentColor", paper: "var(--paper)" }, RULE = "var(--rule)";
const TEXT = { labelColor: "currentColor", titleColor: "currentColor" };

// A legend's `shown` has the specs that its charts show, each with its index into the page's colours and shapes, unique
// while it is shown; its `wanted` those that the reader chose, null before a choice.
const legendOf = (element) => element.closest("#charts, .stability").querySelector(".legend");

function styled(chart, shown) {
  const values = chart.data.values.map((value) => {
    const slot = shown.get(value.spec);
    return { ...value, shown: slot !== undefined, color: PAGE.colors[slot], shape: PAGE.shapes[slot] };
  });
  const { legend, axis, ...config } = chart.config, { step } = chart.height;
  const rows = new Set(values.filter((value) => value.shown).map((value) => value.row));
  return {
    ...chart,
    data: { values },
    height: step ? step * rows.size : chart.height,
    params: chart.params.map((param) => ({ ...param, value: SIGNALS[param.name] ?? param.value })),
    config: { ...config, background: "transparent", legend: { ...legend, ...TEXT }, axis: { ...axis, ...TEXT, gridColor: RULE, domainColor: RULE, tickColor: RULE } },
  };
}

async function draw(element, chart, onClick) {
  element.view?.finalize();
  element.hidden = !chart;
  element.redraw = () => draw(element, chart, onClick);
  if (!chart) return;
  const { view } = await vegaEmbed(element, styled(chart, legendOf(element).shown), { actions: false, renderer: "svg" });
  element.view = view;
  if (onClick) view.addEventListener("click", (_, item) => item?.datum?.spec && onClick(item.datum));
}

// Fills a legend with a button for each spec with points, and names the others of `every`. Turned on are those that the reader chose or, if none of them
// has points, the first; at most as many as there are colours.
function fillLegend(box, points, every) {
  const specs = PAGE.specs.filter((spec) => points.has(spec));
  const wanted = box.wanted?.filter((spec) => points.has(spec)), count = PAGE.colors.length;
  const lit = (wanted?.length || box.wanted?.length === 0 ? wanted : specs).slice(0, count);
  box.shown = new Map([...box.shown ?? []].filter(([spec]) => lit.includes(spec))); // what stays on keeps its look
  for (const spec of lit.filter((one) => !box.shown.has(one))) {
    const taken = new Set(box.shown.values()), at = PAGE.specs.indexOf(spec);
    box.shown.set(spec, PAGE.colors.map((_, step) => (at + step) % count).find((slot) => !taken.has(slot)));
  }
  box.replaceChildren(...specs.map((spec) => {
    const slot = box.shown.get(spec), on = slot !== undefined;
    const button = make("button", { type: "button", ariaPressed: on, disabled: !on && box.shown.size >= count, title: PAGE.names[spec] ? spec : "" });
    button.dataset.spec = spec;
    button.innerHTML = `<svg viewBox="-8 -8 16 16" width="15" height="15" aria-hidden="true">${on ? `<path d="${PAGE.outlines[PAGE.shapes[slot]]}" fill="${PAGE.colors[slot]}"/>` : ""}</svg>`;
    button.append(make("span", {}, ...breakable(PAGE.names[spec] ?? spec)));
    button.addEventListener("click", () => {
      const others = [...box.shown.keys()].filter((one) => one !== spec);
      box.wanted = on ? others : [...others, spec];
      fillLegend(box, points, every);
      box.querySelector(`[data-spec="${CSS.escape(spec)}"]`).focus();
      for (const chart of box.closest("#charts, .stability").querySelectorAll(".chart")) chart.redraw?.();
    });
    return button;
  }));
  const none = every.filter((spec) => !points.has(spec)), most = box.nextElementSibling;
  most.hidden = specs.length <= box.shown.size;
  most.nextElementSibling.textContent = none.length && specs.length ? `Without points here: ${none.map((spec) => PAGE.names[spec] ?? spec).join(", ")}.` : "";
}
