"""Where the bad pixels lie: classes of pixels by truth's planes, and the picture that shows them."""

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from study.core import show
from study.numbers.accuracy import Row
from study.pictures import images, panels
from study.pictures.images import Picture
from study.truth import judging

# In the order in which they are asked: the first that applies has the pixel.
MEANING = {
    "silhouette": "silhouette: a neighbour shows another shape, or depth jumps",
    "edge": "edge: normals of neighbours on one shape differ",
    "shadow_boundary": "shadow boundary: the shadow differs from a neighbour's",
    "reflection": "reflection: a mirror is seen",
    "interior": "interior: none of these",
}
CLASSES = tuple(MEANING)
# Okabe & Ito's palette, which the colour-blind can tell apart, on a dimmed grey picture.
COLOURS = dict(zip(CLASSES, ("#E69F00", "#56B4E9", "#CC79A7", "#009E73", "#F0E442"), strict=True))
DIM = 0.3  # of the picture under the map
# Faces of boxes, cones and octahedra meet at 70° and more; from pixel to pixel a curved shape turns by less.
CREASE_DEGREES = 30.0
JUMP = 0.05  # of 1/t, off the straight line through its neighbours: a plane's 1/t is one
FEW = 0.01  # share of the map
NONE = -1  # no class: the pixel is not bad
NEIGHBOURS = ((0, 1), (1, 0), (1, 1), (1, -1))  # and their opposites: eight
Pair = tuple[np.ndarray, np.ndarray]


def _differs(test: Callable[..., np.ndarray], *planes: np.ndarray) -> np.ndarray:
    """Pixels for which `test` holds with any of their eight neighbours: both of the two are marked."""
    found = np.zeros(planes[0].shape[:2], bool)
    height, width = found.shape
    for down, right in NEIGHBOURS:
        here = np.s_[: height - down, max(0, -right) : width - max(0, right)]
        there = np.s_[down:, max(0, right) : width + min(0, right)]
        off = test(*((plane[here], plane[there]) for plane in planes))
        found[here] |= off
        found[there] |= off
    return found


def _jumps(truth: Picture) -> np.ndarray:
    """Where depth leaps from one part of a shape to another: a torus over itself, repeated cells."""
    with np.errstate(divide="ignore"):
        inverse = 1 / truth.Z.astype(np.float64)  # 0 on a miss
    found = np.zeros(inverse.shape, bool)
    # Transposed views: what is written to the second is seen in the first.
    for depth, ids, marks in ((inverse, truth.id, found), (inverse.T, truth.id.T, found.T)):
        before, here, after = depth[:, :-2], depth[:, 1:-1], depth[:, 2:]
        same = (ids[:, :-2] == ids[:, 1:-1]) & (ids[:, 1:-1] == ids[:, 2:]) & (ids[:, 1:-1] >= 0)
        most = np.maximum(np.maximum(before, here), after)
        marks[:, 1:-1] |= same & (np.abs(before - 2 * here + after) > JUMP * most)
    return found


def classes(truth: Picture, mirrors: Iterable[int] = ()) -> np.ndarray:
    """Index into CLASSES of every pixel, by truth alone. `mirrors`: ids of the shapes that reflect."""
    ids = truth.id
    normals = np.stack([truth[n] for n in ("N.x", "N.y", "N.z")], axis=-1).astype(np.float64)
    shadow = np.nan_to_num(truth.shadow, nan=1.0)
    least = math.cos(math.radians(CREASE_DEGREES))
    is_silhouette = _differs(lambda pair: pair[0] != pair[1], ids) | _jumps(truth)

    def crease(shapes: Pair, facing: Pair) -> np.ndarray:
        return (shapes[0] == shapes[1]) & (shapes[0] >= 0) & ((facing[0] * facing[1]).sum(-1) < least)

    def step(shapes: Pair, factor: Pair) -> np.ndarray:
        return (shapes[0] == shapes[1]) & (np.abs(factor[0] - factor[1]) > images.ONE_STEP)

    tests = (
        is_silhouette,
        _differs(crease, ids, normals),
        _differs(step, ids, shadow),
        np.isin(ids, list(mirrors)) & (ids >= 0),
    )
    return np.select(tests, range(len(tests)), default=len(tests)).astype(np.int8)


def bad(truth: Picture, image: Picture) -> np.ndarray:
    """Pixels off by more than 1/255 (linear, clamped; any channel), not finite, or with a wrong hit."""
    a, b = images.clamped(images.rgb(truth)), images.clamped(images.rgb(image))
    judged = np.isfinite(a).all(axis=-1)
    finite = np.isfinite(images.rgb(image)).all(axis=-1)
    off = judged & ~(np.abs(a - b).max(axis=-1) <= images.ONE_STEP)
    return off | ~finite | np.any(list(judging.wrong_hits(truth, image).values()), axis=0)


def shares(where: np.ndarray, wrong: np.ndarray) -> dict[str, float]:
    """Bad pixels in all, and the share of them that each class has: 0 where there is none."""
    total = int(wrong.sum())
    counts = np.bincount(where[wrong], minlength=len(CLASSES))
    return {"bad_pixels": total} | {
        f"bad_{name}": float(count) / total if total else 0.0
        for name, count in zip(CLASSES, counts, strict=True)
    }


