"""Times of a run for other programs: CSV, JSON, and the JSON that github-action-benchmark reads."""

from __future__ import annotations

import csv
import io
import json
import math
from typing import Any

import pandas as pd

from study.core.registry import BASE
from study.core.store import Run
from study.numbers import stats
from study.numbers.stats import Interval

KINDS = ("github-action-benchmark", "csv", "json")
KEY = ["scene", "width", "height", "threads", "spec"]


def rows(run: Run) -> list[dict[str, Any]]:
    """A configuration each: its key, launches, ms of a frame and its time over baseline's of the same run.

    `low` and `high` are the ends of 95 % intervals, None for too few launches; `over_base` likewise, and None
    without baseline.
    """
    times = stats.launch_values(run.frames(), "ns")
    groups = {key: group.set_index("round")["value"] for key, group in times.groupby(KEY)}
    made = []
    for (*where, spec), ns in groups.items():
        base = groups.get((*where, BASE))
        over = None if base is None else stats.ratio_interval(ns, base)
        row = dict(zip(KEY, (*where, spec), strict=True)) | {"launches": len(ns)}
        made.append(row | _ends("ms", stats.median_interval(ns / 1e6)) | _ends("over_base", over))
    return made


def _ends(name: str, found: Interval | None) -> dict[str, float | None]:
    values = [math.nan] * 3 if found is None else [found.value, found.low, found.high]
    known = [value if math.isfinite(value) else None for value in values]
    return dict(zip((name, f"{name}_low", f"{name}_high"), known, strict=True))


def benchmark(made: list[dict[str, Any]], by_baseline: bool) -> list[dict[str, Any]]:
    """As the tool `customSmallerIsBetter` of github-action-benchmark reads it (its README, "Custom").

    `by_baseline`: the unit is baseline's time in the same run, which other hours and runners change least.
    """
    key, unit = ("over_base", "of baseline's time") if by_baseline else ("ms", "ms")
    found = []
    for row in made:
        if row[key] is None or (by_baseline and row["spec"] == BASE):
            continue
        threads = f", {row['threads']} threads" if row["threads"] > 1 else ""
        entry = {
            "name": f"{row['spec']} {row['scene']} {row['width']}x{row['height']}{threads}",
            "unit": unit,
            "value": row[key],
            "extra": f"{row['launches']} launches",
        }
        if row[f"{key}_low"] is not None:
            entry["range"] = f"{row[f'{key}_low']:.4g} to {row[f'{key}_high']:.4g}"
        found.append(entry)
    return found


def text(run: Run, kind: str, by_baseline: bool) -> str:
    """All of it as the file's text. `kind`: one of KINDS."""
    made = rows(run)
    if kind == "github-action-benchmark":
        return json.dumps(benchmark(made, by_baseline), indent=1) + "\n"
    if kind == "json":
        return json.dumps({"schema": 1, "rows": made}, indent=1) + "\n"
    out = io.StringIO()
    table = pd.DataFrame(made)
    table.to_csv(out, index=False, quoting=csv.QUOTE_MINIMAL, lineterminator="\n")
    return out.getvalue()
