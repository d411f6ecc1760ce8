"""Rows as tables for people: cells as text, tables as Markdown."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from study.core.cli import StudyError

NOTHING = "–"
LONG = ["in its words", "in words", "why", "what", "without the idea", "added or removed"]
LONG += ["to test it", "here"]
MOST_DB = 150  # of a PSNR: floats in [0, 1] are rounded at 2^-25 of themselves, 150 dB
Row = Any  # of a table: a mapping, or a record with these attributes


def cell(row: Row, name: str) -> Any:
    """A row's value of that name; None without it."""
    return row.get(name) if hasattr(row, "get") else getattr(row, name, None)


def cells(row: Row) -> Mapping[str, Any]:
    if hasattr(row, "__struct_fields__"):
        return {name: getattr(row, name) for name in row.__struct_fields__}
    return row if isinstance(row, Mapping) else vars(row)


def gone(value: Any) -> bool:
    """Whether there is none: None, NaN or pandas's NA."""
    return value is None or bool(pd.isna(value))


def yes(value: Any) -> bool:
    """Whether a cell is true: Python's or NumPy's, not None and not NaN."""
    return not gone(value) and bool(value)


@dataclass(frozen=True)
class Column:
    """`group` spans neighbours with the same group; `mark` says whether a cell is "good" or "bad"."""

    group: str
    name: str
    text: Callable[[Row], str]
    mark: Callable[[Row], str] = lambda row: ""

    @property
    def wraps(self) -> bool:
        """Whether its cells may break into lines: intervals and words, never plain numbers."""
        return "[95" in self.name or self.name in ("tolerance", "flags", "implementations")

    @property
    def long(self) -> bool:
        return self.name in LONG


def number(value: Any, digits: int = 3) -> str:
    """Significant digits, never fewer than those before the point; – for none, ∞ for infinity."""
    if isinstance(value, str):
        return value
    if gone(value):
        return NOTHING
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if 0 < abs(value) < 1e-3:
        return f"{value:.{digits - 1}e}"
    return f"{value:,.{_places(value, digits)}f}"


def _places(value: float, digits: int) -> int:
    return max(digits - 1 - math.floor(math.log10(abs(value))), 0) if value else 0


def interval(row: Row, name: str, digits: int = 4, unit: str = "") -> str:
    """`12.3 [12.1, 12.6]`, or the value and "insufficient" when the launches were too few."""
    return _interval(*(cell(row, key) for key in (name, f"{name}_low", f"{name}_high")), digits, unit)


def _interval(value: Any, low: Any, high: Any, digits: int, unit: str) -> str:
    """A line may break before the brackets only."""
    if gone(value):
        return "not measured"
    places = _places(value, digits)
    ends = "insufficient" if gone(low) else f"[{low:,.{places}f},\u00a0{high:,.{places}f}]"
    return f"{value:,.{places}f}{unit} {ends}"


def spread(found: Any, digits: int = 3, unit: str = "") -> str:
    """`12.3× [12.1, 12.6]` of an Interval, or of one as files have it (null for NaN); – for None."""
    if found is None:
        return NOTHING
    value, low, high = (cell(found, name) for name in ("value", "low", "high"))
    return _interval(value, low, high, digits, unit)


def spread_of(name: str, unit: str = "", digits: int = 3) -> Callable[[Row], str]:
    return lambda row: spread(cell(row, name), digits, unit)


def speedup(name: str, base: str) -> Callable[[Row], str]:
    """Text of a speed-up; the base itself has none."""

    def text(row: Row) -> str:
        is_base = (cell(row, base), cell(row, "threads")) == (cell(row, "phase"), 1)
        return "base" if is_base else interval(row, name, 3, "×")

    return text


def times(value: Any) -> str:
    """A speed-up as somebody printed it: no digits are added."""
    return NOTHING if gone(value) else f"{value:.3g}×"


def percent(value: Any) -> str:
    return NOTHING if gone(value) else f"{float(number(100 * value).replace(',', '')):.10g}\u00a0%"


def share(value: Any) -> str:
    """A percentage near 100, where the digits that count are the last ones."""
    if gone(value):
        return NOTHING
    texts = (f"{100 * value:.{digits}g}" for digits in range(5, 18))
    text = next(text for text in texts if value >= 1 or float(text) < 100)  # only all of it is 100 %
    return f"{text}\u00a0%"


def psnr(row: Row, name: str) -> str:
    if yes(cell(row, "is_reference")):
        return "reference"
    value = cell(row, name)
    if gone(value):
        return NOTHING
    if value > MOST_DB and not (math.isinf(value) and yes(cell(row, "identical"))):
        return f"> {MOST_DB}"
    return "identical" if math.isinf(value) else number(value)


