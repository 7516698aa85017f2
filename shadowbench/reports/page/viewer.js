"use strict";
// Two pictures of one place, a wipe between them and one zoom for both; and thumbnails of where pictures are wrong.
// A page carries masks; they are shaded here, from the view lit everywhere and in shadow everywhere.

const FALSE_SHADOW = [213, 94, 0], FALSE_LIGHT = [0, 114, 178], NEVER_LIT = [70, 84, 104];
const LINEAR = Float32Array.from({ length: 256 }, (_, v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
const SRGB = Uint8Array.from({ length: 4096 }, (_, i) => (i /= 4095) <= 0.0031308 ? 3294.6 * i + 0.5 : 269.025 * i ** (1 / 2.4) - 13.525);

const decoded = new Map(); // of the scene that is shown

function pixels(source) {
  if (source && !decoded.has(source)) decoded.set(source, (async () => {
    const image = new Image();
    image.src = source;
    await image.decode();
    const context = Object.assign(document.createElement("canvas"), { width: image.width, height: image.height }).getContext("2d");
    context.drawImage(image, 0, 0);
    return context.getImageData(0, 0, image.width, image.height);
  })());
  return source ? decoded.get(source) : null;
}

// Everything that a picture of a cell, or of the truth for null, is made of.
async function parts(place, cell) {
  const sources = [place.lit, place.ambient, place.truth, place.undecided, cell ? cell.mask : place.truth, cell?.picture];
  const [lit, ambient, truth, undecided, mask, picture] = await Promise.all(sources.map(pixels));
  const size = (mask ?? picture ?? truth)?.width ?? 1;
  const error = (at) => !mask || !truth || undecided?.data[at] >= 128 ? 0 : (mask.data[at] - truth.data[at]) / 255;
  return { lit: lit?.data, ambient: ambient?.data, truth, mask, picture, size, error };
}

// One pixel, at its first byte, as `out` is to show it there.
function paint(of, mode, at, out, to) {
  const base = mode === "difference" ? of.truth ?? of.mask : of.mask;
  const visibility = base ? base.data[at] / 255 : 1;
  for (let k = 0; k < 3; k++) {
    if (mode === "mask") out[to + k] = of.lit && litless(of, at) ? NEVER_LIT[k] : 255 * visibility;
    else if (of.lit) {
      const dark = LINEAR[of.ambient[at + k]];
      out[to + k] = SRGB[Math.min(4095, 4095 * (dark + visibility * Math.max(0, LINEAR[of.lit[at + k]] - dark))) | 0];
    } else out[to + k] = of.picture ? of.picture.data[at + k] : 255 * visibility;
  }
  out[to + 3] = 255;
  if (mode === "difference") stain(out, to, of.error(at));
}

const litless = (of, at) => of.lit[at] === of.ambient[at] && of.lit[at + 1] === of.ambient[at + 1];

// The scene in pale grey, the error over it.
function stain(out, to, error) {
  const grey = 90 + 0.55 * (0.3 * out[to] + 0.6 * out[to + 1] + 0.1 * out[to + 2]), strength = Math.abs(error);
  for (let k = 0; k < 3; k++) out[to + k] = grey * (1 - strength) + (error < 0 ? FALSE_SHADOW : FALSE_LIGHT)[k] * strength;
}

async function render(canvas, place, cell, mode) {
  const of = await parts(place, cell);
  const image = new ImageData(of.size, of.size);
  for (let at = 0; at < image.data.length; at += 4) paint(of, mode, at, image.data, at);
  canvas.width = canvas.height = of.size;
  canvas.getContext("2d").putImageData(image, 0, 0);
}

// The middle of where most is wrong, as shares of the picture; null where nothing is.
async function worst(place, cell) {
  const { size, error } = await parts(place, cell), tiles = new Float32Array(256);
  for (let at = 0; at < 4 * size * size; at += 4) {
    const pixel = at / 4;
    tiles[16 * ((16 * Math.floor(pixel / size) / size) | 0) + ((16 * (pixel % size) / size) | 0)] += Math.abs(error(at));
  }
  const most = tiles.indexOf(Math.max(...tiles));
  return tiles[most] ? [(most % 16 + 0.5) / 16, (Math.floor(most / 16) + 0.5) / 16] : null;
}

const SIDE = 168;

// The whole picture with its errors made wider, and a part of it, eight times as large, around the worst place.
async function thumbnail(place, cell) {
  const of = await parts(place, cell), middle = await worst(place, cell), { size } = of;
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
    stain(image.data, to, Math.sign(error) * Math.min(1, 2 * Math.abs(error)));
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

const nameOf = (cell) => cell ? `${cell.spec}${cell.size ? ` at ${cell.size}` : ""}` : "truth";

class Viewer {
  constructor(box, changed = () => {}) {
    this.box = box;
    this.find = (selector) => box.querySelector(selector);
    this.stage = this.find(".stage");
    this.changed = changed;
    this.mode = "shaded";
    this.cut = 0.5;
    for (const side of ["a", "b"]) this.find(`select.${side}`).addEventListener("change", (event) => this.pick(side, event.target.value));
    this.find(".place").addEventListener("change", (event) => this.open(this.gallery, event.target.value));
    for (const input of box.querySelectorAll(".modes input")) input.addEventListener("change", () => this.draw(this.mode = input.value));
    this.find(".cut").addEventListener("input", (event) => this.place(this.cut = event.target.value / 100));
    for (const button of box.querySelectorAll("[data-by]")) button.addEventListener("click", () => this.zoom(Number(button.dataset.by)));
    this.find(".swap").addEventListener("click", () => this.swap());
    this.stage.addEventListener("wheel", (event) => {
      if (document.activeElement !== this.stage && !event.ctrlKey && !event.shiftKey) return; // it scrolls the page
      event.preventDefault();
      this.zoom(1.0015 ** -(event.deltaY || event.deltaX), this.at(event));
    }, { passive: false });
    this.stage.addEventListener("keydown", (event) => this.key(event));
    this.stage.addEventListener("pointerdown", (event) => this.drag(event));
    this.stage.addEventListener("pointermove", (event) => this.tell(event));
    this.fit();
  }

  // Show a gallery at a place; what is chosen stays chosen where it is there too.
  open(gallery, place = Object.keys(gallery.places)[0], a = this.a, b = this.b) {
    this.gallery = gallery;
    this.where = place;
    this.cells = gallery.cells.filter((cell) => cell.place === place);
    const found = (one) => one && (this.cells.find((cell) => cell.spec === one.spec && cell.size === one.size) ?? this.cells.find((cell) => cell.spec === one.spec));
    this.a = found(a) ?? this.cells[0];
    this.b = found(b) ?? null;
    const places = Object.keys(gallery.places);
    this.find(".place").replaceChildren(...places.map((one) => new Option(one, one, false, one === place)));
    this.find(".place-label").hidden = places.length < 2;
    for (const side of ["a", "b"]) {
      this.find(`select.${side}`).replaceChildren(new Option("truth (ray traced)", -1), ...this.cells.map((cell, at) => new Option(`${nameOf(cell)}   ${cell.iou}`, at)));
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
    const place = this.gallery.places[this.where];
    for (const side of ["a", "b"]) {
      const cell = this[side];
      this.find(`select.${side}`).value = this.cells.indexOf(cell);
      this.find(`.tag.${side}`).textContent = nameOf(cell);
      this.find(`.said.${side}`).textContent = cell ? `${nameOf(cell)}: ${cell.said}` : "truth: ray traced";
    }
    for (const input of this.box.querySelectorAll(".modes input")) input.checked = input.value === this.mode;
    this.changed(this.a);
    this.done = Promise.all(["a", "b"].map((side) => {
      const canvas = this.find(`canvas.${side}`);
      canvas.setAttribute("aria-label", `${this.mode}: ${nameOf(this[side])}`);
      return render(canvas, place, this[side], this.mode);
    }));
    await this.done;
  }

  // Zoom is `scale`, and what of the stage lies left of it and above it, in sides of the stage.
  fit() {
    Object.assign(this, { scale: 1, x: 0, y: 0 });
    this.place();
  }

  place() {
    const inside = (value) => Math.min(this.scale - 1, Math.max(0, value));
    [this.x, this.y] = [inside(this.x), inside(this.y)];
    this.find(".cut").value = 100 * this.cut;
    const style = { "--scale": this.scale, "--x": `${-100 * this.x}%`, "--y": `${-100 * this.y}%`, "--cut": `${100 * this.cut}%` };
    for (const [name, value] of Object.entries(style)) this.stage.style.setProperty(name, value);
    this.stage.classList.toggle("near", this.scale > 1.5);
    this.find(".scale").textContent = `${this.scale.toFixed(this.scale < 10 ? 1 : 0)} ×`;
  }

  // By a factor about a point of the stage; 0 shows the whole.
  zoom(by, [u, v] = [0.5, 0.5]) {
    const scale = by ? Math.min(64, Math.max(1, this.scale * by)) : 1, now = this.scale;
    Object.assign(this, { scale, x: (this.x + u) * scale / now - u, y: (this.y + v) * scale / now - v });
    this.place();
  }

  // Zoom to a place of the picture, in shares of it.
  look(middle, scale = 8) {
    Object.assign(this, { scale, x: middle[0] * scale - 0.5, y: middle[1] * scale - 0.5 });
    this.place();
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
    this.place();
  }

  // At the divider, or where all is shown, a drag moves the divider; elsewhere the picture.
  drag(down) {
    const start = this.at(down), { x, y } = this;
    const wipes = this.scale === 1 || Math.abs(start[0] - this.cut) * this.stage.clientWidth < 16;
    this.stage.setPointerCapture(down.pointerId);
    const move = (event) => {
      const [u, v] = this.at(event);
      if (wipes) this.cut = Math.min(1, Math.max(0, u));
      else Object.assign(this, { x: x + start[0] - u, y: y + start[1] - v });
      this.place();
    };
    this.stage.addEventListener("pointermove", move);
    for (const end of ["pointerup", "pointercancel"]) this.stage.addEventListener(end, () => this.stage.removeEventListener("pointermove", move), { once: true });
  }

  // What both masks hold under the pointer: visibility, 1 being lit.
  async tell(event) {
    const place = this.gallery.places[this.where], [u, v] = this.at(event);
    const masks = await Promise.all([this.a, this.b].map((cell) => pixels(cell ? cell.mask : place.truth)));
    const told = masks.map((mask) => {
      if (!mask) return ["–", "–"];
      const [x, y] = [(u + this.x) / this.scale, (v + this.y) / this.scale].map((one) => Math.min(mask.width - 1, Math.max(0, Math.floor(one * mask.width))));
      return [`${x}, ${y}`, (mask.data[4 * (y * mask.width + x)] / 255).toFixed(2)];
    });
    this.find(".under").textContent = `pixel ${told[0][0]}: left ${told[0][1]}, right ${told[1][1]}`;
  }
}
