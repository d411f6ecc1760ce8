"""What the plots share: looks that colour-blind readers and printers can tell apart, panels, axes, files."""

import io
import math
import re
import textwrap
from collections.abc import Callable
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.image
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from study.core import store

# Okabe & Ito's palette, which the colour-blind can tell apart, and further ones that are darker or duller
# than any of it: no two phases share one. Markers and hatches say the same in print.
COLOURS = [
    *("#000000", "#E69F00", "#56B4E9", "#009E73", "#D55E00", "#0072B2", "#CC79A7"),
    *("#8C8C8C", "#882255", "#332288", "#A6A000", "#6F4518", "#8B5CF6"),
]
BAD = "#b3261e"
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", (4, 1, 0), "H", (6, 1, 0))
HATCHES = ("", "//", "..", "xx", "\\\\", "--", "++")
BOX = {"facecolor": "white", "edgecolor": "none", "pad": 0}
MARK = 5  # points: half of a mark's size
LEAST, TITLE = 7, 150  # on paper: points of letters, characters of a title at most
WIDE, LOW = 6, 4.2  # inches: of a panel that stands alone on paper, and its height there
ON_PAPER: ContextVar[bool] = ContextVar("on_paper", default=False)
RINGS = np.array([3, 7, 12, 18, 25, 34, 45, 58, 72, 90])  # points from a mark to its name
POINTS = 16  # of a line to a name, by which what it crosses is known
NEAR = 12  # pixels from a mark to a name that needs no line
RING = {"marker": "o", "mfc": "none", "mec": BAD, "markersize": 16, "mew": 2, "linestyle": "none"}
STYLE = {
    "svg.hashsalt": "stepwise",
    "svg.fonttype": "none",
    "font.size": 10,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "hatch.linewidth": 0.6,
}


@dataclass(frozen=True)
class Drawing:
    """A figure that the files of the run suffice for; drawn (under STYLE) only where it is shown."""

    caption: str
    note: str  # stands under it
    make: Callable[[], Figure]

    def write(self, stem: Path, across: float | None = None) -> list[Path]:
        """`across`: inches across on paper, where letters have LEAST points and the note stands apart."""
        ON_PAPER.set(across is not None)
        with matplotlib.rc_context(STYLE):
            figure = self.make()
            return save(enlarged(figure, across) if across else figure, stem, "" if across else self.note)


def enlarged(figure: Figure, across: float) -> Figure:
    least = LEAST * figure.get_figwidth() / across
    for axes in figure.axes:
        axes.tick_params(labelsize=max(least, 8.5))
    for text in figure.findobj(Text):
        text.set_fontsize(max(least, text.get_fontsize()))
    if len(figure.get_suptitle()) > TITLE:
        figure.suptitle("")  # the caption says it
    return figure


def look(rows: pd.DataFrame) -> dict[tuple[str, int], dict]:
    """(spec, threads) → colour, marker, hatch, line style and label. opt2@opt3 has opt2's, drawn hollow."""
    names = list(dict.fromkeys(zip(rows.phase, rows.threads, strict=True)))
    places = _places(list(dict.fromkeys(spec.partition("@")[0] for spec, _ in names)))
    found = {}
    for spec, threads in names:
        place = places[spec.partition("@")[0]]
        found[spec, threads] = {
            "color": COLOURS[place % len(COLOURS)],
            "marker": MARKERS[place % len(MARKERS)],
            "hatch": HATCHES[place % len(HATCHES)],
            "linestyle": "--" if "@" in spec else ":" if threads > 1 else "-",
            "markerfacecolor": "white" if "@" in spec or threads > 1 else COLOURS[place % len(COLOURS)],
            "label": spec + (f", {threads} threads" if threads > 1 else ""),
        }
    return found


def _places(phases: list[str]) -> dict[str, int]:
    """Phase → place in the palettes: its number, so that it looks alike in every figure. Others, and a second
    one of a number, get what is free, from the last on."""
    found: dict[str, int] = {}
    for name in phases:
        wanted = 0 if name == "baseline" else _number(name)
        if wanted is not None and wanted not in found.values():
            found[name] = wanted
    free = [place for place in reversed(range(len(COLOURS) + len(phases))) if place not in found.values()]
    free.sort(key=lambda place: place >= len(COLOURS))
    return found | dict(zip((name for name in phases if name not in found), free, strict=False))


