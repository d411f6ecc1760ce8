// Draws one phase's pictures. Messages: {module}, a compiled WebAssembly.Module; {scene}, a scene file's bytes;
// {frame}, what to draw. Each is answered, and {error} says what went wrong.
"use strict";
let wasm; // the module's functions

function text(at) {
  const bytes = new Uint8Array(wasm.memory.buffer, at);
  return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
}

// What the module may call from outside answers 0: clocks, the environment, pinning of threads.
async function start(module) {
  const nothing = new Proxy({}, { get: (_, name) => (name === "proc_exit" ? stop : () => 0) });
  const instance = await WebAssembly.instantiate(module, { env: nothing, wasi_snapshot_preview1: nothing });
  wasm = instance.exports;
  wasm._initialize?.();
}

function stop(status) {
  throw new Error(`the module ended with status ${status}`);
}

// Reads the scene. Returns an error or "".
function load(bytes) {
  const at = wasm.web_room(bytes.length);
  if (!at) return "out of memory";
  new Uint8Array(wasm.memory.buffer, at, bytes.length).set(bytes);
  const error = wasm.web_load();
  return error ? text(error) : "";
}

// `rows`: the picture's, or 0: as many as the pace allows, of at most `most`. `heat`: 0 for colours, else the number
// of evaluations that is white.
function draw({ aspect, most, rows, restart, view, seconds, heat, still }) {
  if (restart || !draw.rows) draw.rows = wasm.web_pace_start(most);
  const height = rows || draw.rows,
    width = Math.max(1, Math.round(height * aspect));
  const at = wasm.web_frame(width, height, seconds);
  if (!at) throw new Error("out of memory");
  new Float64Array(wasm.memory.buffer, at, view.length).set(view);
  const begin = performance.now();
  const done = wasm.web_draw(heat > 0);
  const ms = performance.now() - begin;
  if (!done) throw new Error("out of memory");
  const pixels = new Uint8ClampedArray(wasm.memory.buffer, wasm.web_picture(heat), 4 * width * height).slice();
  if (!rows) draw.rows = wasm.web_pace(ms, performance.now() - begin - ms, still, true);
  return { width, height, ms, pixels, evaluations: heat ? wasm.web_evaluations() : NaN, next: draw.rows };
}

async function answer({ module, scene, frame }) {
  if (module) await start(module);
  if (scene) {
    let error = load(scene);
    const why = error ? 0 : wasm.web_prepare();
    if (why) error = text(why);
    return { prepared: !error, error };
  }
  return frame ? { drawn: draw(frame) } : { started: true };
}

if (typeof document === "undefined")
  onmessage = async ({ data }) => {
    try {
      const said = await answer(data);
      postMessage({ serial: data.serial, ...said }, said.drawn ? [said.drawn.pixels.buffer] : []);
    } catch (error) {
      postMessage({ serial: data.serial, error: String(error.message || error) });
    }
  };
