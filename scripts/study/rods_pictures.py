"""The article's pictures of rod marching: steps, depth, and beside them the error, by rays and by rods."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from study import images, rods, truth
from study.draw import STYLE, save
from study.registry import find_scene
from study.rods import MARCHES

PICTURES = "rods-pictures"
CAPTION = (
    "two_spheres by rays and by rods: coloured by march steps (white: one), by depth (white: near), and "
)
CAPTION += "how far from truth (white: less than 1e-4, black: 0.1 and more; red: a wrong hit)"


def grey_steps(steps: np.ndarray, cap: int) -> np.ndarray:
    """White is one step, black the cap: the article's first picture of a march. In [0, 1]."""
    return np.clip(1 - (steps - 1) / max(cap - 1, 1), 0, 1)


def grey_depth(depth: np.ndarray, near: float, far: float) -> np.ndarray:
    """White is near, black far and where nothing is hit. In [0, 1]."""
    shade = 1 - 0.85 * (np.where(np.isfinite(depth), depth, far) - near) / max(far - near, 1e-9)
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
    figure = Figure(figsize=(11, 7.6), layout="constrained")
    axes = figure.subplots(2, 3)
    paths = []
    names = {"pixels": "each pixel by itself", "rods": "rods"}
    for line, (name, planes) in zip(axes, made.items(), strict=True):
        steps, depth = planes["steps"], planes["Z"]
        shown = {
            "steps": (grey_steps(steps, cap), f"{names[name]}: march steps, 1 … {cap}"),
            "depth": (grey_depth(depth, near, far), f"{names[name]}: depth, {near:.2f} … {far:.2f}"),
            "error": (error_colours(exact, planes), f"{names[name]}: |Δt| to truth; red: wrong hit"),
        }
        for place, (kind, (shade, title)) in zip(line, shown.items(), strict=True):
            rgb = shade if shade.ndim == 3 else np.repeat(shade[..., None], 3, axis=-1)
            place.imshow(rgb, interpolation="nearest")
            place.set_title(title, fontsize=10)
            place.set(xticks=[], yticks=[])
            path = folder / "images" / f"rods-{name}-{kind}.png"
            images.write_png(path, (255 * rgb + 0.5).astype(np.uint8))
            paths.append(path)
    figure.suptitle(f"Rod marching, {rods.SCENE}, {size[0]}×{size[1]} pixels", x=0.01, ha="left", fontsize=12)
    with matplotlib.rc_context(STYLE):
        save(figure, folder / "images" / PICTURES, "")
    return [*paths, folder / "images" / f"{PICTURES}.png"]
