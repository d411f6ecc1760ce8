"""The chapter of speed against error to ground truth."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

from study.experiments.pareto import chart
from study.experiments.pareto import fronts as pareto
from study.experiments.pareto import tables as pareto_page
from study.experiments.section import Found, Section, chapter, part
from study.pictures.draw import Drawing

SPEED = {  # captions
    "psnr_db": "Speed against error to ground truth; the front is the line",
    "psnr_ideal_db": "The same with the ideal shadow",
    "false_ppm": "Speed against false hits and misses",
    "dt_p99": "Speed against |Δt|",
}


def found(result: dict) -> Found:
    winners, rows = result["winners"], result["rows"]
    size = f" (n = {result['n']})"
    caption = "The fastest at a stated PSNR to ground truth; “or”: not told apart from it"
    foot = "\n".join(pareto.summary(winners, rows))
    parts = part("pareto", caption + size, pareto_page.by_level(winners), pareto_page.LEVELS, foot)
    own = [row for row in rows if row["own_parameters"]]
    caption = "With each scene's own parameters: evaluations per pixel × ns per evaluation"
    parts += part("pareto-own", caption + size, own, pareto_page.POINTS)
    caption = "The fastest, with its parameters and what it is not told apart from"
    parts += part("pareto-winners", caption + size, winners, pareto_page.WINNERS)
    parts += part("pareto-points", "Every point of the grid" + size, rows, pareto_page.POINTS)
    drawn = {}
    for measure, name in pareto_page.FIGURES.items():
        able = [row for row in rows if not math.isnan(pareto.badness(row, measure))]
        if able:
            draw = partial(pareto_page.figure, able, measure)
            drawn[name] = Drawing(SPEED[measure], pareto_page.note(result, measure), draw)
    return Found(parts, pareto.answer(winners), drawn, chart.fragment(rows))


def headline(path: Path) -> Section:
    """Speed against error to ground truth: the figure, the sentences, the fastest at each level."""
    return chapter("pareto", "Speed against error", path / pareto.FILE, pareto.read, found)
