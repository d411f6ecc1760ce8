"""The chapter of speed against error to ground truth."""

from __future__ import annotations

from pathlib import Path

from study.experiments.pareto import chart, fronts, tables
from study.experiments.pareto.schema import FILE, Pareto
from study.experiments.section import Section, part


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
            "chart": chart.fragment(rows),
        }
    about |= {"file": path / FILE, "script": "scripts/stepwise pareto"}
    return Section("pareto", "Speed against error", "make pareto", parts, **about)
