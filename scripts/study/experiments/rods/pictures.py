"""The article's pictures of rod marching: steps, depth, and beside them the error, by rays and by rods."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap as Colormap
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from study.core.registry import find_scene
from study.experiments.rods import measure as rods
from study.experiments.rods.measure import MARCHES
from study.pictures import images
from study.pictures.draw import STYLE, save
from study.truth import truth

PICTURES = "rods-pictures"
CAPTION = (
    "two_spheres, above by rays, below by rods: march steps (white: one), distance to the hit in scene units "
    "(white: near; black: no hit), and how far from ground truth (white: 1e-4 and less, black: 0.1 and more; "
    "red: a wrong hit)"
)
FAR = 0.85  # black of the farthest hit; all of it stands for no hit


NAMES = {"pixels": "each ray alone", "rods": "rods"}


class Bar(NamedTuple):
    """A column's colour bar."""

    map: Colormap
    norm: Normalize
    label: str


def grey_steps(steps: np.ndarray, cap: int) -> np.ndarray:
    """White is one step, black the cap: the article's first picture of a march. In [0, 1]."""
    return np.clip(1 - (steps - 1) / max(cap - 1, 1), 0, 1)


def grey_depth(depth: np.ndarray, near: float, far: float) -> np.ndarray:
    """White is near, black far and where nothing is hit. In [0, 1]."""
    shade = 1 - FAR * (np.where(np.isfinite(depth), depth, far) - near) / max(far - near, 1e-9)
    return np.where(np.isfinite(depth), np.clip(shade, 0, 1), 0)


def error_colours(exact: images.Picture, made: images.Picture) -> np.ndarray:
    """Logarithm of |Δt| from 1e-4 (white) to 0.1 (black); red where the hit is wrong. RGB in [0, 1]."""
    wrong = made["id"] != exact["id"]
    with np.errstate(invalid="ignore", divide="ignore"):
        off = np.where(exact["id"] >= 0, np.abs(made["Z"].astype(float) - exact["Z"]), 0)
        grey = 1 - np.clip((np.log10(np.maximum(off, 1e-12)) + 4) / 3, 0, 1)
    rgb = np.repeat(np.where(wrong, 0, grey)[..., None], 3, axis=-1)
    rgb[wrong] = (0.84, 0.15, 0.15)
    return rgb


def scales(cap: int, near: float, far: float) -> tuple[Bar, Bar, Bar]:
    """The colour bars of the three columns: what the greys of the pictures stand for."""
    grey = Colormap.from_list
    return (
        Bar(grey("steps", ["1", "0"]), Normalize(1, cap), f"steps of the march (cap: {cap})"),
        Bar(
            grey("depth", ["1", str(1 - FAR)]),
            Normalize(near, max(far, near + 1e-9)),
            "distance, scene units (black: no hit)",
        ),
        Bar(grey("error", ["1", "0"]), LogNorm(1e-4, 0.1), "|Δt| to ground truth, scene units (red: wrong)"),
    )


def _colour_bar(figure: Figure, column: np.ndarray, bar: Bar) -> None:
    """Below a column, for both of its pictures."""
    below = {"orientation": "horizontal", "fraction": 0.05, "pad": 0.03, "aspect": 30}
    extend = "both" if isinstance(bar.norm, LogNorm) else "neither"
    drawn = figure.colorbar(ScalarMappable(bar.norm, bar.map), ax=list(column), extend=extend, **below)
    drawn.set_label(bar.label, fontsize=9)
    drawn.ax.tick_params(labelsize=8)
    if isinstance(bar.norm, LogNorm):
        drawn.ax.xaxis.set_minor_locator(NullLocator())
    else:
        first, last = bar.norm.vmin, bar.norm.vmax
        ticks = [first, (first + last) / 2, last]
        drawn.set_ticks(ticks, labels=[f"{tick:.3g}" for tick in ticks])


def write_pictures(folder: Path, n: int) -> list[Path]:
    """The article's four pictures, and the error of both programs: each as PNG and all on one sheet."""
    scene = find_scene(rods.SCENE)
    size = scene.size(n)
    cap = scene.data["march"]["max_steps"]
    exact = truth.picture(scene, size)
    hit = exact["Z"][np.isfinite(exact["Z"])]
    near, far = (float(hit.min()), float(hit.max())) if hit.size else (0.0, 1.0)
    made = {name: rods.picture("rods", words, scene, size) for name, words in MARCHES.items()}
    (folder / "images").mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(9.4, 7.8), layout="constrained")
    axes = figure.subplots(2, 3)
    paths = []
    for line, (name, planes) in zip(axes, made.items(), strict=True):
        steps, depth = planes["steps"], planes["Z"]
        shown = {
            "steps": (grey_steps(steps, cap), "march steps"),
            "depth": (grey_depth(depth, near, far), "distance to the hit"),
            "error": (error_colours(exact, planes), "error of that distance"),
        }
        for place, (kind, (shade, title)) in zip(line, shown.items(), strict=True):
            rgb = shade if shade.ndim == 3 else np.repeat(shade[..., None], 3, axis=-1)
            place.imshow(rgb, interpolation="nearest")
            place.set_title(f"{NAMES[name]}: {title}", fontsize=10)
            place.set(xticks=[], yticks=[])
            path = folder / "images" / f"rods-{name}-{kind}.png"
            images.write_png(path, (255 * rgb + 0.5).astype(np.uint8))
            paths.append(path)
    for column, bar in zip(axes.T, scales(cap, near, far), strict=True):
        _colour_bar(figure, column, bar)
    title = f"Rod marching, {rods.SCENE}, {size[0]}×{size[1]} pixels: above each ray alone, below by rods"
    figure.suptitle(title, x=0.01, ha="left", fontsize=12)
    with matplotlib.rc_context(STYLE):
        save(figure, folder / "images" / PICTURES, "")
    return [*paths, folder / "images" / f"{PICTURES}.png"]
