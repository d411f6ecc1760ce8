"""Errors of the pictures of a series: to truth while its seconds last, then to the finest picture."""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from study.core import registry
from study.experiments.scaling.series import Picture, Point, Row, Series, foreseen
from study.pictures import images
from study.truth import judging, truth


def against(reference: images.Picture, image: images.Picture, exact: bool) -> Row:
    """Errors to a reference: truth (`exact`), of whose pixels the proved ones are judged, or a picture."""
    if exact:
        judging.check(reference, image)
        wrong = judging.wrong_hits(reference, image)
        judged = reference["status"] == judging.PROVED
        known = np.isfinite(images.rgb(reference)).all(axis=-1)
        share = sum(int(mask.sum()) for mask in wrong.values()) / max(1, int(judged.sum()))
    else:
        metrics = images.geometry(reference, image)
        share, known = (metrics["mask_mismatch_ppm"] + metrics["id_mismatch_ppm"]) / 1e6, None
    colours = images.colour_errors(images.rgb(reference), images.rgb(image), with_flip=False, judged=known)
    return {"psnr_db": colours["psnr_db"], "rmse": colours["rmse"], "wrong_ppm": 1e6 * share}


class Judge:
    """Errors of the points of one series, x by x: to truth while its time lasts, then to the best of them."""

    def __init__(self, series: Series, pictures: dict[int, Picture], seconds: float) -> None:
        self.series, self.pictures, self.left = series, pictures, seconds
        self.trail: list[tuple[float, float]] = []
        self.truths: dict[tuple, images.Picture | None] = {}

    def truth(self, x: int) -> images.Picture | None:
        """Truth's picture, with the scene's own step cap; None where it would take too long."""
        picture = self.pictures[x]
        key = picture.path, picture.height
        if key not in self.truths:
            self.truths[key] = self._rendered(x, picture)
        return self.truths[key]

    def _rendered(self, x: int, picture: Picture) -> images.Picture | None:
        scene, size = self.series.scene(x), (picture.width, picture.height)
        cached = truth.path_of(scene, size).exists()
        if not cached and self.left <= 0:
            return None
        before = self.trail[-2] if len(self.trail) > 1 else None
        if not cached and self.trail:
            guess = foreseen(before, self.trail[-1], x, self.series.grows)
            if guess > self.left:
                return None
        begun = time.monotonic()
        found = truth.picture(scene, size)
        if not cached:
            took = time.monotonic() - begun
            self.left -= took
            self.trail.append((x, took))
        return found

    def errors(self, x: int, made: dict[Point, Path]) -> dict[Point, Row]:
        """Of the kept pictures of one x: reference, psnr_db, rmse, wrong_ppm."""
        if self.series.scene(x).fractal:
            return {
                point: {
                    "reference": None,
                    "why_none": "a fractal's single samples are chaotic: make accuracy",
                }
                for point in made
            }
        exact = self.truth(x)
        base = None if exact is not None else finest(made)
        reference = exact if base is None else images.read(made[base])
        found = {}
        for point, path in made.items():
            if point == base:
                found[point] = {"reference": None, "why_none": "is the reference here itself"}
            else:
                name = "truth" if base is None else str(base.spec)
                found[point] = {"reference": name, **against(reference, images.read(path), base is None)}
        return found


def finest(made: Iterable[Point]) -> Point:
    """What stands for truth: the first double-precision program on the ladder, else the first of all."""
    points = list(made)
    doubles = [p for p in points if registry.find_phase(p.spec.phase).precision == "double"]
    return (doubles or points)[0]


def seen(path: Path, closed: bool = False) -> Row:
    """What a kept picture says of itself. `closed`: of a phase that meets shapes by closed forms, whose plane
    of evaluations holds a 1 for every camera ray, marched or not: that is no count, and none is given."""
    made = images.read(path)
    return {
        "evals_per_ray": None if closed else float(np.mean(made["evals"], dtype=np.float64)),
        "coverage": float(np.mean(made["id"] >= 0)),
        "non_finite": images.non_finite(made),
    }
