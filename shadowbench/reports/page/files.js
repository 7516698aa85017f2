"use strict";
// Data files beside the page: a page opened from a disk may not read them, but each is a script that calls `deliver`.

const requests = new Map(); // by file name, what to call with its value

function deliver(name, value) {
  requests.get(name)?.(value);
}

const fetched = (name) => new Promise((resolve, reject) => {
  const script = document.createElement("script");
  script.src = name.split("/").map(encodeURIComponent).join("/"); // a page may be called "#1 50%.html"
  requests.set(name, resolve);
  script.onload = () => script.remove();
  script.onerror = () => reject(new Error(`${name} is missing: it belongs beside the page`));
  document.head.append(script);
});
