"""Times of a run for other programs: CSV, JSON, and the JSON that github-action-benchmark reads."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import pandas as pd

from study.core import cli
from study.core.registry import BASE
from study.core.store import Run
from study.numbers import analysis, stats

KINDS = ("github-action-benchmark", "csv", "json")


@dataclass(frozen=True)
class Row:
    """A configuration: ms of a frame and its time over baseline's of the same run, with the ends of 95 %
    intervals; NaN for too few launches or without baseline."""

    scene: str
    width: int
    height: int
    threads: int
    spec: str
    launches: int
    ms: float
    ms_low: float
    ms_high: float
    over_base: float
    over_base_low: float
    over_base_high: float


def rows(run: Run) -> list[Row]:
    cells = analysis.by_key(analysis.cells_of(run.frames()))
    made = []
    for key, cell in sorted(cells.items()):
        base = cells.get((*key[:-1], BASE))
        ms = stats.median_interval(cell.values.ns / 1e6)
        over = base.over(cell) if base else stats.UNKNOWN
        made.append(Row(*key, ms.launches, *ms.ends, *over.ends))
    return made


def benchmark(made: Sequence[Row], by_baseline: bool) -> list[dict[str, Any]]:
    """As the tool `customSmallerIsBetter` of github-action-benchmark reads it (its README, "Custom").

    `by_baseline`: the unit is baseline's time in the same run, which other hours and runners change least.
    """
    found = []
    for row in made:
        if by_baseline:
            value, low, high = row.over_base, row.over_base_low, row.over_base_high
        else:
            value, low, high = row.ms, row.ms_low, row.ms_high
        if value != value or (by_baseline and row.spec == BASE):
            continue
        threads = f", {row.threads} threads" if row.threads > 1 else ""
        entry = {
            "name": f"{row.spec} {row.scene} {row.width}x{row.height}{threads}",
            "unit": "of baseline's time" if by_baseline else "ms",
            "value": value,
            "extra": f"{row.launches} launches",
        }
        found.append(entry | ({"range": f"{low:.4g} to {high:.4g}"} if low == low else {}))
    return found


def text(run: Run, kind: str, by_baseline: bool) -> str:
    """All of it as the file's text. `kind`: one of KINDS."""
    made = rows(run)
    if kind == "csv":
        return pd.DataFrame(made).to_csv(index=False, lineterminator="\n")
    plain = benchmark(made, by_baseline) if kind == KINDS[0] else {"schema": 1, "rows": [*map(asdict, made)]}
    return json.dumps(cli.plain(plain), indent=1) + "\n"
