"""accuracy.json: errors of each phase to ground truth."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import msgspec

from study.core.schema import ABSENT, Absent, Record, key
from study.numbers.schema import Result, Skipped

FILE = "accuracy.json"


class Colours(Record, kw_only=True):
    """Errors of colours to three pictures of truth: the paper's shadow estimator in exact arithmetic, the
    ideal soft shadow, and no shadows. A null PSNR is infinite where its RMSE is a number."""

    psnr_db: Annotated[
        float | Absent | None, key("dB", "to truth with the paper's estimator, linear RGB")
    ] = ABSENT
    psnr_display_db: Annotated[float | Absent | None, key("dB", "the same as displayed")] = ABSENT
    rmse: Annotated[float | Absent | None, key("linear RGB", "to that truth")] = ABSENT
    fraction_over_1_255: Annotated[float | Absent | None, key("share of pixels", "off by over 1/255")] = (
        ABSENT
    )
    fraction_over_1_255_display: Annotated[float | Absent | None, key("share of pixels", "as displayed")] = (
        ABSENT
    )
    max_abs: Annotated[float | Absent | None, key("linear RGB", "largest difference")] = ABSENT
    psnr_ideal_db: Annotated[float | Absent | None, key("dB", "to truth with the ideal soft shadow")] = ABSENT
    psnr_ideal_display_db: Annotated[float | Absent | None, key("dB", "the same as displayed")] = ABSENT
    rmse_ideal: Annotated[float | Absent | None, key("linear RGB", "to that truth")] = ABSENT
    psnr_none_db: Annotated[float | Absent | None, key("dB", "both without shadows")] = ABSENT
    psnr_none_display_db: Annotated[float | Absent | None, key("dB", "the same as displayed")] = ABSENT
    rmse_none: Annotated[float | Absent | None, key("linear RGB", "both without shadows")] = ABSENT


class Row(Colours, kw_only=True):
    """One phase and scene against ground truth (truth). Colours are of the pixels that truth knows."""

    phase: Annotated[str, key("", "its name")]
    scene: Annotated[str, key("", "its name")]
    kind: Annotated[str | Absent, key("", "`fractal` or `smooth`")] = msgspec.field(
        name="class", default=ABSENT
    )
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    height: Annotated[int, key("pixels", "of the picture", ge=1)]
    precision: Annotated[str | Absent | None, key("", "float or double")] = ABSENT
    converged_only: Annotated[
        bool | Absent, key("", "a fractal: judged by `antialiased` and `depth_agree_fraction`")
    ] = ABSENT
    non_finite: Annotated[int | Absent | None, key("samples", "NaN or infinite where none may be")] = ABSENT
    proved_fraction: Annotated[float | Absent | None, key("share of pixels", "camera ray proved")] = ABSENT
    proved_chain_fraction: Annotated[
        float | Absent | None, key("share of pixels", "and every mirror ray")
    ] = ABSENT
    converged_pixels: Annotated[int | Absent | None, key("pixels", "camera ray converged only")] = ABSENT
    undecided_pixels: Annotated[int | Absent | None, key("pixels", "camera ray neither")] = ABSENT
    unjudged_colours: Annotated[int | Absent | None, key("pixels", "for which truth has no colour")] = ABSENT
    false_hits_ppm: Annotated[float | None, key("ppm", "of proved pixels: hit where truth misses")]
    false_misses_ppm: Annotated[float | Absent | None, key("ppm", "miss where truth hits")] = ABSENT
    wrong_shape_ppm: Annotated[float | Absent | None, key("ppm", "another shape where both hit")] = ABSENT
    beyond_outlines: Annotated[
        dict[str, float | None] | Absent | None,
        key("ppm", "wrong hits further than `outline_pixels` from truth's shape; null: not declared"),
    ] = ABSENT
    dt_p99: Annotated[
        float | Absent | None, key("scene units", "99th percentile of |Δt| where both hit the same shape")
    ] = ABSENT
    dt_max: Annotated[float | Absent | None, key("scene units", "its maximum")] = ABSENT
    dt_p99_of_as_many: Annotated[
        float | Absent | None,
        key("scene units", "of as many nearest hits as baseline has right; the gate asks this"),
    ] = ABSENT
    normal_p99_degrees: Annotated[float | Absent | None, key("degrees", "angle between normals there")] = (
        ABSENT
    )
    depth_agree_fraction: Annotated[
        float | Absent | None, key("share of pixels", "both miss, or both hit with |Δt| ≤ 1e-3·t")
    ] = ABSENT
    flip_mean: Annotated[float | Absent | None, key("", "FLIP of the display pictures, mean")] = ABSENT
    flip_max: Annotated[float | Absent | None, key("", "its maximum")] = ABSENT
    antialiased: Annotated[Colours | Absent, key("", "the same errors of 4×4 means, fractals")] = ABSENT
    shadow_rmse: Annotated[
        float | Absent | None, key("linear RGB", "error of what the shadow takes away, estimator")
    ] = ABSENT
    shadow_ideal_rmse: Annotated[float | Absent | None, key("linear RGB", "the same, ideal shadow")] = ABSENT
    bad_pixels: Annotated[int | Absent | None, key("pixels", "off by over 1/255, or a wrong hit")] = ABSENT
    bad_silhouette: Annotated[
        float | Absent | None,
        key("share of bad pixels", "first class that applies: a neighbour has another shape"),
    ] = ABSENT
    bad_edge: Annotated[float | Absent | None, key("share of bad pixels", "normals over 30° apart")] = ABSENT
    bad_shadow_boundary: Annotated[
        float | Absent | None, key("share of bad pixels", "shadow factors over 1/255 apart")
    ] = ABSENT
    bad_reflection: Annotated[float | Absent | None, key("share of bad pixels", "a mirror is seen")] = ABSENT
    bad_interior: Annotated[float | Absent | None, key("share of bad pixels", "none of these")] = ABSENT
    gated: Annotated[bool | Absent | None, key("", "whether the phase can fail (docs/method.md)")] = ABSENT
    judged_by: Annotated[
        str | Absent | None,
        key("", "ideal: the phase draws the ideal shadow and is held against that picture; else estimator"),
    ] = ABSENT
    margins: Annotated[
        dict[str, float | None] | Absent | None,
        key("", "how much further from truth than baseline it may be"),
    ] = ABSENT
    worse: Annotated[
        list[str] | Absent, key("", "metrics worse than baseline's by what three digits show")
    ] = ABSENT
    why: Annotated[list[str] | Absent, key("", "what is outside of the margins")] = ABSENT
    failed: Annotated[bool | Absent | None, key("", "whether anything is")] = ABSENT
    binary_sha256: Annotated[str | Absent, key("", "of the program")] = ABSENT
    truth_sha256: Annotated[str | Absent, key("", "of truth's picture")] = ABSENT
    picture: Annotated[str | Absent, key("", "side by side, below the run")] = ABSENT


class Left(Skipped, kw_only=True):
    """What could not be had."""

    failed: Annotated[bool | Absent, key("", "because it crashed")] = ABSENT


class Agreement(Record, kw_only=True):
    """Of two pictures of the Mandelbulb: hits, and colours of 4×4 means."""

    depth_agree_fraction: Annotated[float | None, key("share of pixels", "as above")]
    mask_mismatch_ppm: Annotated[float | Absent | None, key("ppm", "hit against miss")] = ABSENT
    dt_p99: Annotated[float | Absent | None, key("scene units", "as above")] = ABSENT
    psnr_db: Annotated[float | None, key("dB", "null with an RMSE: infinite")]
    rmse: Annotated[float | None, key("linear RGB", "root mean square error")]


class Precision(Record, kw_only=True):
    """The Mandelbulb at one precision and hit distance. Quad is truth's double-double, of about 31 digits."""

    precision: Annotated[str, key("", "float, double or quad")]
    phase: Annotated[str | Absent, key("", "that drew it")] = ABSENT
    hit_distance: Annotated[float, key("scene units", "as used")]
    evals_per_ray: Annotated[float | Absent | None, key("evaluations", "mean over camera rays")] = ABSENT
    non_finite: Annotated[int | Absent, key("samples", "NaN or infinite where none may be")] = ABSENT
    quad: Annotated[Agreement | Absent, key("", "with quad at the same hit distance")] = ABSENT
    double: Annotated[Agreement | Absent, key("", "with double at the same hit distance")] = ABSENT
    finest: Annotated[Agreement | Absent, key("", "with quad at the least hit distance")] = ABSENT


