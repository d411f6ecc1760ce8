"""What the packet ray tracer draws of its scenes, and under each how far that is from truth: a sheet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from study.core.registry import Scene
from study.experiments.rods import measure as rods
from study.pictures import images, panels
from study.truth import truth

PICTURES = "packets-pictures"
CAPTION = (
    "Phase packets on spheres40, trio without its torus under hard shadows, and 4,096 spheres; below, in "
    "half as many lines, the largest difference to ground truth of R, G, B in each pixel"
)


def title_of(made: images.Picture, exact: images.Picture) -> str:
    """Size and error of a difference."""
    off, (high, wide) = rods.errors(exact, made), made["R"].shape
    psnr = "identical" if off["psnr_db"] is None else f"{off['psnr_db']:.1f} dB"
    return f"to ground truth, {wide}×{high}: {psnr}, {off['wrong_ppm']:,.0f} ppm wrong hits"


def write_pictures(folder: Path, scenes: Sequence[Scene], n: int) -> list[Path]:
    """The sheet: pictures of `n` lines, differences of n // 2. Raises StudyError."""
    title = "The packet ray tracer; below, its difference to the exact picture (black: none over 10⁻⁶)"
    figure, spots, bar = panels.two_rows(len(scenes), (6, 7.9), title, 0.88)
    for column, scene in enumerate(scenes):
        above, below = (figure.add_subplot(spots[row, column]) for row in (0, 1))
        large, small = scene.size(n), scene.size(n // 2)
        shown = rods.picture("packets", "", scene, large)
        panels.show(above, images.to_display(images.rgb(shown)))
        above.set_title(f"{scene.name}, {large[0]}×{large[1]}", fontsize=14, loc="left")
        made, exact = rods.picture("packets", "", scene, small), truth.picture(scene, small)
        bar.clear()
        panels.difference(below, bar, exact, made)
        panels.tell(below, exact, made)
        below.set_title(title_of(made, exact), fontsize=14, loc="left")
    (folder / "images").mkdir(parents=True, exist_ok=True)
    return [panels.save(figure, folder / "images" / f"{PICTURES}.png")]
