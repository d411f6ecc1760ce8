"""What the packet ray tracer draws of its scenes, and under each how far that is from truth: a sheet."""

from __future__ import annotations

from pathlib import Path

from study.core import registry, store
from study.experiments.packets import scenes
from study.measuring import sheets

PICTURES = "packets-pictures"
CAPTION = (
    "Phase packets on spheres40, trio without its torus under hard shadows, and 4,096 spheres; below, in "
    "half as many lines, the largest difference to ground truth of R, G, B in each pixel"
)
HEIGHT = 180


def write_pictures(folder: Path, n: int = HEIGHT) -> list[Path]:
    """The sheet: pictures of `n` lines, differences of n // 2. Raises StudyError."""
    kept = store.writable(registry.ROOT / "build" / "systems" / "scenes")
    title = "The packet ray tracer; below, its difference to the exact picture (black: none over 10⁻⁶)"
    shown = [("packets", scene) for scene in scenes.traced(kept)]
    sheets.write(folder / "images" / f"{PICTURES}.png", title, shown, n, n // 2)
    return [folder / "images" / f"{PICTURES}.png"]
