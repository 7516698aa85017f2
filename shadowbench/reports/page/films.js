"use strict";
// Sequences: films of the cells of a view, all at the same frame, with slices over time and curves by frame.

const films = byId("films"), frameInput = films.querySelector(".frame"), playButton = films.querySelector(".play");
let sequence = null, playing = null; // the data of what is shown, and the timer while it plays

function filmFigure(film) {
  const kinds = ["truth", "mask"], about = make("figcaption", {}, make("b", {}, ...breakable(nameOf(film))), `: ${film.scores}; slice of ${film.slice.place}`);
  const slices = film.slice.images.map((src, at) => make("div", {}, make("img", { src, alt: `${kinds[at]} over time: ${film.slice.place}` })));
  const box = make("div", { className: "film" }, make("div", {}, make("img", { alt: "" })), make("div", { className: "slice" }, ...slices));
  const [left, row, width] = film.slice.box, places = { "--left": left, "--row": row, "--width": width, "--frames": film.frames.length };
  for (const [name, value] of Object.entries(places)) box.style.setProperty(name, value);
  return make("figure", {}, about, box);
}

function showFrame(wanted) {
  frameInput.value = wanted;
  const frame = frameInput.valueAsNumber;
  films.querySelector("output").textContent = frame;
  films.style.setProperty("--frame", frame);
  for (const [at, film] of sequence.films.entries()) {
    Object.assign(films.querySelectorAll(".film")[at].querySelector("img"), { src: film.frames[frame], alt: `${nameOf(film)}, frame ${frame}: truth, mask and difference` });
  }
  for (const [at, chart] of sequence.charts.entries()) {
    chart.params.find((param) => param.name === "frame").value = frame; // for when it is drawn anew
    films.querySelectorAll(".chart")[at].view.signal("frame", frame).runAsync();
  }
}

function play(on) {
  clearInterval(playing);
  playing = on ? setInterval(() => showFrame(frameInput.value === frameInput.max ? 0 : frameInput.valueAsNumber + 1), 125) : null;
  playButton.textContent = on ? "❚❚ pause" : "▶ play";
}

async function showSequence(name) {
  play(false);
  const views = data(currentPanel).sequences ?? {}, names = Object.keys(views);
  films.hidden = !names.length;
  if (!names.length) return;
  sequence = views[name ?? names[0]];
  films.querySelector("select").replaceChildren(...names.map((one) => new Option(one, one, false, one === name)));
  films.querySelector(".films").replaceChildren(...sequence.films.map(filmFigure));
  for (const node of films.querySelectorAll(".filmed")) node.hidden = !sequence.films.length;
  frameInput.max = Math.max(0, ...sequence.films.map((film) => film.frames.length - 1));
  await Promise.all(sequence.charts.map((chart, at) => draw(films.querySelectorAll(".chart")[at], chart, (point) => showFrame(point.frame))));
  showFrame(0);
}

const soon = (name) => { window.drawn = Promise.all([window.drawn, showSequence(name)]); };
byId("scene").addEventListener("change", () => soon());
films.querySelector("select").addEventListener("change", (event) => soon(event.target.value));
frameInput.addEventListener("input", () => showFrame(frameInput.value));
frameInput.addEventListener("keydown", (event) => { if (event.key === " ") play(!playing); });
playButton.addEventListener("click", () => play(!playing));
soon();
