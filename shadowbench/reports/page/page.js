"use strict";
// What the other scripts share: the page's data, elements, and data files beside the page.

const byId = (id) => document.getElementById(id);
const PAGE = JSON.parse(byId("page").textContent);

function make(tag, properties, ...children) {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
}

// The text of a spec with line breaks allowed between its parameters.
const breakable = (text) => text.split(/(?<=[,:(])/).flatMap((piece) => [piece, document.createElement("wbr")]);

// A page opened from a disk may not read the files beside it, but each is a script that calls `deliver`.
const requests = new Map(); // by file name, what to call with its value
const deliver = (name, value) => requests.get(name)(value);
const fetched = (name) => new Promise((resolve, reject) => {
  requests.set(name, resolve);
  document.head.append(make("script", {
    src: name.split("/").map(encodeURIComponent).join("/"), // a page may be called "#1 50%.html"
    onload() { this.remove(); },
    onerror: () => reject(new Error(`${name} is missing: it belongs beside the page`)),
  }));
});
const cache = new Map();
const data = (id) => cache.get(id); // once it is loaded

async function loaded(id) {
  if (!cache.has(id)) cache.set(id, typeof PAGE.data[id] === "string" ? await fetched(PAGE.data[id]) : PAGE.data[id]);
  return data(id);
}
