"""The points of the chart that answers the pointer (report/templates/pareto.js), as JSON inside the page."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

import pandas as pd

from study.experiments.pareto import fronts, tables
from study.experiments.pareto.schema import TRUTHS, Row
from study.pictures.draw import look, shape


def _height(row: Row, measure: str) -> float | None:
    """As the still figure has it, to six digits; None where there is none."""
    value = tables.drawn_at(row, measure)
    return float(f"{value:.6g}") if math.isfinite(value) else None


def _digits(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.6g}")


def _point(row: Row, scenes: list[str], phases: list[str], measures: list[str]) -> list[Any]:
    """Scene, phase, ns/pixel, its interval or null, hit distance, step cap, whether by the scene's own
    parameters, whether launched once, then an error a measure."""
    low, high = row.ends or (None, None)
    return [
        scenes.index(row.scene),
        phases.index(row.phase),
        *map(_digits, (row.pace, low, high)),
        row.hit_distance,
        row.max_steps,
        int(row.own_parameters),
        int(not row.timed),
        *(_height(row, measure) for measure in measures),
    ]


def looks(phases: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Colour and marker of each program, those of the still figures; a switch is hollow."""
    frame = pd.DataFrame([{"phase": name.partition("+")[0], "threads": 1} for name in phases])
    found = look(frame)
    made = {}
    for name in phases:
        made[name] = shape(found[name.partition("+")[0], 1]) | {"hollow": "+" in name}
    return made


def points(rows: Sequence[Row]) -> dict[str, Any]:
    """All that the chart needs: names, looks, and an array a point."""
    scenes, phases = (list(dict.fromkeys(getattr(row, key) for row in rows)) for key in ("scene", "phase"))
    measures = []
    for name in fronts.MEASURES:
        if any(_height(row, name) is not None for row in rows):
            measures.append(name)
    about = []
    for name in measures:
        title, unit = fronts.MEASURES[name]
        errors = [error for row in rows if (error := _height(row, name)) is not None and error > 0]
        decibels = name in TRUTHS
        about.append({"name": title, "unit": unit, "decibels": decibels})
        about[-1]["least"] = min(errors, default=1.0)
    made = [_point(row, scenes, phases, measures) for row in rows]
    return {
        **{"scenes": scenes, "phases": phases, "measures": about, "looks": looks(phases)},
        **{"top": tables.TOP, "rows": made},
    }


def fragment(rows: Sequence[Row]) -> str:
    """HTML: the points, and a place for the chart that stays hidden without scripts. Empty without points."""
    found = points(rows)
    if not found["measures"]:
        return ""
    text = json.dumps(found, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    text = text.replace("<", "\\u003c")
    return f'<div class="pareto-chart" hidden><script type="application/json">{text}</script></div>'
