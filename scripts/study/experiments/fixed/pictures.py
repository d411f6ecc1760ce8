"""A picture of what the article's four-corner test clears wrongly, beside the one without the fault."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from study.core.registry import find_scene
from study.experiments.fixed import measure as fixed
from study.experiments.rods import measure as rods
from study.pictures import images
from study.pictures.draw import STYLE, save

PICTURES = "fixed-blocks"
CAPTION = (
    "spheres40 at 320×180 by the article's four-corner test and by planes against spheres; red: blocks of "
    "16×16 pixels that were cleared though a sphere is seen in them"
)
BLOCK, HEIGHT = 16, 180


def wrong_blocks(made: images.Picture, whole: images.Picture) -> list[tuple[int, int]]:
    """Column and row of the first pixel of each block that was cleared and should not have been."""
    lost = (made["cleared"] > 0) & (whole["id"] >= 0)
    rows, columns = np.nonzero(lost)
    return sorted(
        {(int(x) // BLOCK * BLOCK, int(y) // BLOCK * BLOCK) for x, y in zip(columns, rows, strict=True)}
    )


def lost_in(made: images.Picture, whole: images.Picture) -> str:
    """What clearing took from the picture without any."""
    pixels = int(((made["cleared"] > 0) & (whole["id"] >= 0)).sum())
    return f"{len(wrong_blocks(made, whole)):,} blocks wrongly cleared, {pixels:,} pixels lost"


def write_pictures(folder: Path) -> list[Path]:
    """Both pictures on one sheet, the wrong blocks marked."""
    scene = find_scene(fixed.SCENE)
    size = scene.size(HEIGHT)
    made = {}
    for clear in ("corners", "safe", "never"):
        with fixed.settings(f"roots=3 clear={clear}"):
            made[clear] = rods.picture("fixed", "", scene, size)
    (folder / "images").mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(11, 3.6), layout="constrained")
    title = (
        "spheres40 in integers: blocks of pixels taken for empty before any ray (red: wrongly), by two tests"
    )
    figure.suptitle(title, x=0.01, ha="left", fontsize=12)
    names = {"corners": "rays at its four corners", "safe": "planes at its edges against spheres"}
    for place, (clear, name) in zip(figure.subplots(1, 2), names.items(), strict=True):
        place.imshow(images.to_display(images.rgb(made[clear])), interpolation="nearest")
        for x, y in wrong_blocks(made[clear], made["never"]):
            place.add_patch(
                Rectangle((x - 0.5, y - 0.5), BLOCK, BLOCK, fill=False, edgecolor="red", linewidth=1)
            )
        place.set_title(f"{name}: {lost_in(made[clear], made['never'])}", fontsize=10)
        place.set(xticks=[], yticks=[])
    with matplotlib.rc_context(STYLE):
        save(figure, folder / "images" / PICTURES, "")
    return [folder / "images" / f"{PICTURES}.png"]
