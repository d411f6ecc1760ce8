"""The article's pictures of rod marching: steps, depth, and beside them the error, by rays and by rods."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.figure import Figure

from study.core.registry import find_scene
from study.experiments.rods import measure
from study.pictures.draw import STYLE, save
from study.pictures.images import Picture
from study.truth import truth

PICTURES = "rods-pictures"
CAPTION = (
    "two_spheres, above by rays, below by rods: march steps (white: one), distance to the hit in scene units "
    "(white: near; black: no hit), and how far from ground truth (white: 1e-4 and less, black: 0.1 and more; "
    "red: a wrong hit)"
)
NAMES = {measure.PIXELS: "each ray alone", measure.RODS: "rods"}
FAR = "0.15"  # the grey of the farthest hit; black stands for no hit
WRONG = (0.84, 0.15, 0.15)


class Column(NamedTuple):
    """What a plane of the pictures is drawn by."""

    title: str
    label: str
    norm: Normalize
    map: Colormap

    def rgb(self, values: np.ndarray) -> np.ndarray:
        return self.map(self.norm(np.ma.masked_invalid(values)))[..., :3]


def columns(cap: int, near: float, far: float) -> tuple[Column, Column, Column]:
    """Columns of steps, depth and error."""

    def greys(last: str, bad: str) -> Colormap:
        return LinearSegmentedColormap.from_list("", ["1", last]).with_extremes(bad=bad)

    depth, error = Normalize(near, max(far, near + 1e-9)), LogNorm(1e-4, 0.1, clip=True)
    unit = "scene units"
    return (
        Column("march steps", f"steps of the march (cap: {cap})", Normalize(1, cap), greys("0", "0")),
        Column("distance to the hit", f"{unit} (black: no hit)", depth, greys(FAR, "0")),
        Column("error of that distance", f"|Δt|, {unit} (red: wrong)", error, greys("0", "1")),
    )


def error_rgb(column: Column, exact: Picture, made: Picture) -> np.ndarray:
    """|Δt| to truth; red where the hit is wrong."""
    with np.errstate(invalid="ignore"):
        off = np.abs(made["Z"].astype(float) - exact["Z"])
    rgb = column.rgb(np.where(exact["id"] >= 0, off, 0) + 1e-12)
    rgb[made["id"] != exact["id"]] = WRONG
    return rgb


def write_pictures(folder: Path, n: int) -> list[Path]:
    """The article's four pictures, and the error of both programs, on one sheet."""
    scene = find_scene(measure.SCENE)
    size = scene.size(n)
    exact = truth.picture(scene, size)
    hit = exact["Z"][np.isfinite(exact["Z"])]
    drawn = columns(scene.data["march"]["max_steps"], float(hit.min()), float(hit.max()))
    steps, depth, error = drawn
    (folder / "images").mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(9.4, 7.8), layout="constrained")
    axes = figure.subplots(2, 3)
    for line, (words, title) in zip(axes, NAMES.items(), strict=True):
        made = measure.picture(words, scene, size)
        shown = steps.rgb(made["steps"]), depth.rgb(made["Z"]), error_rgb(error, exact, made)
        for place, column, rgb in zip(line, drawn, shown, strict=True):
            place.imshow(rgb, interpolation="nearest")
            place.set_title(f"{title}: {column.title}", fontsize=10)
            place.set(xticks=[], yticks=[])
    for places, column in zip(axes.T, drawn, strict=True):
        bar = {"orientation": "horizontal", "fraction": 0.05, "pad": 0.03, "aspect": 30}
        made_bar = figure.colorbar(ScalarMappable(column.norm, column.map), ax=list(places), **bar)
        made_bar.set_label(column.label, fontsize=9)
    title = f"Rod marching, {measure.SCENE}, {size[0]}×{size[1]} pixels: above each ray alone, below by rods"
    figure.suptitle(title, x=0.01, ha="left", fontsize=12)
    with matplotlib.rc_context(STYLE):
        save(figure, folder / "images" / PICTURES, "")
    return [folder / "images" / f"{PICTURES}.png"]
