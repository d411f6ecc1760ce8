"""How far a phase's picture is from truth: ray by ray first (hits, shapes, distances, normals), then colours.

Truth (truth.truth) is a picture with more planes: `ideal.*` with the ideal soft shadow, `none.*` without
any, the `shadow` factor of the primary hit, `status` of the primary ray (2 proved, 1 marched, 0 undecided)
and `status.all` of the pixel's whole chain. A Mandelbulb is marched there, in exact arithmetic; `surface.*`
are the planes of its exact surface, hit by proof. Metrics and units: study.numbers.accuracy.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np

from study.core import store
from study.core.registry import Scene
from study.pictures import images
from study.pictures.images import Picture

FACTOR = 4  # of the averaged pictures of fractals, each way: their single samples are chaotic
PROVED, MARCHED = 2, 1  # of the status plane
# Key in the metrics → prefix of truth's planes: the paper's estimator, the ideal shadow, no shadow.
TRUTHS = {"": "", "_ideal": "ideal.", "_none": "none."}
SURFACE = "surface.", "surface.ideal."  # prefixes of the exact surface's colours
NEAR = 1e-3  # scene units: a hit that is off by less is on the surface
GEOMETRY = "dt_p99", "dt_max", "normal_p99_degrees"


def wrong_hits(truth: Picture, image: Picture, least: int = PROVED) -> dict[str, np.ndarray]:
    """Where the picture hits what is not there, misses what is, or hits another shape: masks, of the pixels
    of status `least` and more. A pixel that is neither hit nor miss (NaN, a depth without a shape) is
    wrong."""
    known = truth.status >= least
    return {
        "false_hits": known & truth.miss & ~image.miss,
        "false_misses": known & truth.hit & ~image.hit,
        "wrong_shape": known & truth.hit & image.hit & (truth.id != image.id),
    }


def beyond_outlines(truth: Picture, image: Picture, pixels: int) -> dict[str, float]:
    """false_hits_ppm and wrong_shape_ppm of the proved pixels that have no pixel within so many, along rows
    and columns, where truth sees the shape that the picture has, or that are farther than truth's hit of the
    pixel itself (a miss is infinitely far): a fatter outline lies in front of what is there, and explains
    neither. Both depths are rounded to the planes' floats, so the next float behind truth's is not farther.
    """
    near = np.zeros(truth.id.shape, bool)
    padded = np.pad(truth.id, pixels, mode="edge")
    height, width = near.shape
    for y, x in np.ndindex(2 * pixels + 1, 2 * pixels + 1):
        near |= padded[y : y + height, x : x + width] == image.id
    behind = np.nextafter(truth.Z.astype(np.float32), np.float32(np.inf))
    near &= image["Z"] <= behind
    count, masks = int((truth.status == PROVED).sum()), wrong_hits(truth, image)
    return {
        f"{name}_ppm": 1e6 * float((masks[name] & ~near).sum()) / count if count else math.nan
        for name in ("false_hits", "wrong_shape")
    }


def _hits(truth: Picture, image: Picture) -> dict[str, float]:
    """The errors below the picture, of the proved pixels; NaN where there is none."""
    known = truth.status == PROVED
    count = int(known.sum())
    masks = wrong_hits(truth, image)
    found = {f"{name}_ppm": 1e6 * float(m.sum()) / count if count else math.nan for name, m in masks.items()}
    if not count:
        return found | dict.fromkeys(GEOMETRY, math.nan)
    measured = images.geometry(truth.where(known), image.where(known))
    return found | {name: measured[name] for name in GEOMETRY}


def right_distances(truth: Picture, image: Picture, least: int = PROVED, spacings: int = 0) -> np.ndarray:
    """|Δt| where both hit the same shape, in scene units, ascending; of the pixels of wrong_hits. `spacings`
    of floats at the hit's own depth are forgiven."""
    masks = wrong_hits(truth, image, least)
    right = (truth.status >= least) & (truth.id >= 0) & ~np.any(list(masks.values()), axis=0)
    depth = truth.Z[right].astype(np.float32)
    off = np.abs(depth.astype(np.float64) - image.Z[right])
    return np.sort(np.maximum(off - spacings * np.spacing(depth), 0))


