"use strict";
// The machine whose ladder is shown, and the base of all speed-ups: a choice at one place holds everywhere.

function choices(data) {
  const chosen = { machine: 0, base: data.bases[0] };
  const nameOf = (text) => text.replace(/^.*?(× |over )/, "").replace(/\s*\[.*/, "");
  const titleOf = (head) => head.querySelector("button") || head;
  const headsOf = (table) => [...table.tHead.rows[table.tHead.rows.length - 1].cells];
  const column = (table, at) => [...table.tBodies[0].rows].map((row) => row.cells[at]);

  // Columns that carry the same ratios over other bases.
  const columns = [...document.querySelectorAll("th[data-choices]")].map((head) => {
    const cells = [head, ...column(head.closest("table"), headsOf(head.closest("table")).indexOf(head))];
    const shown = cells.map((cell, i) => (i ? cell : titleOf(cell)));
    const texts = cells.map((cell, i) => [shown[i].textContent, ...JSON.parse(cell.dataset.choices || "[]")]);
    return { head, shown, texts, names: texts[0].map(nameOf) };
  });
  // A scene's main table: its cells of ms and of ratios, in the order of the data.
  const tables = [...document.querySelectorAll("#ladder table")];
  const ladders = data.scenes.map(({ scene, size }) => {
    const table = tables.find((one) => one.caption?.textContent === `${scene}, ${size}: speed and error`);
    if (!table) return null;
    const heads = headsOf(table);
    const [ms, ratio] = ["ms a frame", "× "].map((start) => heads.findIndex((one) => one.textContent.startsWith(start)));
    return { table, size, heads: [heads[ms], heads[ratio]], ms: column(table, ms), ratio: column(table, ratio) };
  });
  const cellsOf = (machine, i) => data.scenes[i].rows.map(({ key }) => machine.scenes[data.scenes[i].scene]?.cells[key]);
  // Of each base whether the machine's run states a ratio to it.
  const stated = (machine) => data.bases.map((_, which) => data.scenes.some((_, i) => cellsOf(machine, i).some((cells) => cells?.[1][which])));
  const bases = [...new Set([...data.bases.filter((_, which) => data.machines.some((one) => stated(one)[which])), ...columns.flatMap((one) => one.names)])];

  // One scene's speed-ups, or times where the machine's run states no ratio to the base.
  const panel = (machine, i) => {
    const { scene, rows } = data.scenes[i];
    const cells = cellsOf(machine, i);
    const which = data.bases.indexOf(chosen.base);
    const ratios = cells.some((one) => one?.[1][which]);
    const lines = rows.flatMap((row, k) => {
      const found = cells[k] && (ratios ? cells[k][1][which] : cells[k][0]);
      return found ? [{ ...row, text: found[0], value: found[1], low: found[2] ?? found[1], high: found[3] ?? found[1], error: cells[k][2] === "–" ? "" : `; ${cells[k][2]}` }] : [];
    });
    if (!lines.length) return `<p class="notice">${escaped(scene)}: not timed on ${escaped(machine.name)}.</p>`;
    const [wide, left, right, top, step] = [NARROW ? 380 : 620, NARROW ? 88 : 120, NARROW ? 160 : 170, 34, 22];
    const high = top + step * lines.length + 42;
    const ends = lines.flatMap((one) => [one.low, one.high]).map(Math.log10);
    const [x0, x1] = [Math.min(...ends) - 0.06, Math.max(...ends) + 0.06];
    const x = (value) => (left + ((Math.log10(value) - x0) / (x1 - x0)) * (wide - left - right)).toFixed(1);
    const title = ratios ? `speed-up over ${chosen.base}` : "ms a frame: left is faster";
    const made = [`<text x="4" y="16" font-size="13">${escaped(`${scene}, ${machine.scenes[scene].size}: ${title}`)}</text>`];
    for (const value of ticks(x0, x1)) {
      const at = x(value);
      made.push(`<path d="M${at},${top - 6}V${high - 36}" stroke="#ddd"/><text x="${at}" y="${high - 22}" text-anchor="middle">${value.toLocaleString("en")}</text>`);
    }
    lines.forEach((one, k) => {
      const y = top + step * (k + 0.5);
      const says = `${one.key.replace(/ 1$/, "").replace(/ (\d+)$/, ", $1 threads")}, ${scene}, ${machine.name}: ${one.text}${ratios ? ` over ${chosen.base}` : " ms"}${one.error && one.error.replace("; ", "; PSNR to ground truth ")}`;
      const [fill, edge] = one.hollow ? ["#fff", one.colour] : [one.colour, "#000"];
      made.push(`<g><title>${escaped(says)}</title><path d="M${x(one.low)},${y}H${x(one.high)}" stroke="${one.colour}" stroke-width="2.5"/><polygon points="${corners(SHAPES[one.marker], Number(x(one.value)), y, 6)}" fill="${fill}" stroke="${edge}"/></g>`);
      made.push(`<text x="${left - 10}" y="${y + 4}" text-anchor="end">${escaped(one.key.replace(/ 1$/, "").replace(/ (\d+)$/, "×$1"))}</text>`);
      made.push(`<text x="${wide - right + 10}" y="${y + 4}">${escaped(`${one.text.split(" ")[0]}${ratios ? "" : " ms"}${one.error}`)}</text>`);
    });
    made.push(`<text x="${(left + wide - right) / 2}" y="${high - 6}" text-anchor="middle">${ratios ? "×, " : "ms, "}logarithmic; right: PSNR to ground truth</text>`);
    return `<svg viewBox="0 0 ${wide} ${high}" font-size="11" role="img" aria-label="${escaped(`${scene}: ${title}`)}">${made.join("")}</svg>`;
  };

  const still = document.querySelector("#ladder figure");
  const chart = element("div", { className: "panels ladder-chart", hidden: true });
  const said = element("output");
  const [machines, menus] = [element("select", { ariaLabel: "Machine" }), []];
  data.machines.forEach(({ name }, i) => machines.add(new Option(i ? name : `${name} (this run)`)));

  const show = () => {
    const machine = data.machines[chosen.machine];
    for (const { shown, texts, names } of columns) {
      const which = names.indexOf(chosen.base);
      shown.forEach((cell, i) => (cell.textContent = which < 0 ? (i ? "–" : texts[0][0].replace(names[0], chosen.base)) : (texts[i][which] ?? "–")));
    }
    ladders.forEach((one, i) => {
      if (!one) return;
      const which = data.bases.indexOf(chosen.base);
      const theirs = machine.scenes[data.scenes[i].scene];
      const times = chosen.machine && theirs ? ` (times at ${theirs.size}, errors of this page's run at ${one.size})` : "";
      one.table.caption.textContent = `${data.scenes[i].scene}, ${times ? `${machine.name}: speed and error${times}` : `${one.size}: speed and error`}`;
      titleOf(one.heads[1]).textContent = `× ${chosen.base} [95\u00a0%]`;
      cellsOf(machine, i).forEach((cells, k) => {
        one.ms[k].textContent = cells?.[0]?.[0] ?? "–";
        one.ratio[k].textContent = cells?.[1][which]?.[0] ?? "–";
      });
    });
    for (const head of [...columns.map((one) => one.head), ...ladders.flatMap((one) => one?.heads ?? [])]) head.dispatchEvent(new Event("changed"));
    const drawn = chosen.machine > 0 || chosen.base !== data.bases[0];
    chart.hidden = !drawn;
    chart.innerHTML = drawn ? data.scenes.map((_, i) => panel(machine, i)).join("") : "";
    if (still) still.hidden = drawn;
    const sizes = data.scenes.filter(({ scene, size }) => machine.scenes[scene] && machine.scenes[scene].size !== size);
    const other = sizes.length ? ` Its pictures are of another size (${[...new Set(sizes.map(({ scene }) => machine.scenes[scene].size))].join(", ")}): milliseconds do not compare${stated(machine).some(Boolean) ? ", ratios do" : ""}.` : "";
    said.textContent = chosen.machine ? `Times and ratios: ${machine.about}${other} “–”: that run lacks it.` : "";
    for (const menu of menus) {
      for (const option of menu.options) {
        const which = data.bases.indexOf(option.value);
        option.text = which < 0 || stated(machine)[which] ? option.value : `${option.value} (not on this machine)`;
      }
      menu.value = chosen.base;
    }
  };
  const baseMenu = () => {
    const menu = element("select", { ariaLabel: "Base of the speed-ups" }, ...bases.map((name) => new Option(name, name)));
    menu.addEventListener("change", () => {
      chosen.base = menu.value;
      show();
    });
    menus.push(menu);
    return element("label", {}, "Base of the speed-ups: ", menu);
  };
  machines.addEventListener("change", () => {
    chosen.machine = machines.selectedIndex;
    show();
  });
  for (const { head } of columns) head.closest(".scroll").before(element("p", { className: "tools" }, baseMenu()));
  if (!still && !tables.length) return;
  const tools = element("p", { className: "tools" });
  if (data.machines.length > 1) tools.append(element("label", {}, "Machine: ", machines), " ");
  if (bases.length > 1) tools.append(baseMenu());
  (still || tables[0].closest(".scroll")).before(tools, said, chart);
}

const LADDERS = document.querySelector(".ladder-data > script");
if (LADDERS) choices(JSON.parse(LADDERS.textContent));
