// What test_try_page.py does with the page, one after another; what it sees goes to the test's server as /NAME.
"use strict";
const failed = [];
addEventListener("error", (event) => failed.push(event.message));
addEventListener("unhandledrejection", (event) => failed.push(String(event.reason)));
console.error = (...all) => failed.push(all.join(" "));
const post = (name, body) => fetch("http://127.0.0.1:PORT/" + name, { method: "POST", mode: "no-cors", body });
const wait = (ms) => new Promise((done) => setTimeout(done, ms));
const until = async (is) => {
  for (let i = 0; i < 1200; i++)
    if (is()) return;
    else await wait(50);
  throw Error("never came: " + is);
};
const change = (id, value) => {
  $(id).value = value;
  $(id).dispatchEvent(new Event("change", { bubbles: true }));
};
const point = (kind, x, y, pointerId = 1, target = canvas) => {
  const box = canvas.getBoundingClientRect(),
    at = { clientX: box.left + x * box.width, clientY: box.top + y * box.height };
  target.dispatchEvent(new PointerEvent(kind, { ...at, pointerId, buttons: 1, bubbles: true }));
};
const key = (kind, code, more) => canvas.dispatchEvent(new KeyboardEvent(kind, { code, bubbles: true, ...more }));
const drawn = () => sides.every((side) => side.shown?.serial === state.serial);
const where = () => [...state.view];
const frames = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
const hold = async (code) => {
  const { serial } = state;
  key("keydown", code);
  await until(() => state.serial !== serial);
  key("keyup", code);
};
HTMLElement.prototype.setPointerCapture = () => {};

async function use() {
  const said = {};
  await until(() => sides[1].shown);
  said.first = performance.now();
  await until(drawn);
  said.overflow = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  said.wide = ["stage", "controls"].map((id) => $(id).getBoundingClientRect().right);
  said.figures = $("figures").textContent;
  said.cut = [...document.querySelectorAll("select")].flatMap((select) => {
    const style = getComputedStyle(select),
      pen = document.createElement("canvas").getContext("2d"),
      room = select.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight) - 24; // the arrow
    pen.font = style.font;
    return [...select.options].map(({ text }) => text).filter((text) => pen.measureText(text).width > room);
  });
  const views = (said.views = { start: where() });
  for (const [kind, x] of [
    ["pointerdown", 0.5],
    ["pointermove", 0.6],
    ["pointerup", 0.6],
  ])
    point(kind, x, 0.5);
  await frames();
  views.turned = where();
  await hold("KeyW");
  await frames();
  views.walked = where();
  point("pointerdown", 0.4, 0.5, 1);
  point("pointerdown", 0.6, 0.5, 2);
  point("pointermove", 0.8, 0.5, 2);
  point("pointerup", 0.4, 0.5, 1);
  point("pointerup", 0.8, 0.5, 2);
  await frames();
  views.pinched = where();
  await hold("ArrowRight");
  await frames();
  views.lit = where();
  $("home").focus();
  $("home").click();
  said.focused = document.activeElement === canvas; // or keys would go to the button
  await frames();
  views.home = where();
  point("pointerdown", 0.5, 0.5, 1, $("divider"));
  point("pointermove", 0.25, 0.5, 1, $("divider"));
  said.divider = $("divider").style.left;
  change("reference", "opt6_wide");
  key("keydown", "KeyD", { shiftKey: true });
  await until(() => drawn() && paired() && $("status").textContent.startsWith("Difference"));
  said.difference = [...context.getImageData(0, 0, canvas.width, canvas.height).data].filter(
    (x, i) => i % 4 < 3 && x > 0,
  ).length;
  said.db = $("status").textContent;
  key("keydown", "KeyV");
  said.beside = $("show").value;
  key("keydown", "KeyD", { shiftKey: true });
  change("reference", "opt1");
  change("phase", "opt2");
  key("keydown", "KeyE");
  await until(() => drawn() && sides.every((side) => side.shown.evaluations > 0));
  said.evaluations = sides.map((side) => side.shown.evaluations);
  change("phase", "opt9_convex");
  await until(() => drawn() && paired());
  said.uncounted = $("legend").textContent;
  change("show", "split");
  change("heat", "");
  said.errors = BROKEN.map((text) => (take(text), $("error").textContent));
  $("text").value = scenes.scene0.replace(/"background": [^]*?\]/, '"background": [0, 1, 0]');
  $("text").dispatchEvent(new Event("input"));
  await wait(400);
  await until(drawn);
  said.sky = [...sides[1].shown.pixels.slice(0, 4)];
  said.error = $("error").textContent;
  choose("flythrough");
  const { seconds } = state;
  await wait(300);
  said.flies = state.seconds > seconds && !$("play").hidden;
  await until(() => sides.every((side) => side.shown));
  failed.push(...sides.map((side) => side.error).filter(Boolean));
  sides.forEach((side) => side.worker.terminate());
  for (const [name, scene] of DRAWN) {
    await start(await module(name));
    load(new TextEncoder().encode(scenes[scene]));
    wasm.web_prepare();
    wasm.web_look(0);
    wasm.web_frame(WIDTH, HEIGHT, 0);
    wasm.web_draw(true);
    const n = WIDTH * HEIGHT;
    const plane = (k, i) => new Float32Array(wasm.memory.buffer, wasm.web_plane(i), k * n).slice();
    await post(`${name}-${scene}`, new Blob([3, 1, 1, 3, 1].map(plane)));
  }
  return said;
}
use()
  .catch((error) => ({ stopped: String(error.stack) }))
  .then((said) => post("done", JSON.stringify({ ...said, failed })));