def rounding(truth: Picture, image: Picture) -> float:
    """How much less dt_p99 is if a float spacing at each right hit's own depth is forgiven; 0 of none."""
    off, rest = (right_distances(truth, image, spacings=n) for n in (0, 1))
    return float(np.percentile(off, 99) - np.percentile(rest, 99)) if off.size else 0.0


def dt_p99_of(others: np.ndarray, truth: Picture, image: Picture) -> float:
    """dt_p99 over as many of the picture's right hits as another picture has, or all of fewer; NaN for none,
    but 0 where truth has no hit either: every ray of the scene misses.
    `others`: the other one's right_distances. A picture that hits more of the true hits is not further from
    truth for the grazing ones that it won, so its worst are left out; but none that is further off than every
    hit of the other's, for those it would hide."""
    mine = right_distances(truth, image)
    spare = max(len(mine) - len(others), 0)
    alike = int(np.searchsorted(mine, others[-1], "right")) if len(others) else 0
    kept = np.delete(mine, slice(max(alike - spare, 0), alike))
    if kept.size:
        return float(np.percentile(kept, 99))
    return math.nan if (truth.hit & (truth.status >= PROVED)).any() else 0.0


def _judged(truth: Picture) -> np.ndarray:
    """Pixels whose colours truth knows."""
    return np.all([np.isfinite(images.rgb(truth, prefix)).all(axis=-1) for prefix in TRUTHS.values()], axis=0)


def _colours(
    pictures: list[tuple[np.ndarray, ...]], judged: np.ndarray, factor: int = 1, flip: bool = True
) -> dict[str, float]:
    """Picture metrics to the three truths, of the pixels judged. The first one's are complete. factor > 1:
    averaged first, and of the blocks of which all is judged."""
    found: dict[str, float] = {}
    if factor > 1:
        whole = np.repeat(judged[..., None], 3, axis=-1).astype(np.float32)
        judged = images.box_average(whole, factor)[..., 0] == 1
    for which, (exact, made) in zip(TRUTHS, pictures, strict=False):
        if factor > 1:
            exact, made = (images.box_average(x, factor) for x in (exact, made))
        one = images.colour_errors(exact, made, flip and not which and factor == 1, judged)
        if not which:
            found |= one
        else:
            names = {f"psnr{which}_db": "psnr_db", f"psnr{which}_display_db": "psnr_display_db"}
            found |= {name: one[key] for name, key in (names | {f"rmse{which}": "rmse"}).items()}
    return found


def has_surface(truth: Picture) -> bool:
    """Whether truth has the exact surface of a Mandelbulb in this scene."""
    return "surface.status" in truth and bool(truth["surface.status"].any())


def surface(truth: Picture, image: Picture) -> dict[str, Any] | None:
    """Errors to the exact surface of a Mandelbulb (study.numbers.accuracy.Surface); None of another scene.
    A hit is lost if the picture has it more than NEAR behind the proved one, or none: the march went through
    the surface. It is wrong if it is more than NEAR before it, or hits where nothing is."""
    if not has_surface(truth):
        return None
    proved = truth["surface.status"] == PROVED
    z, made = (p.astype(np.float64) for p in (truth["surface.Z"], image.Z))
    hits = proved & np.isfinite(z)
    lost = hits & ~(made <= z + NEAR)
    wrong = proved & ~lost & ~(made >= z - NEAR)
    right = hits & ~lost & ~wrong
    normals = (
        np.stack([p[f"{at}N.{axis}"][right] for axis in "xyz"], -1).astype(np.float64)
        for p, at in ((truth, SURFACE[0]), (image, ""))
    )
    exact_normals, made_normals = normals
    bulb = exact_normals.any(axis=-1)  # solids have none here
    angles = images.angles(exact_normals[bulb], made_normals[bulb])
    exact = [images.rgb(truth, prefix) for prefix in SURFACE]
    judged = proved & np.all([np.isfinite(x).all(axis=-1) for x in exact], axis=0)
    pairs = [tuple(np.where(judged[..., None], x, 0) for x in (one, images.rgb(image))) for one in exact]
    count = max(int(proved.sum()), 1)
    return {
        "proved_fraction": float(proved.mean()),
        "proved_hits": int(hits.sum()),
        "lost_ppm": 1e6 * float(lost.sum()) / count,
        "wrong_ppm": 1e6 * float(wrong.sum()) / count,
        "normal_p50_degrees": float(np.median(angles)) if angles.size else math.nan,
        **_colours(pairs, judged, flip=False),
        "antialiased": _colours(pairs, judged, FACTOR),
    }


