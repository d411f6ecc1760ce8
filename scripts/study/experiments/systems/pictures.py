"""One sheet of what the systems beside the ladder draw: each picture with what says most about it beside."""

from __future__ import annotations

from pathlib import Path

from study.core import registry
from study.measuring import sheets

PICTURES = "systems-pictures"
CAPTION = (
    "CPU-RTRM's scene by opt9_convex; trio by rods_simd and where its rods let each pixel's ray begin; "
    "spheres40 in integers and in floats; below, the largest difference to ground truth of R, G, B in each "
    "pixel"
)
HEIGHT = 180
COLUMNS = {"opt9_convex": "lattice", "rods_simd": "trio", "fixed": "spheres40", "fixed_float": "spheres40"}


def write_pictures(folder: Path, n: int = HEIGHT) -> list[Path]:
    """The sheet; a phase that this CPU cannot run leaves its column out. Raises StudyError."""
    shown = [
        (phase, registry.find_scene(scene))
        for phase, scene in COLUMNS.items()
        if registry.cpu_supports(registry.find_phase(phase))
    ]
    title = "Systems beside the ladder; below, the difference to ground truth (black: none), and rods' map"
    path = folder / "images" / f"{PICTURES}.png"
    sheets.write(path, title, shown, n, n)
    return [path]
