"""The figure of a table: a dot with its interval for each row, a panel for each group, words beside it."""

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from study.numbers.schema import Interval
from study.pictures.draw import BAD, ON_PAPER, plain_log

FINE, LESS, QUIET = "#0072B2", BAD, "#8C8C8C"
LONG = 20  # characters of a label that leaves no room for two panels on paper


@dataclass(frozen=True)
class Dot:
    """`low`, `high`: the interval, NaN without one; `text`: beside it, an error for instance."""

    panel: str
    label: str
    value: float
    low: float = math.nan
    high: float = math.nan
    text: str = ""
    colour: str = FINE


def of(found: Interval, panel: str, label: str, text: str = "", even: bool = False) -> Dot:
    """A dot for an interval as files have it. `even`: red where all is below 1, grey where 1 is in it."""
    value, low, high = found.ends
    colour = FINE if not even or low > 1 else LESS if high < 1 else QUIET
    return Dot(panel, label, value, low, high, text, colour)


def draw(rows: Sequence[Dot], title: str, axis: str, even: bool = False, columns: int = 2) -> Figure:
    """Draws on a logarithmic axis. `even`: with a line at 1. Values that are not above 0 are left out. On
    paper panels with long labels stand below each other."""
    rows = [row for row in rows if row.value > 0]
    names = list(dict.fromkeys(row.panel for row in rows))
    most = max(sum(row.panel == name for row in rows) for name in names)
    below = ON_PAPER.get() and any(len(row.label) > LONG for row in rows)
    columns = 1 if below else min(columns, len(names))
    lines, high = math.ceil(len(names) / columns), 0.2 if below else 0.27  # inches of a row
    figure = Figure(figsize=(max(8, 5.6 * columns), lines * (high * most + 1.0) + 0.7), layout="constrained")
    figure.suptitle("\n".join(textwrap.wrap(title, 62 * columns)), x=0.01, ha="left", fontsize=12)
    grid = figure.subplots(lines, columns, squeeze=False, sharex=True)
    for axes in grid.flat[len(names) :]:
        axes.set_axis_off()
    for name, axes in zip(names, grid.flat, strict=False):
        mine = [row for row in rows if row.panel == name]
        if even:
            axes.axvline(1, color="#888888", linewidth=1)
        for place, row in enumerate(mine):
            if math.isfinite(row.low) and math.isfinite(row.high):
                axes.plot([row.low, row.high], [place] * 2, color=row.colour, linewidth=2.2)
            axes.plot([row.value], [place], "o", color=row.colour, markersize=6)
            end = row.high if math.isfinite(row.high) else row.value
            near = {"textcoords": "offset points", "fontsize": 8, "va": "center"}
            axes.annotate(row.text, (end, place), (7, 0), **near)
        axes.set_yticks(range(len(mine)), [row.label for row in mine], fontsize=8.5)
        axes.set(ylim=(len(mine) - 0.4, -0.6), xscale="log", title=name)
        axes.title.set_fontsize(10)
    ends = [end for row in rows for end in (row.value, row.low, row.high) if end > 0]
    wide = max(1.1, (max(ends) / min(ends)) ** 0.04)
    low, high = min(ends) / wide, max(ends) * wide
    room = (high / low) ** 0.3 if any(row.text for row in rows) else 1
    for axes in grid.flat[: len(names)]:
        axes.set_xlim(low, high * room)
        plain_log(axes.xaxis)
    for axes in grid.flat[: len(names)][-columns:]:  # the last of each column
        axes.set_xlabel(axis)
        axes.tick_params(labelbottom=True)
    return figure