def shadow_rmse(exact: tuple[np.ndarray, np.ndarray], made: tuple[np.ndarray, np.ndarray]) -> float:
    """RMSE between what the shadow takes away in both: colours (with, without) it, linear and clamped."""
    if not exact[0].size or not all(np.isfinite(x).all() for x in (*exact, *made)):
        return math.nan
    taken = [np.subtract(*(images.clamped(x).astype(np.float64) for x in pair)) for pair in (exact, made)]
    return float(np.sqrt(np.mean((taken[0] - taken[1]) ** 2)))


def metrics(
    truth: Picture, image: Picture, unshadowed: Picture | None = None, fractal: bool = False
) -> dict[str, Any]:
    """Every error of a picture to truth. `unshadowed`: the phase's picture of the scene without shadows;
    without it there are no metrics of what shadows do. PSNR of identical pictures is math.inf; NaN is a
    metric that has no value. `fractal`: truth is marched, so the 4 × 4 averaged pictures and the depth are
    judged as well, and `surface` has the errors to the exact surface where there is one."""
    status, judged = truth.status, _judged(truth)

    def known(linear: np.ndarray) -> np.ndarray:
        return np.where(judged[..., None], linear, 0)

    exact = [known(images.rgb(truth, prefix)) for prefix in TRUTHS.values()]
    made = [known(images.rgb(image))] * 2
    if unshadowed is not None:
        made.append(known(images.rgb(unshadowed)))
    pairs = list(zip(exact, made, strict=False))
    found: dict[str, Any] = {
        "converged_only": fractal,
        "non_finite": images.non_finite(image) + (images.non_finite(unshadowed) if unshadowed else 0),
        "proved_fraction": float((status == PROVED).mean()),
        "proved_chain_fraction": float((truth.chain == PROVED).mean()),
        "converged_pixels": int((status == MARCHED).sum()),
        "undecided_pixels": int((~(status >= MARCHED)).sum()),
        "unjudged_colours": int((~judged).sum()),
        **_hits(truth, image),
        **_colours(pairs, judged),
    }
    if unshadowed is not None:
        both = made[0][judged], made[2][judged]
        for name, which in (("shadow_rmse", 0), ("shadow_ideal_rmse", 1)):
            found[name] = shadow_rmse((exact[which][judged], exact[2][judged]), both)
    if fractal:
        decided = status >= MARCHED
        depth = images.geometry(truth.where(decided), image.where(decided)) if decided.any() else {}
        found |= {"depth_agree_fraction": depth.get("depth_agree_fraction", math.nan)}
        found |= {"antialiased": _colours(pairs, judged, FACTOR), "surface": surface(truth, image)}
    return found


def estimator(truth: Picture, fractal: bool = False) -> dict[str, Any]:
    """Errors of the paper's estimator in exact arithmetic: none but those to the ideal shadow."""
    plain = truth | {name: truth["none." + name] for name in "RGB"}
    return metrics(truth, truth, plain, fractal)


def without_shadows(scene: Scene, folder: Path) -> Scene:
    """The same scene with light.shadows "none": itself if it is, else a file NAME-unshadowed.json there."""
    if scene.content.light.shadows == "none":
        return scene
    data = {**scene.data, "light": scene.data["light"] | {"shadows": "none"}}
    path = folder / f"{scene.name}-unshadowed.json"
    if not path.exists() or store.read_json(path) != data:
        store.write_json(path, data)
    return Scene(path.stem, path, data, scene.fractal)


def mirrors(scene: Scene) -> frozenset[int]:
    """Ids of the shapes whose material is a mirror, none where nothing may bounce."""
    content = scene.content
    bounce = content.march.max_bounces > 0
    return frozenset(i for i, one in enumerate(content.of_shapes) if bounce and one.reflectivity > 0)