def _number(phase: str) -> int | None:
    found = re.fullmatch(r"opt(\d+)(_.*)?", phase)
    return int(found[1]) if found else None


PASSES = 3  # of a layout at most: until axes move by less than SETTLED of the figure
SETTLED = 1e-9


class Name(Text):
    """A mark's name: `settle` finds its place, beside the mark or, of a line's name, at one of `spots`."""

    spots: np.ndarray | None = None


def label(axes: Axes, x: float, y: float, text: str, colour: str, size: float = 7.5, **how: Any) -> Name:
    """Asks for `text` beside the mark at x, y (data coordinates)."""
    made = Name(x, y, text, color=colour, fontsize=size, zorder=7, bbox=BOX, ha="center", va="center", **how)
    made.set_in_layout(False)
    made.set_clip_on(False)
    axes.add_artist(made)
    return made


def _boxes(centres: np.ndarray, half: float | np.ndarray) -> np.ndarray:
    """x0, y0, x1, y1 of each."""
    return np.concatenate([centres - half, centres + half], axis=-1)


def _marks(axes: Axes) -> np.ndarray:
    """Boxes of marks, pixels."""
    found = [
        line.get_xydata()
        for line in axes.lines
        if line.get_marker() not in ("", "None", None) and line.get_transform() == axes.transData
    ]
    found += [np.asarray(one.get_offsets()) for one in axes.collections if isinstance(one, PathCollection)]
    pixels = axes.transData.transform(np.concatenate([np.empty((0, 2)), *found]))
    return _boxes(pixels, MARK * axes.figure.dpi / 72)


