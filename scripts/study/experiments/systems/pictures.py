"""One sheet of what the systems beside the ladder draw: each picture with what says most about it beside."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from study.core import registry
from study.experiments.lattice import measure as lattice
from study.experiments.packets.pictures import title_of
from study.experiments.rods import measure as rods
from study.pictures import images, panels
from study.pictures.images import Picture
from study.truth import truth

PICTURES = "systems-pictures"
CAPTION = (
    "CPU-RTRM's scene by opt9_convex; trio by rods_simd and where its rods let each pixel's ray begin; "
    "spheres40 in integers and in floats; below, the largest difference to ground truth of R, G, B in each "
    "pixel"
)
HEIGHT, HYBRID, SPHERES = 180, "trio", "spheres40"


def start_map(start: np.ndarray) -> np.ndarray:
    """Where rays begin, masked where none is marched (−1)."""
    return np.ma.masked_where(start < 0, start)


def error_of(made: Picture, exact: Picture) -> str:
    """In dB to ground truth."""
    psnr = rods.errors(exact, made)["psnr_db"]
    return "identical" if psnr is None else f"{psnr:.1f} dB to ground truth"


def _starts(place: Any, made: Picture) -> None:
    """Where rods have sent each pixel's ray, with its own scale within."""
    panels.show(place, np.full((*made["start"].shape, 3), 0.87))
    shown = place.imshow(start_map(made["start"]), interpolation="nearest", cmap="viridis")
    scale = place.inset_axes((0.3, 0.9, 0.4, 0.05))
    place.figure.colorbar(shown, cax=scale, orientation="horizontal")
    place.set_title("distance where a ray starts (grey: no ray)", fontsize=13, loc="left")


def write_pictures(folder: Path, n: int = HEIGHT) -> list[Path]:
    """The sheet; a phase that this CPU cannot run leaves its column out. Raises StudyError."""
    wanted = (
        ("opt9_convex", lattice.SCENE),
        ("rods_simd", HYBRID),
        ("fixed", SPHERES),
        ("fixed_float", SPHERES),
    )
    columns = [one for one in wanted if registry.cpu_supports(registry.find_phase(one[0]))]
    title = "Systems beside the ladder; below, the difference to ground truth (black: none), and rods' map"
    figure, spots, bar = panels.two_rows(len(columns), (5, 6.9), title, 0.87)
    for column, (phase, name) in enumerate(columns):
        above, below = (figure.add_subplot(spots[row, column]) for row in (0, 1))
        scene = registry.find_scene(name)
        made, exact = rods.picture(phase, "", scene, scene.size(n)), truth.picture(scene, scene.size(n))
        panels.show(above, images.to_display(images.rgb(made)))
        above.set_title(f"{phase}: {name}", fontsize=14, loc="left")
        if "start" in made:
            _starts(below, made)
            above.set_title(f"{phase}: {name}, {error_of(made, exact)}", fontsize=13, loc="left")
            continue
        bar.clear()
        panels.difference(below, bar, exact, made)
        panels.tell(below, exact, made)
        below.set_title(title_of(made, exact), fontsize=13, loc="left")
    (folder / "images").mkdir(parents=True, exist_ok=True)
    return [panels.save(figure, folder / "images" / f"{PICTURES}.png")]
