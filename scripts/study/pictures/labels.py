"""Names beside their marks, none on another, a mark or an edge; drawn where the layout is settled."""

from __future__ import annotations

import math
from collections.abc import Iterator

from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

ANGLES = [math.radians(degrees) for degrees in range(0, 360, 15)]
RADII = range(12, 300, 6)  # points: how far a name may stand from its mark
OVER = 30
MARK = 5  # points: half of a mark's size
BESIDE = 7  # points: a name that stands this near to its mark needs no line to it


class Name(Annotation):
    """A mark's name: `settle` finds its place."""


def name(axes: Axes, x: float, y: float, text: str, colour: str, size: float = 7.5) -> None:
    """Asks for `text` beside the mark at x, y (data coordinates)."""
    line = {"arrowstyle": "-", "color": colour, "linewidth": 0.7, "shrinkA": 0, "shrinkB": 3}
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.85}
    made = Name(
        text,
        (x, y),
        (0, 0),
        textcoords="offset points",
        fontsize=size,
        ha="center",
        va="center",
        zorder=7,
        bbox=box,
        arrowprops=line,
    )
    made.set_in_layout(False)
    axes.add_artist(made)


def _box(at: tuple[float, float], half: float) -> Bbox:
    return Bbox([[at[0] - half, at[1] - half], [at[0] + half, at[1] + half]])


def marks(axes: Axes, pixels: float) -> list[Bbox]:
    """Boxes of the marks and whiskers, and of the texts that are no names, in pixels of `pixels` a point."""
    found, here = [], axes.transData.transform
    for line in axes.lines:
        if line.get_marker() not in ("", "None", None) and line.get_transform() == axes.transData:
            found += [_box(tuple(at), MARK * pixels) for at in here(line.get_xydata())]
    for drawn in axes.collections:
        if isinstance(drawn, PathCollection):
            found += [_box(tuple(at), MARK * pixels) for at in here(drawn.get_offsets())]
        elif isinstance(drawn, LineCollection):
            found += [Bbox(here(ends)) for ends in drawn.get_segments() if len(ends)]
    found += [text.get_window_extent() for text in axes.texts if not isinstance(text, Name)]
    return [box for box in found if all(map(math.isfinite, box.extents))]


def _places(
    mark: tuple[float, float], width: float, height: float, pixels: float
) -> Iterator[tuple[int, Bbox]]:
    """Radius and box of that size around the mark, the nearest first."""
    for radius in RADII:
        for angle in ANGLES:
            x = mark[0] + math.cos(angle) * (radius * pixels + width / 2 - height / 2)
            y = mark[1] + math.sin(angle) * radius * pixels
            yield radius, Bbox.from_bounds(x - width / 2, y - height / 2, width, height)


def _middle(box: Bbox) -> tuple[float, float]:
    return (box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2


def _crosses(one: tuple[float, float], other: tuple[float, float], box: Bbox) -> bool:
    steps = [i / 24 for i in range(25)]
    return any(
        box.contains(one[0] + t * (other[0] - one[0]), one[1] + t * (other[1] - one[1])) for t in steps
    )


def _free(box: Bbox, mark: tuple[float, float], frame: Bbox, taken: list[Bbox], lines: list) -> bool:
    inside = frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1
    if not inside or any(box.overlaps(other) for other in taken):
        return False
    return not any(_crosses(*line, box) for line in lines)


class _Panel:
    """The places that are taken in one panel, in pixels."""

    def __init__(self, axes: Axes, pixels: float):
        self.pixels, self.frame = pixels, axes.get_window_extent()
        self.marks, self.names, self.lines = marks(axes, pixels), [], []

    def find(self, mark: tuple[float, float], size: Bbox) -> Bbox:
        """The nearest free place; a line over another mark counts as OVER points of distance."""
        width, height = size.width + 2 * self.pixels, size.height + 2 * self.pixels
        near = _box(mark, 2 * MARK * self.pixels)
        others = [box for box in self.marks if not box.overlaps(near)]
        best, found = math.inf, None
        for radius, box in _places(mark, width, height, self.pixels):
            if radius >= best:
                break
            there = mark, _middle(box)
            if not _free(box, mark, self.frame, self.marks + self.names, self.lines):
                continue
            if any(_crosses(*there, one) for one in self.names):
                continue
            cost = radius + OVER * sum(_crosses(*there, one) for one in others)
            if cost < best:
                best, found = cost, box
        found = found or next(_places(mark, width, height, self.pixels))[1]
        self.names.append(found)
        self.lines.append((mark, _middle(found)))
        return found


def settle(figure: Figure) -> None:
    """Puts every name of the figure at the nearest free place, the highest mark's first. Needs a canvas."""
    if not any(isinstance(text, Name) for axes in figure.axes for text in axes.texts):
        return
    figure.draw_without_rendering()
    pixels = figure.dpi / 72
    for axes in figure.axes:
        names = [text for text in axes.texts if isinstance(text, Name)]
        at = {text: tuple(axes.transData.transform(text.xy)) for text in names}
        panel = _Panel(axes, pixels)
        for text in sorted(names, key=lambda one: (-round(at[one][1]), at[one][0])):
            mark = at[text]
            box = panel.find(mark, text.get_bbox_patch().get_window_extent())
            text.set_position(tuple((m - a) / pixels for m, a in zip(_middle(box), mark, strict=True)))
            near = max(box.x0 - mark[0], mark[0] - box.x1, box.y0 - mark[1], mark[1] - box.y1)
            text.arrow_patch.set_visible(near > BESIDE * pixels)
