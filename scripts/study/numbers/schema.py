"""What the files of several experiments have in common, and verify.json."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal

import msgspec

from study.core import machine, show
from study.core.run_schema import Context
from study.core.schema import File, Record, key
from study.numbers import stats

DEPTH_AGREES = "both miss, or both hit with |Δt| ≤ 1e-3·t"
DT_P99 = "99th percentile of |Δt| where both hit the same shape"


class Range(Record, kw_only=True):
    """A figure with its 95 % interval, in the figure's unit."""

    value: Annotated[float | None, key("", "the figure: a median over launches, or a ratio of two")]
    low: Annotated[float | None, key("", "lower end; null: not known")]
    high: Annotated[float | None, key("", "upper end; null: not known")]

    @classmethod
    def of(cls, found: stats.Interval) -> Range:
        """The interval as files have it: null for what is not finite."""
        return cls(**_ends(found))

    @property
    def ends(self) -> tuple[float, float, float]:
        """Value, low and high; NaN for null."""
        value, low, high = (math.nan if one is None else one for one in (self.value, self.low, self.high))
        return value, low, high


class Interval(Range, kw_only=True):
    """A figure with its 95 % interval, in the figure's unit, and the launches behind it."""

    launches: Annotated[int, key("launches", "of a ratio the smaller number")]
    sufficient: Annotated[bool, key("", "whether there were enough for an interval (6)")]

    @classmethod
    def of(cls, found: stats.Interval) -> Interval:
        return cls(**_ends(found), launches=found.launches, sufficient=found.sufficient)


def _ends(found: stats.Interval) -> dict[str, float | None]:
    ends = (one if math.isfinite(one) else None for one in found.ends)
    return dict(zip(("value", "low", "high"), ends, strict=True))


class Skipped(Record, kw_only=True):
    """What was left out or failed, named by the keys of a row (phase, scene …)."""

    phase: Annotated[str | None, key("", "of what")] = None
    scene: Annotated[str | None, key("", "on which scene; null: all")] = None
    reason: Annotated[str, key("", "why, in one sentence")]


class Result(File):
    """A file that an experiment writes into a run."""


class Measured(Result, kw_only=True):
    """A file of an experiment, with what made it."""

    schema: Annotated[Literal[1], key("", "version of the form")]
    launches: Annotated[int | None, key("launches", "of each program")] = None
    seed: Annotated[int | None, key("", "of the order and of the padding")] = None
    cpu: Annotated[int | None, key("", "CPU that processes of one thread were pinned to")] = None
    took_s: Annotated[float | None, key("s", "that the experiment took")] = None
    context: Annotated[Context | None, key("", "where and of what it was made, as context.json")] = None

    @property
    def machine(self) -> str:
        return machine.name(self.context)


class PictureErrors(Record, kw_only=True):
    """Errors of a picture to its reference. Of fractals, pictures are averaged over 4×4 samples first."""

    psnr_db: Annotated[float | None, key("dB", "linear RGB in [0, 1]; null: infinite beside an RMSE")]
    rmse: Annotated[float | None, key("linear RGB", "root mean square error")]
    fraction_over_1_255: Annotated[float | None, key("share of pixels", "off by over 1/255")] = None
    averaged: Annotated[bool | None, key("", "whether of 4×4 means")] = None
    wrong_ppm: Annotated[float | None, key("ppm", "pixels whose hit, miss or shape is wrong")] = None
    depth_agree_fraction: Annotated[float | None, key("share of pixels", DEPTH_AGREES)] = None
    non_finite: Annotated[int | None, key("samples", "NaN or infinite where none may be")] = None

    @property
    def level(self) -> float:
        """PSNR in dB: infinite of identical pictures, NaN of one that is not finite."""
        return math.nan if self.rmse is None else math.inf if self.psnr_db is None else self.psnr_db

    @property
    def psnr(self) -> str:
        """The level in a cell: `60.9`, `60.9 (4×4 means)`, `identical` or `not finite`."""
        if math.isnan(self.level):
            return "not finite"
        means = " (4×4 means)" if self.averaged else ""
        return ("identical" if math.isinf(self.level) else show.number(self.level)) + means


class Antialiased(Record, kw_only=True):
    """Errors of pictures averaged over 4×4 samples."""

    psnr_db: Annotated[float | None, key("dB", "linear RGB; null: infinite")]
    rmse: Annotated[float | None, key("linear RGB", "root mean square error")] = None
    fraction_over_1_255: Annotated[float | None, key("share of pixels", "any channel off by over 1/255")]
    non_finite: Annotated[int | None, key("samples", "NaN or infinite where none may be")] = None


