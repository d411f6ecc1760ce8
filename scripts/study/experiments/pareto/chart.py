"""The chart of speed against error that answers the mouse."""

from __future__ import annotations

import math
from collections.abc import Sequence

from study.core import show
from study.experiments.pareto import tables
from study.experiments.pareto.schema import Row
from study.pictures import charts


def _decibels(row: Row, measure: str) -> float | None:
    """As the printed figure has it; None where there is none."""
    value = tables.drawn_at(row, measure)
    return float(f"{value:.6g}") if math.isfinite(value) else None


def _point(row: Row) -> charts.Point:
    how = "the scene's parameters"
    if not row.own_parameters:
        how = f"hit distance {row.hit_distance:g}, step cap {row.max_steps}"
    text = f"{show.spread(row.ns_per_pixel)}; {how}{'' if row.timed else '; launched once'}"
    about = row.scene, row.phase, float(f"{row.pace:.6g}"), text
    errors = _decibels(row, "psnr_db"), _decibels(row, "psnr_ideal_db")
    return charts.Point(*about, *errors, row.own_parameters, row.timed)


def fragment(rows: Sequence[Row]) -> str:
    """HTML; empty without points."""
    points = [one for one in map(_point, rows) if one.paper is not None or one.ideal is not None]
    return charts.speed_and_error(points) if points else ""
