"use strict";
// Two phases' pictures under one slider, their difference, the evaluations, and the pixel under the pointer.

const GAIN = 16; // of the difference: 16/255 and more is white

function drawn(picture) {
  const canvas = document.createElement("canvas");
  canvas.width = picture.naturalWidth;
  canvas.height = picture.naturalHeight;
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(picture, 0, 0);
  return context.getImageData(0, 0, canvas.width, canvas.height);
}

// |a - b| of each channel, amplified; RGBA of the same size.
function difference(a, b) {
  const made = new ImageData(a.width, a.height);
  for (let i = 0; i < a.data.length; i++)
    made.data[i] = i % 4 === 3 ? 255 : Math.min(255, GAIN * Math.abs(a.data[i] - b.data[i]));
  return made;
}

// Grey levels as colours from black over red and yellow to white.
function heat(levels) {
  const made = new ImageData(levels.width, levels.height);
  for (let i = 0; i < made.data.length; i++)
    made.data[i] = i % 4 === 3 ? 255 : 3 * levels.data[i - (i % 4)] - 255 * (i % 4);
  return made;
}

function viewer(figure) {
  const pictures = [...figure.querySelectorAll("img[data-scene]")];
  const evaluations = [...figure.querySelectorAll("img[data-most]")];
  const scenes = [...new Set(pictures.map((one) => one.dataset.scene))];
  const menu = (label) => element("select", { ariaLabel: label });
  const [scene, left, right] = [menu("Scene"), menu("Left picture"), menu("Right picture")];
  const slider = element("input", { type: "range", min: 0, max: 100, step: 0.5, value: 50 });
  slider.setAttribute("aria-label", "Divider between the two pictures, in percent from the left");
  const canvases = [0, 1, 2].map(() => element("canvas"));
  const said = element("output", { className: "pixel" });
  const divider = element("i");
  const crosses = canvases.map(() => element("b", { hidden: true }));
  const [first, ...others] = canvases.map((canvas, i) => element("div", { className: "under" }, canvas, crosses[i]));
  first.append(divider);
  const wide = element("div", { className: "one" }, first);
  const captions = ["", `Difference, ${GAIN} times as strong`, ""].map((text) => element("p", { textContent: text, className: "small" }));
  const beside = [1, 2].map((i) => element("div", {}, others[i - 1], captions[i]));
  const hint = "Move the pointer over the picture, or use the arrow keys on the slider.";
  const tools = element("p", { className: "tools" }, "Scene ", scene, " left ", left, " right ", right);
  wide.append(slider, said);
  figure.querySelector(".plain").hidden = true;
  figure.prepend(tools, element("div", { className: "compared" }, wide, element("div", {}, ...beside)));
  let a, b, levels, most;

  const show = () => {
    const { width, height } = a;
    const cut = Math.round((width * slider.value) / 100);
    const context = canvases[0].getContext("2d");
    context.putImageData(a, 0, 0, 0, 0, cut, height);
    context.putImageData(b, 0, 0, cut, 0, width - cut, height);
    divider.style.left = `${(100 * cut) / width}%`;
  };
  const at = (data, x, y) => [...data.data.slice(4 * (y * data.width + x), 4 * (y * data.width + x) + 3)];
  const tell = (event) => {
    const box = event.currentTarget.getBoundingClientRect();
    const x = Math.min(a.width - 1, Math.max(0, Math.floor(((event.clientX - box.left) / box.width) * a.width)));
    const y = Math.min(a.height - 1, Math.max(0, Math.floor(((event.clientY - box.top) / box.height) * a.height)));
    if (event.currentTarget === canvases[0]) {
      slider.value = (100 * (event.clientX - box.left)) / box.width;
      show();
    }
    const count = levels ? `; about ${Math.round((levels.data[4 * (y * a.width + x)] * most) / 255)} evaluations` : "";
    const [one, other] = [at(a, x, y), at(b, x, y)];
    const apart = one.map((value, i) => Math.abs(value - other[i]));
    said.textContent = `Pixel ${x}, ${y}: ${left.value} ${one.join(" ")}; ${right.value} ${other.join(" ")}; difference ${apart.join(" ")} (R G B of 255)${count}`;
    for (const cross of crosses) {
      cross.hidden = false;
      cross.style.left = `${(100 * (x + 0.5)) / a.width}%`;
      cross.style.top = `${(100 * (y + 0.5)) / a.height}%`;
    }
  };
  const load = async () => {
    const find = (phase) => pictures.find((one) => one.dataset.scene === scene.value && one.dataset.phase === phase);
    const source = evaluations.find((one) => one.dataset.of === scene.value);
    const wanted = [find(left.value), find(right.value), source].filter(Boolean);
    await Promise.all(wanted.map((one) => one.decode()));
    [a, b] = wanted.map(drawn);
    levels = source && drawn(source);
    most = source && Number(source.dataset.most);
    for (const canvas of canvases) [canvas.width, canvas.height] = [a.width, a.height];
    canvases[1].getContext("2d").putImageData(difference(a, b), 0, 0);
    beside[1].hidden = !levels;
    if (levels) canvases[2].getContext("2d").putImageData(heat(levels), 0, 0);
    captions[2].textContent = `Distance evaluations of ${source?.dataset.phase}'s camera rays: black 0, white ${most}`;
    said.textContent = hint;
    show();
    figure.dataset.ready = scene.value;
  };
  const phases = () => {
    const names = pictures.filter((one) => one.dataset.scene === scene.value).map((one) => one.dataset.phase);
    for (const [one, chosen] of [[left, 0], [right, names.length - 1]]) {
      one.replaceChildren(...names.map((name) => new Option(name)));
      one.selectedIndex = chosen;
    }
    return load();
  };
  scene.append(...scenes.map((name) => new Option(name)));
  scene.addEventListener("change", phases);
  for (const one of [left, right]) one.addEventListener("change", load);
  slider.addEventListener("input", show);
  for (const canvas of canvases) for (const kind of ["pointermove", "pointerdown"]) canvas.addEventListener(kind, tell);
  phases();
}

document.querySelectorAll("figure.pictures").forEach(viewer);
