"use strict";
// The viewer: two pictures of a view, with a divider between them and a common zoom.
// Masks are shaded here, from pictures of the view without shadow (lit) and in full shadow (ambient).

const FALSE_SHADOW = [213, 94, 0], FALSE_LIGHT = [0, 114, 178], FACETS = [204, 121, 167], UNLIT = [70, 84, 104];
const LINEAR = Float32Array.from({ length: 256 }, (_, v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
const SRGB = Uint8Array.from({ length: 4096 }, (_, i) => (i /= 4095) <= 0.0031308 ? 3294.6 * i + 0.5 : 269.025 * i ** (1 / 2.4) - 13.525);

const decoded = new Map(); // pictures of the current scene, by data URI

function pixels(source) {
  if (source && !decoded.has(source)) decoded.set(source, (async () => {
    const image = make("img", { src: source });
    await image.decode();
    const context = make("canvas", { width: image.width, height: image.height }).getContext("2d");
    context.drawImage(image, 0, 0);
    return context.getImageData(0, 0, image.width, image.height);
  })());
  return source ? decoded.get(source) : null;
}

// The images from which the picture of a cell, or of the truth for null, is computed.
async function load(view, cell) {
  const sources = [view.lit, view.ambient, view.truth, view.undecided, view.facets, cell ? cell.mask : view.truth, cell?.picture];
  const [lit, ambient, truth, undecided, facets, mask, picture] = await Promise.all(sources.map(pixels));
  const error = (at) => !mask || !truth || undecided?.data[at] >= 128 ? 0 : (mask.data[at] - truth.data[at]) / 255;
  const dark = (at) => mask && facets?.data[at] >= 128 ? 1 - mask.data[at] / 255 : 0; // of a smooth surface's own triangles
  const smooth = facets?.data.some((level, at) => at % 4 === 0 && level >= 128);
  return { lit: lit?.data, ambient: ambient?.data, truth, mask, picture, shape: mask ?? picture ?? truth ?? { width: 1, height: 1 }, error, dark, smooth, soft: cell?.soft };
}

// Draws what `load` gave in a mode: shaded, mask or difference.
function render(canvas, of, mode) {
  const { width, height } = of.shape, image = new ImageData(width, height), out = image.data, base = mode === "difference" ? of.truth ?? of.mask : of.mask;
  for (let at = 0; at < out.length; at += 4) {
    const visibility = base ? base.data[at] / 255 : 1;
    const unlit = of.lit && of.lit[at] === of.ambient[at] && of.lit[at + 1] === of.ambient[at + 1]; // even without shadows
    for (let k = 0; k < 3; k++) {
      if (mode === "mask") out[at + k] = unlit ? UNLIT[k] : 255 * visibility;
      else if (of.lit) {
        const dark = LINEAR[of.ambient[at + k]];
        out[at + k] = SRGB[Math.min(4095, 4095 * (dark + visibility * Math.max(0, LINEAR[of.lit[at + k]] - dark))) | 0];
      } else out[at + k] = of.picture ? of.picture.data[at + k] : 255 * visibility;
    }
    out[at + 3] = 255;
    if (mode === "difference") tint(out, at, of);
  }
  Object.assign(canvas, { width, height }).getContext("2d").putImageData(image, 0, 0);
}

// Turns a pixel into pale grey, tinted by its error; of soft shadows by the root, as their errors are small.
function tint(out, at, of) {
  const error = of.error(at), strength = of.soft ? Math.sqrt(Math.abs(error)) : Math.abs(error), facet = of.dark(at);
  const grey = 90 + 0.55 * (0.3 * out[at] + 0.6 * out[at + 1] + 0.1 * out[at + 2]);
  for (let k = 0; k < 3; k++) {
    const tinted = grey * (1 - strength) + (error < 0 ? FALSE_SHADOW : FALSE_LIGHT)[k] * strength;
    out[at + k] = tinted * (1 - facet) + FACETS[k] * facet;
  }
}

const inside = (value, most) => Math.min(most, Math.max(0, value));
const nameOf = (cell) => cell ? `${PAGE.names[cell.spec] ?? cell.spec}${cell.size ? ` at ${cell.size}` : ""}` : "truth";

class Viewer {
  constructor(box, onDraw = () => {}) {
    Object.assign(this, { box, onDraw, mode: "shaded", cut: 0.5 });
    this.find = (selector) => box.querySelector(selector);
    this.stage = this.find(".stage");
    for (const side of ["a", "b"]) this.find(`select.${side}`).addEventListener("change", (event) => this.pick(side, event.target.value));
    this.find("select.view").addEventListener("change", (event) => this.open(this.gallery, event.target.value));
    for (const input of box.querySelectorAll(".modes input")) input.addEventListener("change", () => this.draw(this.mode = input.value));
    this.find(".cut").addEventListener("input", (event) => this.update({ cut: event.target.value / 100 }));
    for (const button of box.querySelectorAll("[data-by]")) button.addEventListener("click", () => this.zoom(Number(button.dataset.by)));
    this.stage.addEventListener("wheel", (event) => {
      if (document.activeElement !== this.stage && !event.ctrlKey && !event.shiftKey) return; // the wheel scrolls the page
      event.preventDefault();
      this.zoom(1.0015 ** -(event.deltaY || event.deltaX), this.at(event));
    }, { passive: false });
    this.stage.addEventListener("pointerdown", (event) => this.drag(event));
    this.zoom(0);
  }

  // Shows a view of a gallery; keeps the chosen cells if the view has them.
  open(gallery, viewName = Object.keys(gallery.views)[0], a = this.a, b = this.b) {
    const cells = gallery.cells.filter((cell) => cell.view === viewName), names = Object.keys(gallery.views);
    const found = (one) => one && (cells.find((cell) => cell.spec === one.spec && cell.size === one.size) ?? cells.find((cell) => cell.spec === one.spec));
    Object.assign(this, { gallery, viewName, cells, a: found(a) ?? cells[0], b: found(b) ?? null });
    this.find("select.view").replaceChildren(...names.map((one) => new Option(one, one, false, one === viewName)));
    this.find(".view-label").hidden = names.length < 2;
    for (const side of ["a", "b"]) {
      this.find(`select.${side}`).replaceChildren(new Option("truth (ray traced)", -1), ...cells.map((cell, at) => new Option(`${nameOf(cell)}   ${cell.score}`, at)));
    }
    return this.draw();
  }

  pick(side, index) {
    this[side] = this.cells[index] ?? null;
    return this.draw();
  }

  draw() {
    const view = this.gallery.views[this.viewName];
    for (const input of this.box.querySelectorAll(".modes input")) input.checked = input.value === this.mode;
    this.find(".errors").hidden = !this.cells[0]?.soft;
    const sides = ["a", "b"].map(async (side) => {
      const cell = this[side], canvas = this.find(`canvas.${side}`), preset = PAGE.names[cell?.spec] ? ` (${cell.spec})` : "";
      this.find(`select.${side}`).value = this.cells.indexOf(cell);
      this.find(`.tag.${side}`).textContent = nameOf(cell);
      this.find(`.caption.${side}`).replaceChildren(cell ? `${nameOf(cell)}${preset}: ${[cell.caption, ...cell.faults ?? []].join("; ")} ` : "truth: ray traced", make("code", {}, cell?.command ?? ""));
      canvas.ariaLabel = `${this.mode}: ${nameOf(cell)}`;
      const of = await load(view, cell);
      this.find(".smooth").hidden = !of.smooth;
      this.stage.style.aspectRatio = of.shape.width / of.shape.height;
      render(canvas, of, this.mode);
    });
    return this.done = Promise.all([this.onDraw(this.a), ...sides]);
  }

  // Moves the divider, or the visible region: `x` and `y` are its offset from the picture's corner, in stage sizes.
  update(change) {
    Object.assign(this, change);
    [this.x, this.y, this.cut] = [inside(this.x, this.scale - 1), inside(this.y, this.scale - 1), inside(this.cut, 1)];
    this.find(".cut").value = 100 * this.cut;
    const style = { "--scale": this.scale, "--x": `${-100 * this.x}%`, "--y": `${-100 * this.y}%`, "--cut": `${100 * this.cut}%` };
    for (const [name, value] of Object.entries(style)) this.stage.style.setProperty(name, value);
    this.stage.classList.toggle("near", this.scale > 1.5);
    this.find(".scale").textContent = `${this.scale.toFixed(this.scale < 10 ? 1 : 0)} ×`;
  }

  // Zooms by a factor about a point of the stage; a factor of 0 resets.
  zoom(by, [u, v] = [0.5, 0.5]) {
    const scale = by ? Math.min(64, Math.max(1, this.scale * by)) : 1, grown = by ? scale / this.scale : 0;
    this.update({ scale, x: by && (this.x + u) * grown - u, y: by && (this.y + v) * grown - v });
  }

  at(event) {
    const { left, top, width, height } = this.stage.getBoundingClientRect();
    return [(event.clientX - left) / width, (event.clientY - top) / height];
  }

  // Dragging moves the divider if it starts there or nothing is zoomed, else the picture.
  drag(down) {
    const [u, v] = this.at(down), { x, y } = this, stop = new AbortController();
    const movesDivider = this.scale === 1 || Math.abs(u - this.cut) * this.stage.clientWidth < 16;
    this.stage.setPointerCapture(down.pointerId);
    this.stage.addEventListener("pointermove", (event) => {
      const now = this.at(event);
      this.update(movesDivider ? { cut: now[0] } : { x: x + u - now[0], y: y + v - now[1] });
    }, stop);
    for (const end of ["pointerup", "pointercancel"]) this.stage.addEventListener(end, () => stop.abort(), stop);
  }
}
