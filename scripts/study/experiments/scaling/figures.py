"""The figures of how cost grows, made from scaling.json alone."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from study.experiments.scaling.schema import Fit, Row, Scaling
from study.experiments.scaling.series import LAW
from study.experiments.scaling.tables import TOP, evaluations, level
from study.numbers import power_laws
from study.numbers.power_laws import Law
from study.pictures.draw import Drawing, legend, look, panels, plain_log

APART = 0.052  # of a panel's height: labels that are nearer would overlap
PAPERS: dict[str, Any] = {"color": "#999999", "linestyle": (0, (1, 2)), "linewidth": 1.5, "zorder": 1}
Value = Callable[[Row], float | None]


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
        where: dict[str, Any] = {
            "xycoords": "axes fraction",
            "textcoords": "offset points",
            "annotation_clip": False,
        }
        axes.annotate(text, (1.0, place), (3, 0), color=colour, fontsize=8, va="center", **where)


@dataclass
class Panel:
    """A series: its rows by program, each with its look."""

    title: str
    axes: Axes
    phases: dict[str, list[Row]]
    looks: dict[tuple[str, int], dict]

    @property
    def xs(self) -> list[float]:
        return [row.x for rows in self.phases.values() for row in rows]


def _panels(result: Scaling, rows: Sequence[Row], title: str, axis: str) -> tuple[Figure, list[Panel]]:
    """A panel per series, with a logarithmic x."""
    frame = pd.DataFrame(
        [{"scene": result.titles[row.series], "phase": row.phase, "threads": 1} for row in rows]
    )
    figure, grid = panels(frame, 3.1, 4.3)
    figure.suptitle(title, x=0.01, ha="left", fontsize=12)
    looks, made = look(frame), []
    for name, axes in grid.items():
        mine = [row for row in rows if result.titles[row.series] == name]
        axes.set(title=name, xscale="log", xlabel=result.axes[mine[0].series], ylabel=axis)
        axes.title.set_fontsize(10)
        phases: dict[str, list[Row]] = {}
        for row in mine:
            phases.setdefault(row.phase, []).append(row)
        made.append(Panel(name, axes, phases, looks))
    return figure, made


def _grown(result: Scaling, value: Value, title: str, axis: str) -> Figure:
    """Log-log: each program's points, fitted law (dashed), exponent."""
    timed = value is milliseconds
    figure, made = _panels(result, _lines(result.rows, value), title, axis)
    for panel in made:
        axes = panel.axes
        axes.set(yscale="log")
        ends = []
        for phase, rows in panel.phases.items():
            style = panel.looks[phase, 1]
            ys = [value(row) or 0 for row in rows]
            marks = {"marker": style["marker"], "markersize": 4.5, "color": style["color"]}
            axes.plot([row.x for row in rows], ys, **marks, linewidth=0.8, label=phase, zorder=3)
            for law in _laws(result.fits, panel.title, phase, timed):
                _dashed(axes, law, 1e-6 if timed else 1, style["color"])
                star = "*" if law.holds is False else ""
                ends.append((ys[-1], f"x^{law.exponent.value:.2f}{star}", style["color"]))
        papers = [fit.paper for fit in result.fits if fit.title == panel.title and fit.paper is not None]
        if timed and papers:
            across = np.array([min(panel.xs), max(panel.xs)])
            every = [row for rows in panel.phases.values() for row in rows]
            start = next(milliseconds(row) for row in every if row.x == across[0])
            bottom, top = axes.get_ylim()
            axes.plot(across, start * (across / across[0]) ** papers[0], **PAPERS, label=f"the paper's {LAW}")
            axes.set_ylim(bottom, max(top, 2 * max(map(milliseconds, every))))
        low, high = axes.get_ylim()
        wide = max(1.0, math.sqrt(4.5 * low / high))  # at least 4.5 from end to end: a tenth is nothing
        axes.set_ylim(low / wide, high * wide)
        plain_log(axes.xaxis)
        plain_log(axes.yaxis)
        _labels(axes, ends)
    legend(figure, {panel.title: panel.axes for panel in made})
    return figure


