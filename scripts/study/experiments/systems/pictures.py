"""One sheet of what the systems beside the ladder draw, under each how far it is from ground truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from study.core import registry
from study.measuring import hit_tables, hits
from study.pictures import images, panels
from study.pictures.images import Picture
from study.truth import truth

PICTURES = "systems-pictures"
CAPTION = (
    "CPU-RTRM's scene by opt9_convex; trio by rods_simd and where its rods let each pixel's ray begin; "
    "spheres40 in integers, in floats and by packets; below, the largest difference to ground truth of "
    "R, G, B in each pixel"
)
HEIGHT = 180
COLUMNS = {
    "opt9_convex": "lattice",
    "rods_simd": "trio",
    "fixed": "spheres40",
    "fixed_float": "spheres40",
    "packets": "spheres40",
}


def _starts(axes: Axes, made: Picture) -> None:
    """Where rods have sent each pixel's ray, with its own scale within."""
    panels.show(axes, np.full((*made["start"].shape, 3), 0.87))
    start = np.ma.masked_where(made["start"] < 0, made["start"])
    shown = axes.imshow(start, interpolation="nearest", cmap="viridis")
    scale = axes.inset_axes((0.3, 0.9, 0.4, 0.05))
    axes.figure.colorbar(shown, cax=scale, orientation="horizontal")


def write_pictures(folder: Path, n: int = HEIGHT) -> list[Path]:
    """The sheet: pictures, under them their difference to truth, or of a phase with rods where its rays
    begin. A phase that this CPU cannot run leaves its column out. Raises StudyError."""
    able = {p: s for p, s in COLUMNS.items() if registry.cpu_supports(registry.find_phase(p))}
    title = "Systems beside the ladder; below, the difference to ground truth (black: none), and rods' map"
    figure, spots, bar = panels.two_rows(len(able), (5.5, 7.4), title, 0.88)
    for column, (phase, name) in enumerate(able.items()):
        upper, lower = (figure.add_subplot(spots[row, column]) for row in (0, 1))
        scene = registry.find_scene(name)
        size = scene.size(n)
        made, exact = hits.picture(phase, scene, size), truth.picture(scene, size)
        panels.show(upper, images.to_display(images.rgb(made)))
        shown = f"{size[0]}×{size[1]}"
        upper.set_title(f"{phase}: {name}, {shown}", fontsize=13, loc="left")
        said = hit_tables.error(hits.errors(exact, made))
        if "start" in made:
            _starts(lower, made)
            said = f"distance where a ray starts (grey: no ray); {said}"
        else:
            bar.clear()
            panels.difference(lower, bar, exact, made)
            panels.tell(lower, exact, made)
            said = f"to ground truth, {shown}: {said}"
        lower.set_title(said, fontsize=12, loc="left")
    path = folder / "images" / f"{PICTURES}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    panels.save(figure, path)
    return [path]
