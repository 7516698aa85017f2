"use strict";
// What the other scripts share: the page's data, and elements.

const byId = (id) => document.getElementById(id);
const PAGE = JSON.parse(byId("page").textContent);

function make(tag, properties, ...children) {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
}

// The text of a spec with line breaks allowed between its parameters.
const breakable = (text) => text.split(/(?<=[,:(])/).flatMap((piece) => [piece, document.createElement("wbr")]);

const data = (id) => PAGE.data[id];
