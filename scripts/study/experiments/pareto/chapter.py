"""The chapter of speed against error to ground truth, and its chart that answers the mouse."""

import math
from collections.abc import Sequence
from pathlib import Path

from study.core import show
from study.experiments.pareto import fronts, tables
from study.experiments.pareto.schema import FILE, Pareto, Row
from study.experiments.section import Section, part
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


def headline(path: Path) -> Section:
    """Speed against error to ground truth: the figure, the sentences, the fastest at each level."""
    about: dict = {}
    parts = []
    if result := Pareto.load_if_there(path / FILE):
        winners, rows = result.winners, result.rows
        size = f" (n = {result.n})"
        caption = "The fastest at a stated PSNR to ground truth; “or”: not told apart from it"
        parts = part("pareto", caption + size, tables.by_level(winners), tables.LEVELS)
        own = [row for row in rows if row.own_parameters]
        caption = "With each scene's own parameters: evaluations per pixel × ns per evaluation"
        parts += part("pareto-own", caption + size, own, tables.POINTS)
        parts += part("pareto-points", "Every point of the grid" + size, rows, tables.POINTS)
        about = {
            "answer": fronts.answer(winners),
            "drawn": tables.drawings(result),
            "chart": fragment(rows),
        }
    about |= {"file": path / FILE, "script": "scripts/stepwise pareto"}
    return Section("pareto", "Speed against error", "make pareto", parts, **about)
