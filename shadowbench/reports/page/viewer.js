"use strict";
// The viewer: two pictures of a view, with a divider between them and a common zoom; and thumbnails of errors.
// Masks are shaded here, from pictures of the view without shadow (lit) and in full shadow (ambient).

const FALSE_SHADOW = [213, 94, 0], FALSE_LIGHT = [0, 114, 178], UNLIT = [70, 84, 104];
const LINEAR = Float32Array.from({ length: 256 }, (_, v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
const SRGB = Uint8Array.from({ length: 4096 }, (_, i) => (i /= 4095) <= 0.0031308 ? 3294.6 * i + 0.5 : 269.025 * i ** (1 / 2.4) - 13.525);

const decoded = new Map(); // pictures of the current scene, by data URI or file beside the page

function pixels(source) {
  if (source && !decoded.has(source)) decoded.set(source, (async () => {
    const image = new Image();
    image.src = source.startsWith("data:") ? source : await fetched(source);
    await image.decode();
    const context = Object.assign(document.createElement("canvas"), { width: image.width, height: image.height }).getContext("2d");
    context.drawImage(image, 0, 0);
    return context.getImageData(0, 0, image.width, image.height);
  })());
  return source ? decoded.get(source) : null;
}

// The images from which the picture of a cell, or of the truth for null, is computed.
async function load(view, cell) {
  const sources = [view.lit, view.ambient, view.truth, view.undecided, cell ? cell.mask : view.truth, cell?.picture];
  const [lit, ambient, truth, undecided, mask, picture] = await Promise.all(sources.map(pixels));
  const size = (mask ?? picture ?? truth)?.width ?? 1;
  const error = (at) => !mask || !truth || undecided?.data[at] >= 128 ? 0 : (mask.data[at] - truth.data[at]) / 255;
  return { lit: lit?.data, ambient: ambient?.data, truth, mask, picture, size, error, soft: cell?.soft };
}

// Writes the pixel at byte `at` to byte `to` of `out`, in a mode: shaded, mask or difference.
function paint(of, mode, at, out, to) {
  const base = mode === "difference" ? of.truth ?? of.mask : of.mask;
  const visibility = base ? base.data[at] / 255 : 1;
  for (let k = 0; k < 3; k++) {
    if (mode === "mask") out[to + k] = of.lit && unlit(of, at) ? UNLIT[k] : 255 * visibility;
    else if (of.lit) {
      const dark = LINEAR[of.ambient[at + k]];
      out[to + k] = SRGB[Math.min(4095, 4095 * (dark + visibility * Math.max(0, LINEAR[of.lit[at + k]] - dark))) | 0];
    } else out[to + k] = of.picture ? of.picture.data[at + k] : 255 * visibility;
  }
  out[to + 3] = 255;
  if (mode === "difference") tint(out, to, weight(of, of.error(at)));
}

// Whether a pixel receives no light even without shadows.
const unlit = (of, at) => of.lit[at] === of.ambient[at] && of.lit[at + 1] === of.ambient[at + 1];

// The signed strength of an error's colour: of soft shadows the root, as their errors are small.
const weight = (of, error) => of.soft ? Math.sign(error) * Math.sqrt(Math.abs(error)) : error;

// Turns a pixel into pale grey, tinted by its error's weight.
function tint(out, to, error) {
  const grey = 90 + 0.55 * (0.3 * out[to] + 0.6 * out[to + 1] + 0.1 * out[to + 2]), strength = Math.abs(error);
  for (let k = 0; k < 3; k++) out[to + k] = grey * (1 - strength) + (error < 0 ? FALSE_SHADOW : FALSE_LIGHT)[k] * strength;
}

async function render(canvas, view, cell, mode) {
  const of = await load(view, cell);
  const image = new ImageData(of.size, of.size);
  for (let at = 0; at < image.data.length; at += 4) paint(of, mode, at, image.data, at);
  canvas.width = canvas.height = of.size;
  canvas.getContext("2d").putImageData(image, 0, 0);
}

// Centre of the tile with the largest error, in [0, 1]²; null without errors.
async function worstTile(view, cell) {
  const { size, error } = await load(view, cell), tiles = new Float32Array(256);
  for (let at = 0; at < 4 * size * size; at += 4) {
    const pixel = at / 4;
    tiles[16 * ((16 * Math.floor(pixel / size) / size) | 0) + ((16 * (pixel % size) / size) | 0)] += Math.abs(error(at));
  }
  const most = tiles.indexOf(Math.max(...tiles));
  return tiles[most] ? [(most % 16 + 0.5) / 16, (Math.floor(most / 16) + 0.5) / 16] : null;
}

const SIDE = 168;

// The whole picture with dilated errors, and the region of the worst tile enlarged eight times.
async function thumbnail(view, cell) {
  const of = await load(view, cell), middle = await worstTile(view, cell), { size } = of;
  const [whole, part] = [0, 1].map(() => Object.assign(document.createElement("canvas"), { width: SIDE, height: SIDE }));
  const most = new Float32Array(SIDE * SIDE), image = new ImageData(SIDE, SIDE), crop = new ImageData(SIDE, SIDE);
  const step = size / SIDE;
  for (let y = 0; y < size; y++) for (let x = 0; x < size; x++) {
    const error = of.error(4 * (y * size + x)), to = ((y / step) | 0) * SIDE + ((x / step) | 0);
    if (Math.abs(error) > Math.abs(most[to])) most[to] = error;
  }
  const corner = (middle ?? [0.5, 0.5]).map((at) => Math.round(size * Math.min(0.875, Math.max(0, at - 0.0625))));
  for (let y = 0; y < SIDE; y++) for (let x = 0; x < SIDE; x++) {
    const to = 4 * (y * SIDE + x);
    let error = 0;
    for (let v = -1; v < 2; v++) for (let u = -1; u < 2; u++) {
      const beside = most[(y + v) * SIDE + x + u] || 0;
      if (Math.abs(beside) > Math.abs(error)) error = beside;
    }
    paint({ ...of, mask: of.truth ?? of.mask }, "shaded", 4 * (((y + 0.5) * step | 0) * size + ((x + 0.5) * step | 0)), image.data, to);
    tint(image.data, to, of.soft ? weight(of, error) : Math.sign(error) * Math.min(1, 2 * Math.abs(error)));
    const from = [corner[0] + (x * step / 8 | 0), corner[1] + (y * step / 8 | 0)];
    paint(of, "difference", 4 * (from[1] * size + from[0]), crop.data, to);
  }
  whole.getContext("2d").putImageData(image, 0, 0);
  part.getContext("2d").putImageData(crop, 0, 0);
  if (middle) {
    const frame = whole.getContext("2d");
    for (const [color, width] of [["#fff", 4], ["#000", 2]]) {
      Object.assign(frame, { strokeStyle: color, lineWidth: width });
      frame.strokeRect(corner[0] / step, corner[1] / step, SIDE / 8, SIDE / 8);
    }
  }
  return middle ? [whole, part] : [whole];
}

const nameOf = (cell) => cell ? `${PAGE.names[cell.spec] ?? cell.spec}${cell.size ? ` at ${cell.size}` : ""}` : "truth";

class Viewer {
  constructor(box, onDraw = () => {}) {
    this.box = box;
    this.find = (selector) => box.querySelector(selector);
    this.stage = this.find(".stage");
    this.onDraw = onDraw;
    this.mode = "shaded";
    this.cut = 0.5;
    for (const side of ["a", "b"]) this.find(`select.${side}`).addEventListener("change", (event) => this.pick(side, event.target.value));
    this.find("select.view").addEventListener("change", (event) => this.open(this.gallery, event.target.value));
    for (const input of box.querySelectorAll(".modes input")) input.addEventListener("change", () => this.draw(this.mode = input.value));
    this.find(".cut").addEventListener("input", (event) => this.update(this.cut = event.target.value / 100));
    for (const button of box.querySelectorAll("[data-by]")) button.addEventListener("click", () => this.zoom(Number(button.dataset.by)));
    this.find(".swap").addEventListener("click", () => this.swap());
    this.stage.addEventListener("wheel", (event) => {
      if (document.activeElement !== this.stage && !event.ctrlKey && !event.shiftKey) return; // the wheel scrolls the page
      event.preventDefault();
      this.zoom(1.0015 ** -(event.deltaY || event.deltaX), this.at(event));
    }, { passive: false });
    this.stage.addEventListener("keydown", (event) => this.key(event));
    this.stage.addEventListener("pointerdown", (event) => this.drag(event));
    this.stage.addEventListener("pointermove", (event) => this.readOut(event));
    this.fit();
  }

  // Shows a view of a gallery; keeps the chosen cells if the view has them.
  open(gallery, viewName = Object.keys(gallery.views)[0], a = this.a, b = this.b) {
    this.gallery = gallery;
    this.viewName = viewName;
    this.cells = gallery.cells.filter((cell) => cell.view === viewName);
    const found = (one) => one && (this.cells.find((cell) => cell.spec === one.spec && cell.size === one.size) ?? this.cells.find((cell) => cell.spec === one.spec));
    this.a = found(a) ?? this.cells[0];
    this.b = found(b) ?? null;
    const names = Object.keys(gallery.views);
    this.find("select.view").replaceChildren(...names.map((one) => new Option(one, one, false, one === viewName)));
    this.find(".view-label").hidden = names.length < 2;
    for (const side of ["a", "b"]) {
      this.find(`select.${side}`).replaceChildren(new Option("truth (ray traced)", -1), ...this.cells.map((cell, at) => new Option(`${nameOf(cell)}   ${cell.score}`, at)));
    }
    return this.draw();
  }

  pick(side, index) {
    this[side] = this.cells[index] ?? null;
    return this.draw();
  }

  swap() {
    [this.a, this.b] = [this.b, this.a];
    return this.draw();
  }

  async draw() {
    const view = this.gallery.views[this.viewName];
    for (const side of ["a", "b"]) {
      const cell = this[side];
      this.find(`select.${side}`).value = this.cells.indexOf(cell);
      this.find(`.tag.${side}`).textContent = nameOf(cell);
      const caption = this.find(`.caption.${side}`);
      caption.textContent = cell ? `${nameOf(cell)}${PAGE.names[cell.spec] ? ` (${cell.spec})` : ""}: ${cell.caption}` : "truth: ray traced";
      if (cell?.command) caption.append(" ", Object.assign(document.createElement("code"), { textContent: cell.command }));
    }
    this.find(".errors").hidden = !this.cells[0]?.soft;
    for (const input of this.box.querySelectorAll(".modes input")) input.checked = input.value === this.mode;
    this.done = Promise.all([this.onDraw(this.a), ...["a", "b"].map((side) => {
      const canvas = this.find(`canvas.${side}`);
      canvas.setAttribute("aria-label", `${this.mode}: ${nameOf(this[side])}`);
      return render(canvas, view, this[side], this.mode);
    })]);
    await this.done;
  }

  // Resets the zoom. `x` and `y` are the offset of the visible region from the picture's corner, in stage sizes.
  fit() {
    Object.assign(this, { scale: 1, x: 0, y: 0 });
    this.update();
  }

  update() {
    const inside = (value) => Math.min(this.scale - 1, Math.max(0, value));
    [this.x, this.y] = [inside(this.x), inside(this.y)];
    this.find(".cut").value = 100 * this.cut;
    const style = { "--scale": this.scale, "--x": `${-100 * this.x}%`, "--y": `${-100 * this.y}%`, "--cut": `${100 * this.cut}%` };
    for (const [name, value] of Object.entries(style)) this.stage.style.setProperty(name, value);
    this.stage.classList.toggle("near", this.scale > 1.5);
    this.find(".scale").textContent = `${this.scale.toFixed(this.scale < 10 ? 1 : 0)} ×`;
  }

  // Zooms by a factor about a point of the stage; a factor of 0 resets.
  zoom(by, [u, v] = [0.5, 0.5]) {
    const scale = by ? Math.min(64, Math.max(1, this.scale * by)) : 1, now = this.scale;
    Object.assign(this, { scale, x: (this.x + u) * scale / now - u, y: (this.y + v) * scale / now - v });
    this.update();
  }

  // Zooms to a point of the picture, in [0, 1]².
  zoomTo(middle, scale = 8) {
    Object.assign(this, { scale, x: middle[0] * scale - 0.5, y: middle[1] * scale - 0.5 });
    this.update();
  }

  at(event) {
    const { left, top, width, height } = this.stage.getBoundingClientRect();
    return [(event.clientX - left) / width, (event.clientY - top) / height];
  }

  key(event) {
    const pan = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    const act = { "+": () => this.zoom(1.5), "=": () => this.zoom(1.5), "-": () => this.zoom(1 / 1.5), 0: () => this.fit(), x: () => this.swap() }[event.key];
    if (pan && (this.scale === 1 || event.shiftKey)) this.cut = Math.min(1, Math.max(0, this.cut + 0.02 * pan[0]));
    else if (pan) Object.assign(this, { x: this.x + 0.1 * pan[0], y: this.y + 0.1 * pan[1] });
    else if (!act || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    act?.();
    this.update();
  }

  // Dragging moves the divider if it starts there or nothing is zoomed, else the picture.
  drag(down) {
    const start = this.at(down), { x, y } = this;
    const movesDivider = this.scale === 1 || Math.abs(start[0] - this.cut) * this.stage.clientWidth < 16;
    this.stage.setPointerCapture(down.pointerId);
    const move = (event) => {
      const [u, v] = this.at(event);
      if (movesDivider) this.cut = Math.min(1, Math.max(0, u));
      else Object.assign(this, { x: x + start[0] - u, y: y + start[1] - v });
      this.update();
    };
    this.stage.addEventListener("pointermove", move);
    for (const end of ["pointerup", "pointercancel"]) this.stage.addEventListener(end, () => this.stage.removeEventListener("pointermove", move), { once: true });
  }

  // Shows the visibility of both masks under the pointer.
  async readOut(event) {
    const view = this.gallery.views[this.viewName], [u, v] = this.at(event);
    const masks = await Promise.all([this.a, this.b].map((cell) => pixels(cell ? cell.mask : view.truth)));
    const readings = masks.map((mask) => {
      if (!mask) return ["–", "–"];
      const [x, y] = [(u + this.x) / this.scale, (v + this.y) / this.scale].map((one) => Math.min(mask.width - 1, Math.max(0, Math.floor(one * mask.width))));
      return [`${x}, ${y}`, (mask.data[4 * (y * mask.width + x)] / 255).toFixed(2)];
    });
    this.find(".readout").textContent = `pixel ${readings[0][0]}: left ${readings[0][1]}, right ${readings[1][1]}`;
  }
}
