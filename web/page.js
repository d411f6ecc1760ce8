// The page: two phases, each in a worker of its own, and what moves the camera. worker.js runs here too, for the
// camera, which is the window's (common/viewer/camera.c), and for the reader's messages.
"use strict";
const $ = (id) => document.getElementById(id);
const MOST_ROWS = 720,
  STILL_MS = 400,
  IMPATIENT_MS = 300,
  WHOLE_MS = 8000,
  ENOUGH = 15,
  AMPLIFY = 16,
  WHITE = 300;
const canvas = $("canvas"),
  context = canvas.getContext("2d");
const about = JSON.parse($("about").textContent);
const sides = [{ name: "baseline" }, { name: about.at(-1).name }]; // the reference, the phase
for (const side of sides)
  Object.assign(side, { canvas: document.createElement("canvas"), times: [], costs: [], key: "" });
// serial: of the view, which changes with everything that a picture depends on. moved: when it last did.
const state = {
  serial: 0,
  moved: 0,
  view: new Float64Array(),
  seconds: 0,
  paused: false,
  divider: 0.5,
  speed: 1,
  scene: null,
};
const held = new Set();
let scenes,
  last = 0;

// --- Modules and workers

async function unpack(id) {
  const bytes = Uint8Array.from(atob($(id).textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

const compiled = new Map();
function module(name) {
  if (!compiled.has(name))
    compiled.set(
      name,
      unpack(name).then((bytes) => WebAssembly.compile(bytes)),
    );
  return compiled.get(name);
}

// Starts the side's phase on the scene, in a new worker: a drawing module cannot be interrupted.
async function open(side) {
  side.worker?.terminate();
  const code = new Blob([$("worker").textContent], { type: "text/javascript" });
  const worker = new Worker(URL.createObjectURL(code));
  Object.assign(side, {
    worker,
    ready: false,
    busy: false,
    error: "",
    restart: true,
    costs: side.shown ? side.costs : [],
  });
  worker.onerror = (event) => answered(side, { error: event.message });
  worker.onmessage = ({ data }) => worker === side.worker && answered(side, data);
  const compiledModule = await module(side.name);
  if (worker !== side.worker) return;
  worker.postMessage({ module: compiledModule });
  worker.postMessage({ scene: state.scene });
}

function answered(side, data) {
  if (data.error) Object.assign(side, { error: data.error, ready: false, busy: false, shown: null });
  if (data.prepared) side.ready = true;
  if (data.drawn) {
    const { drawn } = data,
      { width, height } = drawn;
    const key = [side.name, width, height, side.request.heat].join();
    if (key !== side.key) side.times = [];
    side.key = key;
    side.times = [...side.times.slice(-59), drawn.ms];
    side.costs = [...side.costs.slice(-14), drawn.ms / (width * height)];
    side.busy = false;
    side.shown = { ...drawn, serial: side.request.serial };
    side.canvas.width = width;
    side.canvas.height = height;
    side.canvas.getContext("2d").putImageData(new ImageData(drawn.pixels, width, height), 0, 0);
    if (side === sides[0] && $("show").value === "difference") send(sides[1], { ...side.request, rows: height });
  }
  compose();
}

// --- What is drawn

const median = (list) => [...list].sort((a, b) => a - b)[list.length >> 1];
const perPixel = (side) => median(side.costs); // in ms, of the last pictures of whatever size
const paired = () =>
  sides.every(
    (side) => side.shown && side.shown.serial === sides[0].shown.serial && side.shown.height === sides[0].shown.height,
  );

function send(side, request) {
  if (!side.ready) return;
  Object.assign(side, { busy: true, since: performance.now(), request });
  side.worker.postMessage({ frame: { ...request, restart: side.restart } });
  side.restart = false;
}

// Asks a side for its next picture, unless it has drawn this view in full and often enough to know its time.
function request(side, now) {
  const still = now - state.moved > STILL_MS,
    { shown } = side;
  const current = shown && shown.serial === state.serial;
  if (side.busy && side.request.whole && side.request.serial !== state.serial && now - side.since > IMPATIENT_MS)
    open(side);
  const follows = side === sides[1] && $("show").value === "difference";
  if (!side.ready || side.busy || follows) return;
  if (sides[0].busy === false && sides[1].busy && $("show").value === "difference") return; // its pair is not yet drawn
  const full = $("resolution").value === "full",
    settled = still && current && shown.height === shown.next;
  const spent = side.times.reduce((a, b) => a + b, 0),
    known = side.times.length >= ENOUGH || spent > 1000;
  const wanted = full || !shown ? canvas.height : wholeRows(side);
  if (still && current && known && shown.height >= wanted) return;
  const whole = full || (settled && known) || (still && current && side.request.whole);
  const { serial, view, seconds } = state;
  const heat = $("heat").value ? WHITE : 0;
  send(side, {
    serial,
    view,
    seconds,
    heat,
    still,
    whole,
    rows: whole ? wanted : 0,
    most: canvas.height,
    aspect: canvas.width / canvas.height,
  });
}

// Rows of the picture of a view at rest: all, or what takes WHOLE_MS.
function wholeRows(side) {
  const rows = Math.sqrt((WHOLE_MS / perPixel(side)) * (canvas.height / canvas.width));
  return Math.max(side.shown.height, Math.min(canvas.height, Math.round(rows)));
}

function picture(side) {
  if (side.shown) context.drawImage(side.canvas, 0, 0, canvas.width, canvas.height);
}

// The difference of both pictures, amplified. Returns their PSNR in display space, in dB.
function difference() {
  const [a, b] = sides.map((side) => side.shown.pixels),
    { width, height } = sides[0].shown;
  const out = new ImageData(width, height);
  let sum = 0;
  for (let i = 0; i < a.length; i++) {
    const d = i % 4 === 3 ? 0 : Math.abs(a[i] - b[i]);
    sum += d * d;
    out.data[i] = i % 4 === 3 ? 255 : AMPLIFY * d;
  }
  difference.canvas ??= document.createElement("canvas");
  Object.assign(difference.canvas, { width, height }).getContext("2d").putImageData(out, 0, 0);
  context.drawImage(difference.canvas, 0, 0, canvas.width, canvas.height);
  return 10 * Math.log10((255 * 255 * 3 * width * height) / sum);
}

function compose() {
  const show = $("show").value,
    cut = Math.round(state.divider * canvas.width);
  context.imageSmoothingEnabled = false;
  let says = "";
  if (show === "difference" && paired()) {
    const db = difference();
    says =
      `Difference × ${AMPLIFY}. ` +
      (db < Infinity
        ? `PSNR ${db.toFixed(1)} dB between the displayed pictures.`
        : "The displayed pictures are equal.");
  } else if (show !== "difference") {
    picture(sides[1]);
    if (show === "split" && sides[0].shown) {
      context.save();
      context.beginPath();
      context.rect(0, 0, cut, canvas.height);
      context.clip();
      picture(sides[0]);
      context.restore();
    }
  }
  tell(show, says);
}

function duration(ms) {
  return ms < 1
    ? `${ms.toFixed(2)} ms`
    : ms < 99.5
      ? `${ms.toFixed(1)} ms`
      : ms < 995
        ? `${Math.round(ms)} ms`
        : `${(ms / 1000).toFixed(1)} s`;
}

function tell(show, says) {
  $("left").textContent = show === "split" ? sides[0].name : "";
  $("right").textContent = show === "difference" ? `${sides[0].name} − ${sides[1].name}` : sides[1].name;
  for (const [i, id] of ["reference", "phase"].entries()) {
    const side = sides[i],
      known = side.shown && side.times.length;
    $(`${id}-idea`).textContent = about.find(({ name }) => name === side.name)?.title ?? "";
    $(`${id}-ms`).textContent = known ? duration(median(side.times)) : "–";
    $(`${id}-says`).textContent =
      `${side.name}${known ? `, a frame of ${side.shown.width} × ${side.shown.height}` : ""}`;
  }
  const both = sides.every((side) => side.shown && side.times.length),
    ratio = both ? perPixel(sides[0]) / perPixel(sides[1]) : 0;
  const few = ratio.toFixed(ratio < 0.95 ? 2 : 1);
  $("ratio").textContent = both ? `${ratio < 9.95 ? few : Math.round(ratio).toLocaleString("en")}×` : "–";
  const same = both && sides[0].shown.height === sides[1].shown.height;
  $("ratio-says").textContent = `as fast as ${sides[0].name}${both && !same ? ", per pixel" : ""}`;
  const waits = sides.filter(
    (side, i) =>
      (i || show !== "phase") && !side.error && (!side.shown || (side.busy && side.request.rows > side.shown.height)),
  );
  const wait = (side) => {
    if (!side.shown) return `${side.name} draws its first picture.`;
    const { rows, aspect } = side.request;
    const lasts = duration(perPixel(side) * rows * rows * aspect);
    return `${side.name} draws this view at ${Math.round(rows * aspect)} × ${rows} pixels: about ${lasts}.`;
  };
  $("status").textContent = [
    says,
    ...waits.map(wait),
    ...sides.map((side) => side.error && `${side.name}: ${side.error}`),
  ]
    .filter(Boolean)
    .join(" ");
  const counts = sides.filter((side, i) => (i || show !== "phase") && side.shown?.evaluations >= 0);
  $("legend").hidden = !$("heat").value;
  $("legend").textContent =
    `Evaluations of the scene in each camera ray's march: black 0, red 6, yellow 44, white ${WHITE} and more. ` +
    // A phase that does not count says 1 for every ray.
    counts
      .map(({ name, shown: { evaluations: n } }) => (n === 1 ? `${name} does not count.` : `${name}: ${n.toFixed(1)} a ray.`))
      .join(" ");
}

// Another view, or another way to look at it.
function changed(restart) {
  state.serial++;
  state.moved = performance.now();
  for (const side of sides) side.restart ||= restart;
  const show = $("show").value;
  $("divider").hidden = show !== "split";
  $("divider").style.left = `${100 * state.divider}%`;
  $("divider").setAttribute("aria-valuenow", Math.round(100 * state.divider));
  compose();
}

function tick(now) {
  const passed = Math.min(0.1, (now - last) / 1000);
  last = now;
  walk(passed);
  if (!state.paused && wasm.web_moves()) state.seconds += passed;
  const view = new Float64Array(wasm.memory.buffer, wasm.web_look(state.seconds), 19).slice();
  if (view.some((x, i) => x !== state.view[i]) || (wasm.web_moves() & 1 && !state.paused)) {
    state.view = view;
    state.serial++;
    state.moved = now;
  }
  $("play").hidden = !wasm.web_moves();
  for (const side of sides) if (side === sides[1] || $("show").value !== "phase") request(side, now);
  requestAnimationFrame(tick);
}

// --- The scene

// Scenes are of any size: a third of the way to what one sees in a second, as in the window (the median depth of a few
// pixels). Where nothing is seen: a tenth of the way to the light.
function fittingSpeed() {
  const view = new Float64Array(wasm.memory.buffer, wasm.web_look(0), 19).slice();
  const away = Math.hypot(view[13] - view[0], view[14] - view[1], view[15] - view[2]) / 10;
  if (wasm.web_prepare() || !wasm.web_frame(9, 5, 0)) return away;
  wasm.web_draw(true);
  const depth = median(new Float32Array(wasm.memory.buffer, wasm.web_plane(1), 45));
  return depth < Infinity ? depth / 3 : away;
}

// Takes a scene's text. Returns false, with the reader's message, if it is none.
function take(text) {
  const bytes = new TextEncoder().encode(text);
  $("error").textContent = load(bytes);
  if ($("error").textContent) return false;
  state.scene = bytes;
  state.speed = fittingSpeed();
  for (const side of sides) {
    side.shown = null;
    open(side);
  }
  changed(true);
  return true;
}

function choose(name) {
  $("scene").value = name;
  $("text").value = scenes[name];
  wasm.web_home();
  state.seconds = 0;
  take(scenes[name]);
}

// --- Mouse, touch, keys

function walk(seconds) {
  const on = (code) => held.has(code),
    fast = on("ShiftLeft") || on("ShiftRight");
  const step = seconds * state.speed * (fast ? 4 : 1);
  const move = [on("KeyD") - on("KeyA"), on("PageUp") - on("PageDown"), on("KeyW") - on("KeyS")];
  if (move.some(Boolean)) wasm.web_move(...move.map((x) => x * step));
  const away = on("ArrowUp") - on("ArrowDown"),
    side = on("ArrowRight") - on("ArrowLeft"),
    { view } = state;
  const apart = Math.hypot(view[13] - view[0], view[14] - view[1], view[15] - view[2]);
  const light = seconds * Math.max(state.speed, apart / 3);
  if (away || side) wasm.web_move_light(light * side, fast ? light * away : 0, fast ? 0 : light * away);
}

function cycle(select, step) {
  select.selectedIndex = (select.selectedIndex + step + select.length) % select.length;
  select.dispatchEvent(new Event("change", { bubbles: true }));
}

const toggle = (id, value) => () => {
  $(id).value = $(id).value === value ? $(id).options[0].value : value;
  changed(true);
};
const KEYS = {
  Home: () => wasm.web_home(),
  Space: () => $("play").click(),
  KeyV: () => toggle("show", $("show").value === "split" ? "phase" : $("show").value)(),
  KeyE: toggle("heat", "1"),
  KeyR: toggle("resolution", "full"),
  KeyP: (event) => cycle($("phase"), event.shiftKey ? -1 : 1),
  Tab: (event) => cycle($("scene"), event.shiftKey ? -1 : 1),
};

addEventListener("keydown", (event) => {
  if (
    /^(TEXTAREA|SELECT|INPUT|BUTTON|SUMMARY)$/.test(event.target.tagName) ||
    event.ctrlKey ||
    event.metaKey ||
    event.altKey
  )
    return;
  const { code } = event;
  if (event.target === $("divider") && /^Arrow(Left|Right)$/.test(code)) {
    slide(state.divider + (code === "ArrowLeft" ? -0.02 : 0.02));
  } else if (code === "KeyD" && event.shiftKey) {
    toggle("show", "difference")();
  } else if (KEYS[code] && (code !== "Tab" || event.target === canvas)) {
    if (!event.repeat) KEYS[code](event);
  } else {
    held.add(code);
    if (!/^(Arrow|Page)/.test(code)) return;
  }
  event.preventDefault();
});
addEventListener("keyup", ({ code }) => held.delete(code));
addEventListener("blur", () => held.clear());

const fingers = new Map(); // pointers that are down, by their number
function spread() {
  const [a, b] = [...fingers.values()];
  return { apart: Math.hypot(a.x - b.x, a.y - b.y), x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 };
}

canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
});
canvas.addEventListener("pointermove", (event) => {
  const finger = fingers.get(event.pointerId);
  if (!finger) return;
  const before = fingers.size === 2 ? spread() : finger,
    { x, y } = before;
  fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  const box = canvas.getBoundingClientRect(),
    angle = (2 * state.view[12]) / box.height;
  if (fingers.size === 1) return wasm.web_turn(-angle * (event.clientX - x), angle * (event.clientY - y));
  if (fingers.size > 2) return;
  const after = spread(),
    step = (3 * state.speed) / box.width;
  wasm.web_move(-step * (after.x - x), step * (after.y - y), 2 * step * (after.apart - before.apart));
});
for (const name of ["pointerup", "pointercancel"])
  canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
canvas.addEventListener(
  "wheel",
  (event) => {
    if (document.activeElement !== canvas) return;
    state.speed *= event.deltaY < 0 ? 1.25 : 0.8;
    $("status").textContent = `Speed ${state.speed.toPrecision(3)} scene units a second.`;
    event.preventDefault();
  },
  { passive: false },
);

function slide(to) {
  state.divider = Math.max(0, Math.min(1, to));
  $("divider").style.left = `${100 * state.divider}%`;
  $("divider").setAttribute("aria-valuenow", Math.round(100 * state.divider));
  compose();
}
$("divider").addEventListener("pointerdown", (event) => $("divider").setPointerCapture(event.pointerId));
$("divider").addEventListener("pointermove", (event) => {
  const box = canvas.getBoundingClientRect();
  if (event.buttons) slide((event.clientX - box.left) / box.width);
});

function resize() {
  const box = canvas.getBoundingClientRect(),
    rows = Math.min(MOST_ROWS, Math.round(box.height * devicePixelRatio));
  if (rows === canvas.height || !rows) return;
  canvas.height = rows;
  canvas.width = Math.round((rows * box.width) / box.height);
  changed(true);
}

// --- Start

function fill(select, names, value) {
  select.append(...names.map((name) => new Option(name)));
  select.value = value;
}

function listen() {
  $("scene").onchange = () => choose($("scene").value);
  for (const [i, id] of ["reference", "phase"].entries())
    $(id).onchange = () => {
      Object.assign(sides[i], { name: $(id).value, shown: null });
      open(sides[i]);
      changed(true);
    };
  for (const id of ["show", "heat", "resolution"]) $(id).onchange = () => changed(true);
  $("controls").addEventListener("change", () => canvas.focus({ preventScroll: true }));
  for (const id of ["home", "play"]) $(id).addEventListener("click", () => canvas.focus({ preventScroll: true }));
  $("home").onclick = () => wasm.web_home();
  $("play").onclick = () => {
    state.paused = !state.paused;
    $("play").textContent = state.paused ? "Go on" : "Pause";
  };
  let typed;
  $("text").oninput = () => {
    clearTimeout(typed);
    typed = setTimeout(() => take($("text").value), 300);
  };
  new ResizeObserver(resize).observe(canvas);
}

async function begin() {
  scenes = JSON.parse(new TextDecoder().decode(await unpack("scenes")));
  const wanted = new URLSearchParams(location.hash.slice(1)); // #scene=…&phase=…&reference=…
  sides[0].name = wanted.get("reference") ?? sides[0].name;
  sides[1].name = wanted.get("phase") ?? sides[1].name;
  const phases = about.map(({ name }) => name);
  fill($("scene"), Object.keys(scenes), "scene0");
  fill($("reference"), phases, sides[0].name);
  fill($("phase"), phases, sides[1].name);
  await start(await module("baseline"));
  resize();
  listen();
  choose(wanted.get("scene") ?? "scene0");
  requestAnimationFrame(tick);
}

begin().catch((error) => {
  const old = "this browser is too old: Chrome 91, Firefox 113, Safari 16.4 or a later one is needed";
  $("status").textContent =
    typeof DecompressionStream === "undefined" || error instanceof WebAssembly.CompileError
      ? `It cannot start: ${old}.`
      : `It cannot start: ${error.message}`;
  throw error;
});
