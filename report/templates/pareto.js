"use strict";
// Speed against error: phases and scenes to choose, an error to choose, zoom, and what a mark says.

const [WIDE, HIGH, LEFT, RIGHT, TOP, BOTTOM] = [NARROW ? 380 : 560, NARROW ? 320 : 400, 74, 24, 28, 44]; // of a panel and its margins

function chart(place) {
  const data = JSON.parse(place.querySelector("script").textContent);
  const points = data.rows.map(([scene, phase, ns, low, high, hit, steps, own, once, ...errors]) => ({
    ...{ scene: data.scenes[scene], phase: data.phases[phase], ns, low, high, hit, steps, own, once, errors },
  }));
  let measure = 0;
  let view = null; // of the axes: [left, right, bottom, top], as drawn
  const off = new Set(data.scenes.slice(2));
  const hidden = new Set();
  // Up is nearer: decibels as they are, other errors as minus their logarithm, zero as a tenth of the least.
  const up = (point) => {
    const error = point.errors[measure];
    if (error === null || data.measures[measure].decibels) return error;
    return -Math.log10(error || data.measures[measure].least / 10);
  };
  const across = (point) => Math.log10(point.ns);
  const drawable = () => points.filter((one) => up(one) !== null && one.ns > 0 && !(data.measures[measure].decibels && up(one) <= 0));
  const whole = () => {
    const some = drawable();
    const [xs, ys] = [some.map(across), some.map(up)];
    const room = 0.05 * (Math.max(...ys) - Math.min(...ys)) || 1;
    return [Math.min(...xs) - 0.1, Math.max(...xs) + 0.1, Math.min(...ys) - room, Math.max(...ys) + room];
  };
  const says = (one) => {
    const { name, unit } = data.measures[measure];
    const ends = one.low === null ? "" : ` [${one.low.toPrecision(4)}, ${one.high.toPrecision(4)}]`;
    const how = one.own ? "the scene's parameters" : `hit distance ${one.hit}, step cap ${one.steps}`;
    const top = data.measures[measure].decibels && one.errors[measure] >= data.top ? "at least " : "";
    return `${one.scene}, ${one.phase}: ${Number(one.ns.toPrecision(4))}${ends} ns/pixel; ${name} ${top}${Number(one.errors[measure].toPrecision(4))} ${unit}; ${how}${one.once ? "; launched once" : ""}`;
  };

  const panel = (scene) => {
    const [x0, x1, y0, y1] = view;
    const x = (value) => LEFT + ((value - x0) / (x1 - x0)) * (WIDE - LEFT - RIGHT);
    const y = (value) => HIGH - BOTTOM - ((value - y0) / (y1 - y0)) * (HIGH - TOP - BOTTOM);
    const { decibels, name, unit, least } = data.measures[measure];
    const lines = [];
    for (const value of ticks(x0, x1)) {
      const at = x(Math.log10(value));
      lines.push(`<path d="M${at},${TOP}V${HIGH - BOTTOM}" stroke="#ddd"/><text x="${at}" y="${HIGH - BOTTOM + 15}" text-anchor="middle">${value.toLocaleString("en")}</text>`);
    }
    const zero = !decibels && points.some((one) => one.errors[measure] === 0) ? [0] : [];
    const level = (value) => y(decibels ? value : -Math.log10(value || least / 10));
    const levels = decibels ? linear(y0, y1) : [...ticks(Math.max(-y1, Math.log10(least)), -y0), ...zero];
    for (const value of levels) {
      const at = level(value);
      if (at < TOP || at > HIGH - BOTTOM) continue;
      const text = decibels || !value || value >= 0.01 ? Number(value.toPrecision(3)).toLocaleString("en") : value.toExponential(0);
      lines.push(`<path d="M${LEFT},${at}H${WIDE - RIGHT}" stroke="#ddd"/><text x="${LEFT - 5}" y="${at + 4}" text-anchor="end">${text}</text>`);
    }
    const mine = drawable().filter((one) => one.scene === scene && !hidden.has(one.phase));
    let path = "";
    let best = -Infinity;
    for (const one of mine.filter((each) => !each.once).sort((a, b) => a.ns - b.ns || up(b) - up(a))) {
      if (up(one) <= best) continue;
      path += path ? `H${x(across(one))}V${y(up(one))}` : `M${x(across(one))},${y(up(one))}`;
      best = up(one);
    }
    const [w, h] = [WIDE - LEFT - RIGHT, HIGH - TOP - BOTTOM]; // an inner svg cuts off what is outside of it
    lines.push(`<svg x="${LEFT}" y="${TOP}" width="${w}" height="${h}" viewBox="${LEFT} ${TOP} ${w} ${h}">`);
    lines.push(`<path d="${path}" fill="none" stroke="#555" stroke-width="1.3"/>`);
    for (const one of [...mine].sort((a, b) => a.own - b.own)) {
      const look = data.looks[one.phase];
      const shape = one.own ? SHAPES[look.marker] : SHAPES.o;
      const fill = one.own && look.hollow ? "#fff" : look.colour;
      const edge = one.own ? (look.hollow ? look.colour : "#000") : "none";
      lines.push(`<polygon points="${corners(shape, x(across(one)), y(up(one)), one.own ? 6.5 : 3)}" fill="${fill}" stroke="${edge}" opacity="${one.once && !one.own ? 0.35 : 1}" data-at="${points.indexOf(one)}"><title>${escaped(says(one))}</title></polygon>`);
    }
    if (!mine.length) lines.push(`<text x="${LEFT + 10}" y="${TOP + 20}">Nothing here. “Show all” ends a zoom; else no phase is chosen, or this error was not measured.</text>`);
    lines.push(`</svg><text x="${LEFT}" y="17" font-size="14">${escaped(scene)}</text><text x="${WIDE - RIGHT}" y="${HIGH - 8}" text-anchor="end">time, ns per pixel</text>`);
    lines.push(`<text transform="translate(13 ${(HIGH - BOTTOM + TOP) / 2}) rotate(-90)" text-anchor="middle">${escaped(`${name}, ${unit}`)}</text>`);
    return `<svg viewBox="0 0 ${WIDE} ${HIGH}" font-size="12" role="img" aria-label="${escaped(scene)}: ${mine.length} points">${lines.join("")}</svg>`;
  };

  const panels = element("div", { className: "panels" });
  const said = element("output");
  const redraw = () => {
    said.textContent = "Point at a mark for its numbers. Drag over a part of a panel to zoom into all of them.";
    panels.innerHTML = data.scenes.filter((scene) => !off.has(scene)).map(panel).join("");
  };
  const zoom = (factor) => {
    const [x0, x1, y0, y1] = view;
    const [x, y, w, h] = [(x0 + x1) / 2, (y0 + y1) / 2, ((x1 - x0) * factor) / 2, ((y1 - y0) * factor) / 2];
    view = [x - w, x + w, y - h, y + h];
    redraw();
  };
  const reset = () => {
    view = whole();
    redraw();
  };
  const move = (dx, dy) => {
    const [w, h] = [dx * (view[1] - view[0]), dy * (view[3] - view[2])];
    view = [view[0] + w, view[1] + w, view[2] + h, view[3] + h];
    redraw();
  };
  // The axes' values under the pointer.
  const valueAt = (svg, event) => {
    const box = svg.getBoundingClientRect();
    const x = (((event.clientX - box.left) / box.width) * WIDE - LEFT) / (WIDE - LEFT - RIGHT);
    const y = (HIGH - BOTTOM - ((event.clientY - box.top) / box.height) * HIGH) / (HIGH - TOP - BOTTOM);
    return [view[0] + x * (view[1] - view[0]), view[2] + y * (view[3] - view[2])];
  };
  let from = null;
  panels.addEventListener("pointerdown", (event) => {
    const svg = event.target.closest(".panels > svg");
    if (svg && event.pointerType === "mouse") from = { svg, start: valueAt(svg, event), x: event.clientX, y: event.clientY };
    if (event.target.dataset.at) said.textContent = says(points[event.target.dataset.at]);
  });
  panels.addEventListener("pointerover", (event) => {
    if (event.target.dataset.at) said.textContent = says(points[event.target.dataset.at]);
  });
  window.addEventListener("pointerup", (event) => {
    if (!from) return;
    const [a, b, far] = [from.start, valueAt(from.svg, event), Math.hypot(event.clientX - from.x, event.clientY - from.y)];
    from = null;
    if (far < 8) return;
    const sorted = [0, 1].flatMap((i) => [Math.min(a[i], b[i]), Math.max(a[i], b[i])]);
    if (sorted[1] - sorted[0] > 1e-3 && sorted[3] - sorted[2] > 1e-3) view = sorted;
    redraw();
  });
  panels.tabIndex = 0;
  panels.setAttribute("aria-label", "Speed against error: arrow keys move, + and - zoom, 0 shows all");
  panels.addEventListener("keydown", (event) => {
    const keys = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
    if (event.key in keys) move(...keys[event.key]);
    else if (event.key === "+") zoom(0.7);
    else if (event.key === "-") zoom(1 / 0.7);
    else if (event.key === "0") reset();
    else return;
    event.preventDefault();
  });

  const boxes = (title, names, set) => {
    const made = element("fieldset", {}, element("legend", { textContent: title }));
    const inputs = names.map((name) => element("input", { type: "checkbox", value: name, checked: !set.has(name) }));
    inputs.forEach((input) => {
      input.addEventListener("change", () => {
        set[input.checked ? "delete" : "add"](input.value);
        redraw();
      });
      const look = data.looks[input.value];
      const shape = look && `<svg viewBox="0 0 16 16" width="16" height="16"><polygon points="${corners(SHAPES[look.marker], 8, 8, 6.5)}" fill="${look.hollow ? "#fff" : look.colour}" stroke="${look.hollow ? look.colour : "#888"}"/></svg>`;
      const label = element("label", {}, input);
      if (shape) label.insertAdjacentHTML("beforeend", shape);
      label.append(` ${input.value}`);
      made.append(label, " ");
    });
    const all = (checked) => () => inputs.filter((one) => one.checked !== checked).forEach((one) => one.click());
    for (const [text, checked] of [["all", true], ["none", false]])
      made.append(element("button", { type: "button", textContent: text, onclick: all(checked) }), " ");
    return made;
  };
  const menu = element("select", { ariaLabel: "Error on the vertical axis" }, ...data.measures.map((one) => new Option(one.name)));
  menu.addEventListener("change", () => {
    measure = menu.selectedIndex;
    reset();
  });
  const buttons = [["Zoom in", () => zoom(0.7)], ["Zoom out", () => zoom(1 / 0.7)], ["Show all", reset]];
  place.append(
    element("p", { className: "tools" }, "Error: ", menu, " ", ...buttons.flatMap(([textContent, onclick]) => [element("button", { type: "button", textContent, onclick }), " "])),
    boxes("Scenes", data.scenes, off),
    boxes("Phases", data.phases, hidden),
    said,
    panels,
    element("p", { className: "small", textContent: "Left is faster, up is nearer to the ground truth. Large marks have the scene's own hit distance and step cap; hollow ones an approximated root. Dots have other settings; faint ones were launched once. The line is the front of the phases shown: nothing is both faster and nearer." }),
  );
  place.hidden = false;
  reset();
}

document.querySelectorAll(".pareto-chart").forEach((place) => {
  const still = place.closest("section").querySelector("figure");
  const details = element("details", {}, element("summary", { textContent: "The same figure, without choices" }));
  still?.before(place, details);
  if (still) details.append(still);
  chart(place);
});