def painted(truth: Picture, where: np.ndarray, wrong: np.ndarray, factor: int = 1) -> np.ndarray:
    """The map: dimmed truth, bad pixels in their class's colour; a block shows its commonest class if any."""
    height, width = (-(-size // factor) * factor for size in where.shape)
    pad = (0, height - where.shape[0]), (0, width - where.shape[1])
    grey = images.to_display(np.nan_to_num(images.rgb(truth))).mean(axis=-1) / 255 * DIM

    def blocks(plane: np.ndarray, mode: Any) -> np.ndarray:
        padded = np.pad(plane, pad, mode=mode)
        return padded.reshape(height // factor, factor, width // factor, factor).swapaxes(1, 2)

    counts = np.stack(
        [blocks(wrong & (where == i), "constant").sum(axis=(2, 3)) for i in range(len(CLASSES))], axis=-1
    )
    seen = np.where(counts.any(axis=-1), counts.argmax(axis=-1), NONE)
    if few(seen != NONE):
        seen = _grown(seen)
    base = np.repeat(blocks(grey, "edge").mean(axis=(2, 3))[..., None], 3, axis=-1)
    palette = np.array([to_rgb(COLOURS[name]) for name in CLASSES])
    return np.where((seen == NONE)[..., None], base, palette[seen])


def few(marks: np.ndarray) -> bool:
    """Whether so few are marked that each is drawn larger: single pixels of a large picture get lost."""
    return bool(0 < marks.mean() < FEW and marks.shape[1] > 300)


def _grown(seen: np.ndarray) -> np.ndarray:
    """Every mark over its eight neighbours too, where these have none of their own."""
    padded = np.pad(seen, 1, constant_values=NONE)
    height, width = seen.shape
    around = [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return np.where(seen != NONE, seen, np.max(around, axis=0))


def _decibels(value: float) -> str:
    return "identical" if value == math.inf else f"{value:.1f} dB"


def _notes(row: Row) -> tuple[str, str]:
    """What stands under the phase's picture and under truth's."""
    colours, proved = row.colours, f"{100 * row.proved_fraction:.6g} % of the camera rays proved"
    if row.surface:
        exact = row.surface
        proved = f"its exact surface: {100 * exact.proved_fraction:.6g} % of the camera rays proved"
    to = f"PSNR to ground truth {_decibels(colours.psnr_db)}; with the ideal shadow "
    to += _decibels(colours.psnr_ideal_db)
    if row.converged_only:
        agree = f"depth agrees within 0.1 % in {100 * row.depth_agree_fraction:.6g} % of the pixels"
        if row.surface and row.surface.antialiased:
            agree += f"\nto the exact surface {_decibels(row.surface.antialiased.psnr_db)}; ppm: hits lost "
            agree += f"{show.number(row.surface.lost_ppm)}, wrong {show.number(row.surface.wrong_ppm)}"
        status = f"{row.converged_pixels:,} pixels marched: double-double, 104 bits; no proof"
        return f"4×4 averaged, to its march:\n{to}\n{agree}", f"{status}\n{proved}"
    number = show.number
    mine = (
        f"{to}\nppm: false hits {number(row.false_hits_ppm)}, false misses {number(row.false_misses_ppm)}, "
        f"wrong shape {number(row.wrong_shape_ppm)}\n"
        f"|Δt| p99 {number(row.dt_p99)}, max {number(row.dt_max)}; "
        f"normal p99 {number(row.normal_p99_degrees)}°"
    )
    return mine, f"{proved}\n{row.undecided_pixels:,} undecided, left out of the hits"


def figure(
    truth: Picture, image: Picture, title: str, name: str, row: Row, where: np.ndarray, wrong: np.ndarray
) -> Figure:
    """The phase's picture, truth's, and the map of the bad pixels with its legend."""
    height, width = truth.R.shape
    shown = {name: image, "ground truth": truth}
    made, axes = panels.sheet(title, 5.9 * height / width, 1.9, shown, _notes(row), 0.99)
    factor = math.ceil(width / axes[2].get_window_extent().width)
    panels.show(axes[2], painted(truth, where, wrong, factor))
    count = int(wrong.sum())
    share = 100 * count / wrong.size
    axes[2].set_title(
        f"bad pixels: {count:,} ({share:.3g} %), off by > 1/255 or a wrong hit", fontsize=14, loc="left"
    )
    counts = np.bincount(where[wrong], minlength=len(CLASSES))
    handles = [
        Patch(facecolor=COLOURS[c], edgecolor="black", label=f"{n:,} {MEANING[c]}")
        for c, n in zip(CLASSES, counts, strict=True)
    ]
    spot = axes[2].get_position()
    made.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(spot.x0 - 0.005, spot.y0),
        frameon=False,
        fontsize=11,
        title="few bad pixels of a large picture are drawn larger" if few(wrong) else None,
        alignment="left",
    )
    return made
