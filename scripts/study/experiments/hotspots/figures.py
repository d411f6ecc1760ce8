"""Where the time of a frame goes, phase by phase, as one figure."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from study.core.show import cell
from study.experiments.hotspots.tables import Row, top

SHOWN = 5  # functions of a phase; the others are one piece
SHADES = ("#0072B2", "#3D94C6", "#76B3D6", "#A9CFE5", "#D3E6F1")
OTHERS = "#e6e6e6"


def draw(rows: Sequence[Row]) -> Figure:
    """A bar a phase: its functions of most time, named where the name has room, and the rest."""
    names = list(dict.fromkeys(row.phase for row in rows))
    figure = Figure(figsize=(11, 0.42 * len(names) + 1.3), layout="constrained")
    figure.suptitle("Where the time of a frame goes", x=0.01, ha="left", fontsize=12)
    axes = figure.subplots()
    for place, name in enumerate(names):
        left = 0.0
        build, mine = top(rows, name, SHOWN)
        for shade, row in enumerate(mine):
            share, text = cell(row, f"{build}_percent"), row.function
            axes.barh(place, share, 0.8, left, color=SHADES[shade], edgecolor="white")
            if len(text) * 0.82 + 1 < share:
                ink = "white" if shade < 2 else "black"
                axes.text(left + share / 2, place, text, fontsize=7.5, color=ink, ha="center", va="center")
            left += share
        axes.barh(place, max(0.0, 100 - left), 0.8, left, color=OTHERS, edgecolor="white")
        axes.text(99, place, f"others {max(0.0, 100 - left):.0f} %", fontsize=7.5, ha="right", va="center")
    axes.set_yticks(range(len(names)), names, fontsize=9)
    axes.set(xlim=(0, 100), ylim=(len(names) - 0.5, -0.5), xlabel="% of the frame")
    axes.grid(False, axis="y")
    return figure
