"""The ceilings of a machine as tables, a column per kernel."""

from __future__ import annotations

import math
from typing import Any

import msgspec

from study.bounds.ceilings import KINDS, TOGETHER, Ceilings
from study.bounds.roof_shares import ELEMENT
from study.core.show import NOTHING, Column, cell, number, percent, plain, whole, word


def _best(name: str) -> Column:
    def text(line: dict[str, Any]) -> str:
        found = line.get(name) or {}
        value, median = (number(found.get(key), 4) for key in ("value", "median"))
        return f"{value} ({median})" if found.get("value") else NOTHING

    return Column("best (median)", name, text)


COMPUTE = [
    Column("", "precision", word("precision")),
    Column("", "width", word("width")),
    Column("fma by the ports", "flop/core cycle", plain("peak", 4)),
    Column("fma by the ports", "measured of it", lambda line: percent(cell(line, "of_peak"))),
    *[_best(name) for name in (*KINDS, *TOGETHER)],
]
BANDWIDTH = [
    Column("", "level", word("level")),
    Column("", "working set, KiB", whole("kib")),
    Column("", "width", word("width")),
    *[_best(name) for name in ("load", "store", "copy")],
]


def grid(limits: Ceilings, by: str) -> list[dict[str, Any]]:
    """A row per precision or level (`by`) and width; in each ceiling's column what its file says of it."""
    lines: dict[tuple[str, int], dict[str, Any]] = {}
    for one in limits.ceilings:
        if (group := getattr(one, by)) is None:
            continue
        scalar = " (scalar)" if one.bits == ELEMENT[one.precision or "double"] else ""
        line = lines.setdefault((group, one.bits), {by: group, "width": f"{one.bits} bits{scalar}"})
        line |= {one.name: msgspec.to_builtins(one)}
        if one.working_set_bytes is not None:
            line |= {"kib": one.working_set_bytes / 1024 or math.nan}
        if one.name == "fma":
            peak = limits.peak(one)
            line |= {"peak": peak, "of_peak": (one.value or math.nan) / peak}
    return list(lines.values())
