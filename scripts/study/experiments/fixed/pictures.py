"""A picture of what the article's four-corner test clears wrongly, beside the one without the fault."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from study.core.registry import find_scene
from study.experiments.fixed.measure import SCENE, Case
from study.pictures import images
from study.pictures.draw import STYLE, save

PICTURES = "fixed-blocks"
CAPTION = (
    "spheres40 at 320×180 by the article's four-corner test and by planes against spheres; red: blocks of "
    "16×16 pixels that were cleared though a sphere is seen in them"
)
BLOCK, HEIGHT = 16, 180


def lost(made: images.Picture, whole: images.Picture) -> tuple[int, list[tuple[int, int]]]:
    """Pixels that clearing took from the picture without any, and column and row of the first pixel of each
    block that they are in."""
    rows, columns = np.nonzero((made["cleared"] > 0) & (whole["id"] >= 0))
    blocks = np.unique(np.stack([columns, rows], -1) // BLOCK * BLOCK, axis=0)
    return len(rows), [(int(x), int(y)) for x, y in blocks]


def write_pictures(folder: Path) -> list[Path]:
    """Both pictures on one sheet, the wrong blocks marked."""
    scene = find_scene(SCENE)
    made = {
        clear: Case("fixed", f"roots=3 clear={clear}").picture(scene, scene.size(HEIGHT))
        for clear in ("corners", "safe", "never")
    }
    (folder / "images").mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(11, 3.6), layout="constrained")
    title = (
        "spheres40 in integers: blocks of pixels taken for empty before any ray (red: wrongly), by two tests"
    )
    figure.suptitle(title, x=0.01, ha="left", fontsize=12)
    names = {"corners": "rays at its four corners", "safe": "planes at its edges against spheres"}
    for place, (clear, name) in zip(figure.subplots(1, 2), names.items(), strict=True):
        place.imshow(images.to_display(images.rgb(made[clear])), interpolation="nearest")
        pixels, blocks = lost(made[clear], made["never"])
        for x, y in blocks:
            mark = Rectangle((x - 0.5, y - 0.5), BLOCK, BLOCK, fill=False, edgecolor="red", linewidth=1)
            place.add_patch(mark)
        said = f"{len(blocks):,} blocks wrongly cleared, {pixels:,} pixels lost"
        place.set_title(f"{name}: {said}", fontsize=10)
        place.set(xticks=[], yticks=[])
    with matplotlib.rc_context(STYLE):
        save(figure, folder / "images" / PICTURES, "")
    return [folder / "images" / f"{PICTURES}.png"]
