"""Times of a run as github-action-benchmark reads them."""

import json
from typing import Any

from study.core import cli
from study.core.registry import BASE
from study.core.store import Run
from study.numbers import analysis, stats

KINDS = ("github-action-benchmark",)


def benchmark(run: Run, by_baseline: bool) -> list[dict[str, Any]]:
    """As the tool `customSmallerIsBetter` of github-action-benchmark reads it (its README, "Custom").

    `by_baseline`: the unit is baseline's time in the same run, which other hours and runners change least.
    """
    cells, found = analysis.by_key(analysis.cells_of(run.frames())), []
    for (scene, width, height, threads, spec), cell in sorted(cells.items()):
        base, time = (
            cells.get((scene, width, height, threads, BASE)),
            stats.median_interval(cell.values.ns / 1e6),
        )
        if by_baseline and (base is None or spec == BASE):
            continue
        shown = base.over(cell) if by_baseline and base else time
        entry = {
            "name": f"{spec} {scene} {width}x{height}" + (f", {threads} threads" if threads > 1 else ""),
            "unit": "of baseline's time" if by_baseline else "ms",
            "value": shown.value,
            "extra": f"{time.launches} launches",
        }
        if shown.sufficient:
            entry["range"] = f"{shown.low:.4g} to {shown.high:.4g}"
        found.append(entry)
    return found


def text(run: Run, by_baseline: bool) -> str:
    return json.dumps(cli.plain(benchmark(run, by_baseline)), indent=1) + "\n"