class Pair(Record, kw_only=True):
    """A phase's picture of a scene beside the reference's. The gate goes from hits to colours."""

    phase: Annotated[str, key("", "the phase, or phase@phase")]
    reference: Annotated[str | None, key("", "whose picture it is held against")] = None
    scene: Annotated[str, key("", "its name")]
    kind: Annotated[str | None, key("", "`fractal` where there is one, else `smooth`")] = msgspec.field(
        name="class", default=None
    )
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    height: Annotated[int, key("pixels", "of the picture", ge=1)]
    identical: Annotated[bool | None, key("", "every channel is equal bit for bit")] = None
    non_finite: Annotated[int | None, key("samples", "NaN or infinite in either; must be 0")] = None
    mask_mismatch_ppm: Annotated[float | None, key("ppm", "hit against miss")] = None
    id_mismatch_ppm: Annotated[float | None, key("ppm", "another shape where both hit")] = None
    dt_p99: Annotated[float | None, key("scene units", DT_P99)] = None
    dt_max: Annotated[float | None, key("scene units", "its maximum")] = None
    normal_p99_degrees: Annotated[float | None, key("degrees", "99th percentile between normals")] = None
    depth_agree_fraction: Annotated[float | None, key("share of pixels", DEPTH_AGREES)] = None
    psnr_db: Annotated[float | None, key("dB", "linear RGB in [0, 1]; null: infinite")] = None
    rmse: Annotated[float | None, key("linear RGB", "root mean square error")] = None
    fraction_over_1_255: Annotated[float | None, key("share of pixels", "off by over 1/255")] = None
    max_abs: Annotated[float | None, key("linear RGB", "largest difference, not clamped")] = None
    psnr_display_db: Annotated[float | None, key("dB", "after c^0.4545 and 8 bits")] = None
    fraction_over_1_255_display: Annotated[float | None, key("share of pixels", "the same of these")] = None
    flip_mean: Annotated[float | None, key("", "FLIP of the display pictures, mean")] = None
    flip_max: Annotated[float | None, key("", "its maximum")] = None
    antialiased: Annotated[Antialiased | None, key("", "the same of 4×4 means, fractals")] = None
    tolerance: Annotated[dict[str, Any] | None, key("", "as its phase.json declares it")] = None
    failed: Annotated[list[str] | None, key("", "metrics outside of it")] = None
    why: Annotated[list[str] | None, key("", "the same in words")] = None
    within_tolerance: Annotated[bool | None, key("", "null: `left_to` judges it")] = None
    left_to: Annotated[str | None, key("", "command that judges a phase which declares `truth` alone")] = None
    reference_sha256: Annotated[str | None, key("", "of the reference's picture")] = None
    sha256: Annotated[str | None, key("", "of the phase's picture")] = None
    reference_binary_sha256: Annotated[str | None, key("", "of the reference's program")] = None
    binary_sha256: Annotated[str | None, key("", "of the phase's program")] = None
    reference_image: Annotated[str | None, key("", "float EXR below the run")] = None
    reference_png: Annotated[str | None, key("", "as displayed")] = None
    image: Annotated[str | None, key("", "float EXR below the run")] = None
    png: Annotated[str | None, key("", "as displayed")] = None
    reference_antialiased_png: Annotated[str | None, key("", "4×4 means as displayed")] = None
    antialiased_png: Annotated[str | None, key("", "4×4 means as displayed")] = None
    heatmap: Annotated[str | None, key("", "where the differences are")] = None
    beside: Annotated[bool, key("", "a parent's row, to compare with and not judged")] = False


class Verify(Result, kw_only=True):
    """Pictures of every phase against baseline's: hits, depths, normals, colours, FLIP.

    The gate goes in this order: hash, mask and shape, depth and normal, linear picture, FLIP. NaN never
    passes: `non_finite` must be 0, whatever a phase declares.
    """

    made_by: ClassVar[str] = "verify"
    schema: Annotated[Literal[1] | None, key("", "version of the form")] = None
    reference: Annotated[str | None, key("", "the phase that all are held against")] = None
    flip_tool: Annotated[str | None, key("", "name and version")] = None
    picture_tool: Annotated[str | None, key("", "name and version")] = None
    pairs: Annotated[list[Pair] | None, key("", "one per phase and scene")]
    skipped: Annotated[list[Skipped] | None, key("", "what could not be drawn")] = None
