"""Every launch of a run of programs in the order in which they were made: drifts and modes are seen."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from study.core.run_schema import Plan
from study.pictures.draw import COLOURS, MARKERS, Drawing, panels

CAPTION = "All launches in the order in which they were made"
NOTE = (
    "Hollow: warm-up, in no statistic. Lines: medians. At the upper edge: launches beyond it. "
    "A round launches each program once, in random order."
)
FAR = 1.15  # of all but the slowest 2 % of launches: the upper edge, if nothing near is beyond it


def _panel(axes: Axes, mine: pd.DataFrame, names: list[str]) -> None:
    timed = mine[~mine.warmup]
    most = float(mine.ms.max())
    edge = FAR * float(timed.ms.quantile(0.98)) if len(timed) else most
    edge = edge if edge < most / FAR else most * 1.02
    for place, name in enumerate(names):
        some = mine[mine.spec == name]
        colour, marker = COLOURS[place % len(COLOURS)], MARKERS[place % len(MARKERS)]
        for warmup, of in some.groupby("warmup"):
            near = of[of.ms <= edge]
            face = "none" if warmup else colour
            how = {"s": 16, "marker": marker, "facecolors": face, "edgecolors": colour, "linewidths": 0.8}
            axes.scatter(near.order, near.ms, label=None if warmup else name, **how)
            beyond = of[of.ms > edge].order
            axes.scatter(beyond, np.full(len(beyond), edge), s=30, marker="^", color=colour, clip_on=False)
        if not (kept := some[~some.warmup]).empty:
            axes.axhline(float(kept.ms.median()), color=colour, linewidth=0.8, linestyle="--")
    low = float(mine.ms.min())
    axes.set(xlabel="launch", ylabel="ms", ylim=(low - 0.08 * (edge - low) - 1e-9, edge))


def _as_it_is(text: str) -> str:
    """Escapes text for matplotlib, to which text between two $ is a formula."""
    return text.replace("$", r"\$")


def draw(frames: pd.DataFrame, plan: Plan) -> Figure:
    """A panel a case, a colour a program."""
    rows = frames.assign(
        ms=frames.ns / 1e6, warmup=frames.warmup.astype(bool), order=range(1, len(frames) + 1)
    )
    rows[["scene", "spec"]] = rows[["scene", "spec"]].map(_as_it_is)
    cases = list(dict.fromkeys(_as_it_is(one.case) for one in plan.programs))
    names = list(dict.fromkeys(_as_it_is(one.name) for one in plan.programs))
    figure, grid = panels(rows.sort_values("scene", key=lambda of: of.map(cases.index)), 3.6, 8.0, 1)
    for case, axes in grid.items():
        _panel(axes, rows[rows.scene == case], names)
        axes.set_title(case, fontsize=10, loc="left")
    handles = next(iter(grid.values())).get_legend_handles_labels()
    figure.legend(*handles, loc="outside upper left", ncols=min(len(names), 3), frameon=False, fontsize=9)
    return figure


def drawing(frames: pd.DataFrame, plan: Plan) -> Drawing:
    return Drawing(CAPTION, NOTE, lambda: draw(frames, plan))
