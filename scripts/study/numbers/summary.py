"""One row per configuration of a run: times with intervals, and speed-ups against both bases."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from study.core import show
from study.core.cli import StudyError
from study.core.registry import BASE, arithmetic_flags, phases
from study.numbers import analysis, stats
from study.numbers.stats import Interval

SPEED = [("spec", "phase"), ("scene", "scene"), ("size", "size"), ("threads", "threads")]
SPEED += [("launches", "launches"), ("ms", "median ms [95 %]"), ("ns_per_pixel", "ns/pixel [95 %]")]
SPEED += [("tsc_cycles", "timer cycles"), ("core_cycles_per_pixel", "core cycles/pixel")]
SPEED += [("joules", "J/frame [95 %]")]
SPEED += [("speedup", f"× {BASE} [95 %]"), ("parent", "parent"), ("parent_speedup", "× parent [95 %]")]
SPEED += [("second_base", "second base"), ("second_speedup", "× second base [95 %]")]


@dataclass(frozen=True)
class Row:
    """A configuration; ratios are base / this, None where the base was not timed."""

    config: str
    spec: str
    phase: str
    scene: str
    width: int
    height: int
    threads: int
    size: str
    launches: int
    ms: Interval
    ns_per_pixel: Interval
    tsc_cycles: float
    core_cycles_per_pixel: float
    joules: Interval | None
    speedup: Interval | None
    parent: str | None
    parent_speedup: Interval | None
    second_base: str | None
    second_speedup: Interval | None


def cflags(phase: str) -> str:
    """Flags of a phase that change its arithmetic, its name where it is no longer there (an old run)."""
    return arithmetic_flags(phases()[phase].cflags) if phase in phases() else phase


def rows(frames: pd.DataFrame) -> list[Row]:
    """A base has the same scene and size, and the same threads or else one thread."""
    cells, known = analysis.cells_of(frames), phases()
    order = {name: number for number, name in enumerate(known)}
    found = analysis.by_key(cells)
    made = []
    cells.sort(key=lambda c: (c.scene, c.height, c.width, c.threads, order.get(c.phase, 99), c.spec))
    for cell in cells:

        def over(base: str | None, cell: analysis.Cell = cell) -> Interval | None:
            some = (found.get((*cell.picture, threads, base)) for threads in (cell.threads, 1))
            timed = next(filter(None, some), None)
            return cell.over(timed) if timed and base != cell.spec else None

        parent = known[cell.spec].parent if cell.spec in known else None
        second = analysis.second_base(cell, cells, known)
        other = second.spec if second and second.spec != cell.spec else None
        over_parent = over(parent)
        made.append(
            Row(
                *(cell.config, cell.spec, cell.phase, *cell.picture, cell.threads),
                size=show.size(cell.width, cell.height),
                launches=len(cell.values),
                ms=stats.median_interval(cell.values.ns / 1e6),
                ns_per_pixel=stats.median_interval(cell.values.ns / cell.pixels),
                tsc_cycles=cell.median("tsc_cycles").value,
                core_cycles_per_pixel=cell.median("core_cycles").value / cell.pixels,
                joules=cell.median("joules") if "joules" in cell.values else None,
                speedup=over(BASE),
                parent=parent if over_parent else None,
                parent_speedup=over_parent,
                second_base=other,
                second_speedup=over(other),
            )
        )
    return made


def number(value: float) -> str:
    """Four digits: 0.4663, 12.30, 1,234, 578.8M."""
    return f"{show.number(value / 1e6, 4)}M" if 1e6 <= abs(value) < np.inf else show.number(value, 4)


def cell(value: Any) -> str:
    """A table cell: intervals with their ends, numbers with four digits, nothing for None."""
    if value is None:
        return ""
    if isinstance(value, Interval):
        ends = f"[{number(value.low)}, {number(value.high)}]" if value.sufficient else "insufficient"
        return f"{number(value.value)} {ends}"
    return number(value) if isinstance(value, (float, np.floating)) else str(value)


def table(rows: Sequence[Any], columns: Sequence[tuple[str, str]]) -> str:
    """Aligned text. `columns`: pairs of key and heading; a column that is empty everywhere is left out."""
    if not rows:
        raise StudyError("nothing was measured; see the notes above")
    lists = [[heading, *(cell(show.cell(row, key)) for row in rows)] for key, heading in columns]
    lists = [cells for cells in lists if any(cells[1:])]
    widths = [max(map(len, cells)) for cells in lists]
    lines = (zip(line, widths, strict=True) for line in zip(*lists, strict=True))
    return "\n".join("  ".join(text.ljust(width) for text, width in line).rstrip() for line in lines)