def decibels(text: str) -> str:
    """A PSNR's cell in a sentence: `60.9 (4×4 means)` is `60.9 dB (4×4 means)`; words stay words."""
    value, bracket, means = text.partition(" (")
    return f"{value} dB{bracket}{means}" if value[:1].isdigit() else text


def gate(row: Row) -> str:
    """The gate in words and a sign, so that colour is not needed to tell."""
    if yes(cell(row, "is_reference")):
        return "reference"
    within = cell(row, "within_tolerance")
    if gone(within):
        return "by ground truth alone" if isinstance(cell(row, "left_to"), str) else "not verified"
    if within:
        return "✓ within"
    failed = cell(row, "failed") or "no reason recorded"
    return f"✗ OUTSIDE: {'none declared' if failed == 'tolerance' else failed}"


def gate_at(row: Row) -> str:
    """The gate with the height of the pictures, where it is not the row's."""
    height, text = cell(row, "error_height"), gate(row)
    same = gone(height) or height == cell(row, "height") or not gate_mark(row)
    return text if same else f"{text} (at n = {height:.0f})"


def gate_mark(row: Row) -> str:
    return {"✓": "good", "✗": "bad"}.get(gate(row)[0], "")


def rerun(row: Row) -> str:
    """The authors' own program: never its speed without its error."""
    speed, error = cell(row, "rerun"), cell(row, "rerun_psnr_display_db")
    if gone(speed) or cell(row, "phase") == "baseline" or gone(error):
        return times(speed)
    return f"{times(speed)} ({'identical' if math.isinf(error) else number(error) + ' dB'})"


def plain(name: str, digits: int = 3, scale: float = 1) -> Callable[[Row], str]:
    def text(row: Row) -> str:
        value = cell(row, name)
        return number(value / scale if isinstance(value, int | float) and scale != 1 else value, digits)

    return text


def word(name: str) -> Callable[[Row], str]:
    return lambda row: NOTHING if gone(value := cell(row, name)) else str(value)


def whole(name: str) -> Callable[[Row], str]:
    return lambda row: NOTHING if gone(value := cell(row, name)) else f"{value:.0f}"


def size(width: int, height: int) -> str:
    """`1280x720`; nothing for what is no picture (measuring.programs)."""
    return "" if width == height == 1 else f"{width}x{height}"


def picture(row: Row) -> str:
    """The scene with the size of its picture in pixels: `scene0, 1280×720`."""
    return f"{cell(row, 'scene')}, {cell(row, 'width')}×{cell(row, 'height') or cell(row, 'n')}"


@dataclass(frozen=True)
class Table:
    columns: list[Column]
    cells: list[list[tuple[str, str]]]  # text, mark

    @property
    def groups(self) -> list[tuple[str, int]]:
        """Neighbouring columns of one group: its name and how many it spans."""
        spans: list[tuple[str, int]] = []
        for column in self.columns:
            if spans and spans[-1][0] == column.group and column.group:
                spans[-1] = (column.group, spans[-1][1] + 1)
            else:
                spans.append((column.group, 1))
        return spans


def table(rows: Sequence[Row], columns: Sequence[Column]) -> Table:
    """The cells, without the columns that would be empty in every row."""
    texts = [[column.text(row) for row in rows] for column in columns]
    empty = (NOTHING, "reference")
    kept = [i for i, column in enumerate(texts) if i == 0 or any(text not in empty for text in column)]
    cells = [[(texts[i][n], columns[i].mark(row)) for i in kept] for n, row in enumerate(rows)]
    return Table([columns[i] for i in kept], cells)


def inert(text: str) -> str:
    """`text` for a cell of a Markdown table: one line, which ends no cell."""
    return " ".join(text.splitlines()).replace("|", "\\|")


def markdown(made: Table) -> str:
    """A Markdown table. A column's group goes before its name."""
    heads = [f"{c.group}: {c.name}" if c.group else c.name for c in made.columns]
    lines = [heads, ["---"] * len(heads), *[[text for text, _ in row] for row in made.cells]]
    return "".join("| " + " | ".join(map(inert, line)) + " |\n" for line in lines)


def between(text: str, begin: str, end: str, block: str) -> str:
    """The text with `block` in place of what is between the two marks. Raises StudyError without them."""
    before, found, rest = text.partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise StudyError(f"the page lacks the lines {begin} and {end}, between which a table goes")
    return f"{before}{begin}\n{block}{end}{after}"
