"use strict";
// What a chart is made of: marks, places on axes.

const NARROW = document.documentElement.clientWidth < 640;
const SHAPES = { o: [24, 0, 1], s: [4, 45, 1], "^": [3, 0, 1], D: [4, 0, 1], v: [3, 180, 1], P: [4, 0, 0.45] };
Object.assign(SHAPES, { X: [4, 45, 0.45], "<": [3, -90, 1], ">": [3, 90, 1], p: [5, 0, 1], "*": [4, 0, 0.3], H: [6, 0, 1] });

// A polygon's points about (x, y): corners, degrees of the first from the top, inner radius of a star.
function corners([count, turn, inner], x, y, radius) {
  const all = inner < 1 ? 2 * count : count;
  return Array.from({ length: all }, (_, i) => {
    const angle = ((turn - 90 + (360 * i) / all) * Math.PI) / 180;
    const r = i % 2 && inner < 1 ? radius * inner : radius;
    return `${(x + r * Math.cos(angle)).toFixed(1)},${(y + r * Math.sin(angle)).toFixed(1)}`;
  }).join(" ");
}

function escaped(text) {
  return String(text).replace(/[&<>"]/g, (sign) => `&#${sign.charCodeAt(0)};`);
}

// Round places between two logarithms: powers of ten, with 2 and 5 where there are few.
function ticks(low, high) {
  const made = [];
  const parts = high - low < 1.6 ? [1, 2, 5] : [1];
  for (let power = Math.floor(low); power <= high; power++)
    for (const part of parts) if (power + Math.log10(part) >= low && power + Math.log10(part) <= high) made.push(part * 10 ** power);
  return made;
}

function linear(low, high) {
  const step = [0.01, 0.1, 1, 10].flatMap((ten) => [ten, 2 * ten, 5 * ten]).find((one) => (high - low) / one <= 8) ?? 20;
  const first = Math.ceil(low / step);
  return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, i) => Number(((first + i) * step).toFixed(2)));
}
