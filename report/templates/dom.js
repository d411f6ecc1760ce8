"use strict";

// A new element with these properties and this inside: elements and texts.
function element(name, properties = {}, ...inside) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...inside);
  return made;
}
