"use strict";
// Figures: what the mark nearest to the pointer says, below the figure. A title alone wants a pointer that rests.

const NEAR = 12; // pixels of the screen

function marks(figure) {
  const titles = [...figure.querySelectorAll("svg title")];
  if (!titles.length) return;
  const said = element("output");
  figure.querySelector("svg").after(said);
  const away = (title, event) => {
    const box = title.parentElement.getBoundingClientRect();
    if (Math.max(box.width, box.height) > 4 * NEAR) return Infinity; // of many marks, or a bar: only what is under the pointer
    const [x, y] = [box.left + box.width / 2, box.top + box.height / 2];
    return Math.hypot(event.clientX - x, event.clientY - y);
  };
  const under = (node) => {
    const title = [...node.children].find((one) => one.localName === "title");
    return title || node.localName === "svg" ? title : under(node.parentElement);
  };
  const tell = (event) => {
    const distances = titles.map((title) => away(title, event));
    const least = Math.min(...distances);
    const title = least < NEAR ? titles[distances.indexOf(least)] : under(event.target);
    said.textContent = title?.textContent ?? "";
  };
  for (const kind of ["pointermove", "pointerdown"]) figure.querySelector("svg").addEventListener(kind, tell);
}

document.querySelectorAll("figure.inline").forEach(marks);
