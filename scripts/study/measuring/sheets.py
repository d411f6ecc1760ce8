"""Sheets of pictures: phases and scenes in columns, under each how far it is from ground truth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from study.core.registry import Scene
from study.measuring import hit_tables, hits
from study.pictures import images, panels
from study.pictures.images import Picture
from study.truth import truth


def _starts(axes: Axes, made: Picture) -> None:
    """Where rods have sent each pixel's ray, with its own scale within."""
    panels.show(axes, np.full((*made["start"].shape, 3), 0.87))
    start = np.ma.masked_where(made["start"] < 0, made["start"])
    shown = axes.imshow(start, interpolation="nearest", cmap="viridis")
    scale = axes.inset_axes((0.3, 0.9, 0.4, 0.05))
    axes.figure.colorbar(shown, cax=scale, orientation="horizontal")


def write(path: Path, title: str, shown: Sequence[tuple[str, Scene]], n: int, below: int) -> None:
    """Pictures of `n` lines; under them the difference of one of `below` lines to truth, or of a phase with
    rods where its rays begin. Raises StudyError."""
    figure, spots, bar = panels.two_rows(len(shown), (5.5, 7.4), title, 0.88)
    for column, (phase, scene) in enumerate(shown):
        upper, lower = (figure.add_subplot(spots[row, column]) for row in (0, 1))
        size = scene.size(n)
        large = hits.picture(phase, scene, size)
        small = large if n == below else hits.picture(phase, scene, scene.size(below))
        exact = truth.picture(scene, scene.size(below))
        panels.show(upper, images.to_display(images.rgb(large)))
        upper.set_title(f"{phase}: {scene.name}, {size[0]}×{size[1]}", fontsize=13, loc="left")
        said = hit_tables.error(hits.errors(exact, small))
        if "start" in small:
            _starts(lower, small)
            said = f"distance where a ray starts (grey: no ray); {said}"
        else:
            bar.clear()
            panels.difference(lower, bar, exact, small)
            panels.tell(lower, exact, small)
            said = f"to ground truth, {'×'.join(map(str, scene.size(below)))}: {said}"
        lower.set_title(said, fontsize=12, loc="left")
    path.parent.mkdir(parents=True, exist_ok=True)
    panels.save(figure, path)
