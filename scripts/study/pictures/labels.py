"""Names beside their marks, moved apart by adjustText where the layout is settled."""

from __future__ import annotations

import numpy as np
from adjustText import adjust_text
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.text import Text

BOX = {"facecolor": "white", "edgecolor": "none", "pad": 0, "alpha": 0.7}
MARK = 5  # points: half of a mark's size
STEPS = 500  # of adjustText, which else stops by the clock and draws another figure each time


class Name(Text):
    """A mark's name: `settle` finds its place."""


def name(axes: Axes, x: float, y: float, text: str, colour: str, size: float = 7.5) -> None:
    """Asks for `text` beside the mark at x, y (data coordinates)."""
    made = Name(x, y, text, color=colour, fontsize=size, ha="left", va="bottom", zorder=7, bbox=BOX)
    made.set_in_layout(False)
    made.set_clip_on(False)
    axes.add_artist(made)


def _corners(axes: Axes) -> np.ndarray:
    """The corners of the marks' boxes, in data coordinates, n × 2."""
    found = [
        line.get_xydata()
        for line in axes.lines
        if line.get_marker() not in ("", "None", None) and line.get_transform() == axes.transData
    ]
    found += [one.get_offsets() for one in axes.collections if isinstance(one, PathCollection)]
    pixels = axes.transData.transform(np.concatenate([np.empty((0, 2)), *found]))
    corners = pixels[:, None] + MARK * axes.figure.dpi / 72 * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])
    return axes.transData.inverted().transform(corners.reshape(-1, 2))


def settle(figure: Figure) -> None:
    """Puts every name of the figure beside its mark, on no other name or mark. Needs a canvas."""
    for axes in figure.axes:
        names = [text for text in axes.texts if isinstance(text, Name)]
        if names:
            figure.draw_without_rendering()
            x, y = _corners(axes).T
            line = {"arrowstyle": "-", "color": "#888888", "linewidth": 0.7}
            adjust_text(names, x, y, ax=axes, iter_lim=STEPS, arrowprops=line)
