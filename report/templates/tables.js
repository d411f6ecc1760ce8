"use strict";
// Tables: a click on a column's head sorts, a text field filters.

// The number that a cell stands for: the middle of its interval, else its first number; NaN where it has none.
function valueOf(text) {
  const words = { base: 1, identical: Infinity, reference: Infinity, "∞": Infinity, "−∞": -Infinity };
  const plain = text.trim().replaceAll(",", "").replaceAll("−", "-");
  if (text.trim() in words) return words[text.trim()];
  const number = "-?\\d+(?:\\.\\d+)?(?:e[-+]?\\d+)?";
  const ends = text.replaceAll("−", "-").match(/\[(-?[\d,.]+(?:e[-+]?\d+)?),\s+(-?[\d,.]+(?:e[-+]?\d+)?)\]/);
  if (!new RegExp(`^[<>≥≤~≈+✓✗\\s]*${number}`).test(plain)) return NaN;
  if (ends) return (Number(ends[1].replaceAll(",", "")) + Number(ends[2].replaceAll(",", ""))) / 2;
  return Number(plain.match(new RegExp(number))[0]);
}

// Rows in the order of column `at`; direction 1: least first, -1: largest first. Cells without a value go last.
function ordered(rows, at, direction) {
  const text = (row) => row.cells[at].textContent.trim();
  const blank = (row) => ["", "–", "not measured"].includes(text(row));
  const keys = new Map(rows.map((row) => [row, valueOf(text(row))]));
  const filled = rows.filter((row) => !blank(row));
  const numeric = filled.filter((row) => !Number.isNaN(keys.get(row))).length > filled.length / 2;
  const last = (row) => blank(row) || (numeric && Number.isNaN(keys.get(row)));
  const compare = (a, b) =>
    numeric
      ? Math.sign(keys.get(a) - keys.get(b)) || 0
      : text(a).localeCompare(text(b), "en", { numeric: true });
  return [...rows].sort((a, b) => last(a) - last(b) || (last(a) ? 0 : direction * compare(a, b)));
}

function sortable(table, heads, rows) {
  const body = table.tBodies[0];
  heads.forEach((head, at) => {
    const about = { type: "button", className: "sort", title: "Sort by this column" };
    const button = element("button", about, ...head.childNodes);
    head.append(button);
    head.setAttribute("aria-sort", "none");
    const sort = () => {
      const now = head.getAttribute("aria-sort");
      const sorted = heads.some((other) => other.getAttribute("aria-sort") !== "none");
      if (now !== "none") body.append(...ordered(rows, at, now === "ascending" ? 1 : -1));
      else if (!sorted) body.append(...rows);
    };
    button.addEventListener("click", () => {
      const next = { none: "ascending", ascending: "descending", descending: "none" };
      const wanted = next[head.getAttribute("aria-sort")];
      heads.forEach((other) => other.setAttribute("aria-sort", "none"));
      head.setAttribute("aria-sort", wanted);
      sort();
    });
  });
}

function filterable(table, rows) {
  const field = element("input", { type: "search", placeholder: "words of a row" });
  const count = element("output");
  table.parentElement.before(element("label", { className: "tools" }, "Filter rows: ", field, " ", count));
  field.addEventListener("input", () => {
    const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
    for (const row of rows) {
      const text = [...row.cells].map((cell) => cell.textContent.toLowerCase()).join(" ");
      row.hidden = !words.every((word) => text.includes(word));
    }
    const shown = rows.filter((row) => !row.hidden).length;
    count.textContent = words.length ? `${shown} of ${rows.length} rows` : "";
  });
}

for (const table of document.querySelectorAll(".scroll > table")) {
  const heads = table.tHead ? [...table.tHead.rows[table.tHead.rows.length - 1].cells] : [];
  const rows = [...(table.tBodies[0]?.rows ?? [])];
  if (rows.length < 2 || !rows.every((row) => row.cells.length === heads.length)) continue;
  if (!table.closest(".notes")) sortable(table, heads, rows);
  if (rows.length >= 6) filterable(table, rows);
}
