"""A phase's picture with all its planes, and how far it is from ground truth's or from another's."""

import math
from typing import Any

import numpy as np

from study.core import cli, run, temporary
from study.core.registry import Scene
from study.core.schema import Record
from study.measuring.launches import Size, Told
from study.measuring.schema import HitErrors
from study.pictures import images
from study.pictures.images import Picture
from study.truth import judging, truth

FACTOR = judging.FACTOR
Errors = dict[str, Any]  # keys of PictureErrors


def picture(phase: str, scene: Scene, size: Size, told: Told | None = None, **more: Any) -> Picture:
    with temporary.folder() as scratch:
        out = scratch / "picture.exr"
        run.render(phase, scene.path, size[1], size[0], aov=True, out=out, timed=False, told=told, **more)
        return images.read(out)


def decibels(square: float) -> float | None:
    """PSNR in dB of a mean squared error of colours in [0, 1]; None: identical. NaN is NaN."""
    return None if square == 0 else float(-10 * np.log10(square))


def errors(exact: Picture, made: Picture) -> HitErrors:
    """Errors of the pixels that truth proves; where it proves none, of those it marched."""
    least = judging.PROVED if (exact.status == judging.PROVED).any() else judging.MARCHED
    count = int((exact.status >= least).sum())
    off = judging.right_distances(exact, made, least)
    p50, p99, most = np.percentile(off, (50, 99, 100)).tolist() if off.size else (None, None, None)
    wrong = {
        kind: float(mask.sum() / count * 1e6) if count else math.nan
        for kind, mask in judging.wrong_hits(exact, made, least).items()
    }
    a, b = (images.clamped(images.rgb(p)).astype(float) for p in (exact, made))
    seen = np.isfinite(a).all(axis=-1) & (exact.chain >= truth.MARCHED)
    square = float(np.mean((a[seen] - b[seen]) ** 2)) if seen.any() else math.nan
    return HitErrors(
        evaluations=float((made.evals + made.get("rods", 0)).mean()),
        judged=count / exact.status.size,
        known=float((exact.status >= truth.MARCHED).mean()),
        **{f"{kind}_ppm": value for kind, value in wrong.items()},
        wrong_ppm=sum(wrong.values()),
        dt_p50=p50,
        dt_p99=p99,
        dt_p100=most,
        psnr_db=decibels(square),
        non_finite=images.non_finite(made),
    )


def to_truth(exact: Picture, image: Picture) -> Errors:
    """Errors, those to the ideal shadow too; `wrong_ppm` is of the pixels that truth proves."""
    found = judging.metrics(exact, image)
    kept = {name: found[name] for name in ("psnr_db", "rmse", "psnr_ideal_db", "rmse_ideal", "non_finite")}
    wrong = sum(found[f"{name}_ppm"] for name in ("false_hits", "false_misses", "wrong_shape"))
    return cli.plain(kept | {"wrong_ppm": wrong})


def to_picture(reference: Picture, image: Picture, fractal: bool = False) -> Errors:
    """Errors to another program's picture; of a fractal's 4×4 means, as its single samples are chaotic."""
    base, own = images.rgb(reference), images.rgb(image)
    if fractal:
        base, own = images.box_average(base, FACTOR), images.box_average(own, FACTOR)
    colours = images.colour_errors(base, own, with_flip=False)
    geometry = images.geometry(reference, image)
    return cli.plain(
        {
            **{name: colours[name] for name in ("psnr_db", "rmse", "fraction_over_1_255")},
            "averaged": fractal,
            "wrong_ppm": geometry["mask_mismatch_ppm"] + geometry["id_mismatch_ppm"],
            "depth_agree_fraction": geometry["depth_agree_fraction"],
            "non_finite": images.non_finite(image),
        }
    )


def fitting(kind: type[Record], found: Errors) -> Errors:
    """What of the errors a row of that kind has a key for."""
    return {name: value for name, value in found.items() if name in kind.__struct_fields__}
