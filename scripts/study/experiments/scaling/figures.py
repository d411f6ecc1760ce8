"""The figure of how cost grows, made from scaling.json alone."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from study.experiments.scaling.schema import Row, Scaling
from study.experiments.scaling.series import LAW
from study.numbers import power_laws
from study.pictures.draw import Drawing, legend, look, panels, plain_log

APART = 0.052  # of a panel's height: labels that are nearer would overlap
PAPERS: dict[str, Any] = {"color": "#999999", "linestyle": (0, (1, 2)), "linewidth": 1.5, "zorder": 1}


def milliseconds(row: Row) -> float:
    return float(np.median(row.ns)) * 1e-6


def _places(values: Sequence[float]) -> list[float]:
    """Heights in 0 to 1 moved apart so that no two labels overlap, in their order."""
    order = sorted(range(len(values)), key=lambda i: values[i])
    moved = list(values)
    for before, after in itertools.pairwise(order):
        moved[after] = max(moved[after], moved[before] + APART)
    over = max(0.0, max(moved, default=0) - 1)  # a stack that grew over the top moves down as one
    return [place - over for place in moved] if over else moved


def _labels(axes: Axes, ends: list[tuple[float, str, str]]) -> None:
    """The exponents at the right ends of the lines: y, text, colour."""
    low, high = (math.log(y) for y in axes.get_ylim())
    heights = [(math.log(y) - low) / (high - low) for y, _, _ in ends]
    for (_, text, colour), place in zip(ends, _places(heights), strict=True):
        where: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points", "va": "center"}
        axes.annotate(text, (1.0, place), (3, 0), color=colour, fontsize=8, annotation_clip=False, **where)


def _grown(result: Scaling) -> Figure:
    """A panel per series, log-log: each program's points, fitted law (dashed), exponent; the paper's law
    (dotted)."""
    shown = _lines(result.rows)
    frame = pd.DataFrame(
        [{"scene": result.titles[row.series], "phase": row.phase, "threads": 1} for row in shown]
    )
    figure, grid = panels(frame, 3.1, 4.3)
    figure.suptitle("Time of a frame, log-log", x=0.01, ha="left", fontsize=12)
    looks = look(frame)
    for title, axes in grid.items():
        mine = [row for row in shown if result.titles[row.series] == title]
        axes.set(title=title, xscale="log", xlabel=result.axes[mine[0].series], ylabel="ms a frame")
        axes.set(yscale="log")
        axes.title.set_fontsize(10)
        ends = []
        for phase in dict.fromkeys(row.phase for row in mine):
            rows, style = [row for row in mine if row.phase == phase], looks[phase, 1]
            ys, colour = [milliseconds(row) for row in rows], style["color"]
            marks = {"marker": style["marker"], "markersize": 4.5, "color": colour}
            axes.plot([row.x for row in rows], ys, **marks, linewidth=0.8, label=phase, zorder=3)
            for law in [one.time for one in result.fits if (one.title, one.phase) == (title, phase)]:
                across = np.array([law.first_x, law.last_x])
                line = 1e-6 * (law.factor or 0) * across ** (law.exponent.value or 0)
                axes.plot(across, line, "--", color=colour, linewidth=1.4, alpha=0.75)
                star = "*" if law.holds is False else ""
                ends.append((ys[-1], f"x^{law.exponent.value:.2f}{star}", colour))
        papers = [fit.paper for fit in result.fits if fit.title == title and fit.paper is not None]
        if papers:
            xs = [row.x for row in mine]
            across = np.array([min(xs), max(xs)])
            start = next(milliseconds(row) for row in mine if row.x == across[0])
            bottom, top = axes.get_ylim()
            axes.plot(across, start * (across / across[0]) ** papers[0], **PAPERS, label=f"the paper's {LAW}")
            axes.set_ylim(bottom, max(top, 2 * max(map(milliseconds, mine))))
        low, high = axes.get_ylim()
        wide = max(1.0, math.sqrt(4.5 * low / high))  # at least 4.5 from end to end: a tenth is nothing
        axes.set_ylim(low / wide, high * wide)
        plain_log(axes.xaxis)
        plain_log(axes.yaxis)
        _labels(axes, ends)
    legend(figure, grid)
    return figure


def _lines(rows: Sequence[Row]) -> list[Row]:
    """Rows of the series of which some program has two: one point shows no growth."""
    found: dict[tuple[str, str], set[float]] = {}
    for row in rows:
        found.setdefault((row.series, row.phase), set()).add(row.x)
    several = {series for (series, _), across in found.items() if len(across) > 1}
    return [row for row in rows if row.series in several]


def drawings(result: Scaling) -> dict[str, Drawing]:
    caption = "Time of a frame against what it depends on, with fitted power laws"
    drawn = Drawing(caption, note(result), lambda: _grown(result))
    return {"scaling-time": drawn} if _lines(result.rows) else {}


def note(result: Scaling) -> str:
    return (
        f"{result.machine}; median of {result.launches} interleaved launches; n = {result.n} where it is not "
        "what varies (twice that in threads; 720 in crowd). Dashed: least squares in log-log; "
        f"*: some point is over "
        f"{100 * (power_laws.OFF - 1):.0f} % off the law, beyond its launches' noise: the exponent is then "
        "a mean slope and no law. Dotted: the paper's law from the first program's first point on."
    )
