"""A phase's picture with all its planes, and how far it is from ground truth."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from study.core import run, temporary
from study.core.registry import Scene
from study.measuring.launches import Size, Told
from study.measuring.schema import HitErrors
from study.pictures import images
from study.pictures.images import Picture
from study.truth import judging, truth


def picture(phase: str, scene: Scene, size: Size, told: Told | None = None, **more: Any) -> Picture:
    """All planes of a frame. Raises StudyError."""
    with temporary.folder() as scratch:
        out = scratch / "picture.exr"
        run.render(phase, scene.path, size[1], size[0], aov=True, out=out, timed=False, told=told, **more)
        return images.read(out)


def decibels(square: float) -> float | None:
    """PSNR in dB of a mean squared error of colours in [0, 1]; None: identical. NaN is NaN."""
    return None if square == 0 else float(-10 * np.log10(square))


def errors(exact: Picture, made: Picture) -> HitErrors:
    """Errors of the pixels that truth proves; where it proves none, of those that converged."""
    least = judging.PROVED if (exact["status"] == judging.PROVED).any() else judging.CONVERGED
    count = int((exact["status"] >= least).sum())
    off = judging.right_distances(exact, made, least)
    p50, p99, most = np.percentile(off, (50, 99, 100)).tolist() if off.size else (None, None, None)
    wrong = {
        kind: float(mask.sum() / count * 1e6) if count else math.nan
        for kind, mask in judging.wrong_hits(exact, made, least).items()
    }
    square = mean_square(exact, made, exact["status.all"] >= truth.CONVERGED)
    return HitErrors(
        evaluations=float((made["evals"] + made.get("rods", 0)).mean()),
        judged=count / exact["status"].size,
        known=float((exact["status"] >= truth.CONVERGED).mean()),
        **{f"{kind}_ppm": value for kind, value in wrong.items()},
        wrong_ppm=sum(wrong.values()),
        dt_p50=p50,
        dt_p99=p99,
        dt_p100=most,
        psnr_db=decibels(square),
        non_finite=images.non_finite(made),
    )


def mean_square(one: Picture, other: Picture, known: np.ndarray) -> float:
    """Mean squared difference of clamped colours where `known` and `one` is finite; NaN: nowhere."""
    a, b = (images.clamped(images.rgb(p)).astype(float) for p in (one, other))
    finite = np.isfinite(a).all(axis=-1) & known
    return float(np.mean((a[finite] - b[finite]) ** 2)) if finite.any() else math.nan