class Convergence(Record, kw_only=True):
    """The Mandelbulb by precision and hit distance."""

    scene: Annotated[str | Absent, key("", "its name")] = ABSENT
    width: Annotated[int | Absent, key("pixels", "of the pictures")] = ABSENT
    height: Annotated[int | Absent, key("pixels", "of the pictures")] = ABSENT
    averaged: Annotated[list[int] | Absent, key("pixels", "width and height of their 4×4 means")] = ABSENT
    rows: Annotated[list[Precision], key("", "precisions and hit distances")]
    skipped: Annotated[list[Skipped] | Absent, key("", "what could not be drawn")] = ABSENT


class Accuracy(Result, kw_only=True):
    """Errors of each phase to ground truth, per scene.

    A null PSNR is infinite where the RMSE beside it is a number, and no value where that is null too. A
    phase behind opt4 fails where it is further from truth than baseline by more than its margins.
    """

    made_by: ClassVar[str] = "accuracy"
    schema: Annotated[Literal[1] | Absent, key("", "version of the form")] = ABSENT
    flip_tool: Annotated[str | Absent, key("", "name and version")] = ABSENT
    picture_tool: Annotated[str | Absent, key("", "name and version")] = ABSENT
    rows: Annotated[list[Row], key("", "phases and scenes")]
    skipped: Annotated[list[Left] | Absent, key("", "what could not be had")] = ABSENT
    convergence: Annotated[
        Convergence | Absent | None, key("", "the Mandelbulb's table; null: not asked for")
    ] = ABSENT


SCHEMAS = {FILE: Accuracy}


def read(run: Path) -> dict[str, Any]:
    """A run's accuracy.json, PSNR of identical pictures as math.inf again; without that file no row.

    Raises StudyError for another thing's JSON.
    """
    path = Path(run) / FILE
    if not path.exists():
        return {"rows": [], "skipped": [], "convergence": None}
    result = Accuracy.read(path)
    converged = result.get("convergence") or {}
    for row in (*result["rows"], *(converged.get("rows") or ())):
        _restore(row)
    return result


def _restore(row: dict[str, Any]) -> None:
    """JSON has null for infinite and for no value; the RMSE says which of the two it was."""
    for name, value in list(row.items()):
        if isinstance(value, dict):
            _restore(value)
        elif value is None and name.startswith("psnr"):
            rmse = row.get("rmse" + name.removeprefix("psnr").removesuffix("_db").removesuffix("_display"))
            row[name] = math.nan if rmse is None else math.inf
        elif value is None:
            row[name] = math.nan


def rows(run: Path) -> list[dict[str, Any]]:
    """Rows of a run's accuracy.json, one per phase and scene."""
    return read(run)["rows"]