def _lines(rows: Sequence[Row], value: Value) -> list[Row]:
    """Rows with a value, of the series of which some program has two: one point shows no growth."""
    found: dict[tuple[str, str], set[float]] = {}
    for row in rows:
        if value(row):
            found.setdefault((row.series, row.phase), set()).add(row.x)
    several = {series for (series, _), across in found.items() if len(across) > 1}
    return [row for row in rows if value(row) and row.series in several]


def _laws(fits: Sequence[Fit], title: str, phase: str, timed: bool) -> Iterator[Law]:
    for fit in fits:
        law = fit.time if timed else fit.evals
        if (fit.title, fit.phase) == (title, phase) and law:
            yield law


def _dashed(axes: Axes, law: Law, scale: float, colour: str) -> None:
    across = np.array([law.first_x, law.last_x])
    ys = scale * (law.factor or 0) * across ** (law.exponent.value or 0)
    axes.plot(across, ys, "--", color=colour, linewidth=1.4, alpha=0.75)


def errors(result: Scaling) -> Figure:
    """PSNR to ground truth (filled) or to the finest picture there is (hollow)."""
    rows = [row for row in result.rows if level(row) is not None]
    title = f"Error: up is nearer to the reference ({TOP} dB: that or nearer)"
    figure, made = _panels(result, rows, title, "PSNR, dB (linear)")
    order = list(dict.fromkeys(row.phase for row in rows))
    for panel in made:
        axes = panel.axes
        for phase, some in panel.phases.items():
            style = panel.looks[phase, 1]
            size = max(24, 80 - 32 * order.index(phase))  # what lies below others looks out from under them
            for one in dict.fromkeys(row.reference for row in some):  # no line from one reference to another
                same = [(row.x, level(row)) for row in some if row.reference == one]
                axes.plot(*zip(*same, strict=True), color=style["color"], linewidth=0.8, zorder=2)
            fill = [style["color"] if row.reference == "truth" else "white" for row in some]
            marks = {"marker": style["marker"], "s": size, "edgecolor": style["color"], "zorder": 3}
            axes.scatter([row.x for row in some], [level(row) or 0 for row in some], c=fill, **marks)
            axes.plot([], [], marker=style["marker"], color=style["color"], linewidth=0.8, label=phase)
        plain_log(axes.xaxis)
        axes.set_ylim(0, TOP + 8)  # one scale: a tenth of a dB is nothing
        axes.set_xlim(min(panel.xs) / 1.3, max(panel.xs) * 1.3)
    legend(figure, {panel.title: panel.axes for panel in made})
    return figure


def drawings(result: Scaling) -> dict[str, Drawing]:
    """What scaling.json suffices for."""
    time, evals = "Time of a frame, log-log", "Evaluations of the whole scene by a camera ray, log-log"
    about = note(result)
    made = {}
    if _lines(result.rows, milliseconds):
        caption = "Time of a frame against what it depends on, with fitted power laws"
        made["scaling-time"] = Drawing(
            caption, about, lambda: _grown(result, milliseconds, time, "ms a frame")
        )
    if _lines(result.rows, evaluations):
        caption = "Evaluations of a camera ray's march against the same"
        make = lambda: _grown(result, evaluations, evals, "evaluations per ray")  # noqa: E731
        made["scaling-evals"] = Drawing(caption, about, make)
    if any(level(row) is not None for row in result.rows):
        made["scaling-error"] = Drawing("Error against the same", about, lambda: errors(result))
    return made


def note(result: Scaling) -> str:
    return (
        f"{result.machine}; median of {result.launches} interleaved launches; n = {result.n} where it is not "
        "what varies (twice that in threads; 720 in crowd). Dashed: least squares in log-log; "
        f"*: some point is over "
        f"{100 * (power_laws.OFF - 1):.0f} % off the law, beyond its launches' noise: the exponent is then "
        "a mean slope and no law. Dotted: the paper's law from the first program's first point on. Filled "
        "marks: error to ground truth; hollow: to the finest picture there is, which the table names."
    )