def _ways(name: Name, axes: Axes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where a name can stand (pixels): its boxes, points of the lines to the mark, and what each costs."""
    at, half = axes.transData.transform([name.get_position()]), np.divide(name.get_window_extent().size, 2)
    if name.spots is None:
        angle, far = np.meshgrid(np.arange(24) * math.pi / 12, RINGS * axes.figure.dpi / 72)
        turned = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        centres = (at + turned * (half + far[..., None])).reshape(-1, 2)
    else:
        centres = at = axes.transData.transform(name.spots)
    boxes, frame = _boxes(centres, half + 1), axes.get_window_extent()
    to = np.clip(at, boxes[:, :2], boxes[:, 2:]) - at
    outside = (boxes[:, :2] < frame.min).any(axis=1) | (boxes[:, 2:] > frame.max).any(axis=1)
    lines = at[:, None] + to[:, None] * np.linspace(0, 1, POINTS)[:, None]
    return boxes, lines, np.hypot(*to.T) + 1e4 * outside


def _place(axes: Axes, names: list[Name]) -> None:
    """Each in turn where it and its line cover the least of marks, other names and their lines."""
    ways, marks = [_ways(name, axes) for name in names], _marks(axes)
    taken = [np.empty((0, 4)) for _ in names]
    best = [0 for _ in names]
    for i in [*range(len(names))] * PASSES:
        boxes, lines, cost = ways[i]
        others = np.concatenate([marks, *taken[:i], *taken[i + 1 :]])
        on = np.minimum(boxes[:, None, 2:], others[:, 2:]) > np.maximum(boxes[:, None, :2], others[:, :2])
        under = (lines[:, :, None] > others[:, :2]) & (lines[:, :, None] < others[:, 2:])
        under = under.all(-1).sum((1, 2)) / POINTS * cost  # pixels, as the cost is
        # In pixels of way: 100 for what the name covers, 4 for each pixel of its line on something.
        best[i] = int(np.argmin(cost + 100 * on.all(-1).sum(1) + 4 * under))
        taken[i] = np.concatenate([boxes[[best[i]]], _boxes(lines[best[i]], 2)])
    back = axes.transData.inverted().transform
    for name, (boxes, lines, cost), one in zip(names, ways, best, strict=True):
        name.set_position(back(boxes[one].reshape(2, 2).mean(axis=0)))
        if cost[one] > NEAR:
            ends = back(lines[one][[0, -1]])
            style = {"color": name.get_color(), "linewidth": 0.7, "zorder": 3}
            axes.add_artist(Line2D(*ends.T, transform=axes.transData, **style))


def settle(figure: Figure) -> None:
    """Puts every name of the figure, whose layout is final, beside its mark, on no other name or mark."""
    for axes in figure.axes:
        if names := [text for text in axes.texts if isinstance(text, Name)]:
            _place(axes, names)


def panels(
    rows: pd.DataFrame, height: float, width: float = 4.6, columns: int = 3
) -> tuple[Figure, dict[str, Axes]]:
    """A figure with one panel of that size (inches) per scene. On paper wide ones stand below each other."""
    scenes = list(dict.fromkeys(rows.scene))
    columns = min(columns, len(scenes))
    if ON_PAPER.get() and width > WIDE:
        columns, height = 1, min(height, LOW)
    lines = math.ceil(len(scenes) / columns)
    figure = Figure(figsize=(max(width * columns, 8), height * lines + 1.0), layout="constrained")
    grid = figure.subplots(lines, columns, squeeze=False)
    for axes in grid.flat[len(scenes) :]:
        axes.set_axis_off()
    return figure, dict(zip(scenes, grid.flat, strict=False))


def save(figure: Figure, stem: Path, note: str) -> list[Path]:
    """STEM.svg and STEM.png, the same bytes for the same data. The note goes under the figure."""
    _ready(figure, note)
    files = []
    for kind, how in (("svg", {"metadata": {"Date": None}}), ("png", {"dpi": 110})):
        made = io.BytesIO()
        figure.savefig(made, format=kind, **how)
        files.append(stem.with_suffix(f".{kind}"))
        store.write_bytes(files[-1], made.getvalue())
    return files


def thumbnail(figure: Figure, note: str) -> bytes:
    """The figure as a PNG of half the size, for a page that has many."""
    _ready(figure, note)
    made = io.BytesIO()
    figure.savefig(made, format="png", dpi=75)
    return made.getvalue()


def _ready(figure: Figure, note: str) -> None:
    """Puts the note under the figure and everything in its place, once for both forms."""
    across = int(figure.get_figwidth() * 17)  # characters of this size
    note = "\n".join(textwrap.fill(line, across) for line in note.splitlines())
    figure.supxlabel(note, x=0.01, ha="left", fontsize=7.5, color="#444444", linespacing=1.4)
    FigureCanvasAgg(figure)
    if layout := figure.get_layout_engine():
        before = after = np.zeros(0)
        for _ in range(PASSES):  # what stands beside its axes comes home after some only
            layout.execute(figure)
            before, after = after, np.array([axes.get_position().bounds for axes in figure.axes])
            if before.size and np.abs(after - before).max() < SETTLED:
                break
    figure.set_layout_engine(None)
    settle(figure)


def bars_of(group: pd.DataFrame, name: str) -> np.ndarray:
    """Lengths below and above the value for errorbar, shape (2, rows); 0 without an interval."""
    value = group[name]
    return np.nan_to_num(np.array([value - group[f"{name}_low"], group[f"{name}_high"] - value]))


def plain_log(axis) -> None:
    """A logarithmic axis labelled 1,000 and not 10³; at 1, 2 and 5 if it spans little."""
    low, high = axis.get_view_interval()
    few = high / low < 60
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if few else (1,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
    axis.set_minor_formatter(NullFormatter())


def legend(figure: Figure, grid: dict[str, Axes], extra: tuple[Line2D, ...] = ()) -> None:
    """One legend for all panels, right of them, in the order of the ladder."""
    handles: dict = {}
    for axes in grid.values():
        handles |= {label: handle for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    handles |= {line.get_label(): line for line in extra}
    figure.legend(handles.values(), handles.keys(), loc="outside right upper", frameon=False, fontsize=9)
