"""What the files of several experiments have in common, and verify.json."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal

import msgspec

from study.core import machine, show
from study.core.run_schema import Context
from study.core.schema import ABSENT, Absent, File, Record, key
from study.numbers import stats


class Interval(Record, kw_only=True):
    """A figure with its 95 % interval, in the figure's unit."""

    value: Annotated[float | None, key("", "median over process launches, or a ratio of two medians")]
    low: Annotated[float | None, key("", "lower end; null: not known")]
    high: Annotated[float | None, key("", "upper end; null: not known")]
    launches: Annotated[int, key("launches", "behind it; of a ratio the smaller number")]
    sufficient: Annotated[bool, key("", "whether there were enough for an interval (6)")]

    @classmethod
    def of(cls, found: stats.Interval) -> Interval:
        """As files have it: null for what is not finite."""
        value, low, high = (
            one if math.isfinite(one) else None for one in (found.value, found.low, found.high)
        )
        return cls(value=value, low=low, high=high, launches=found.launches, sufficient=found.sufficient)

    @property
    def ends(self) -> tuple[float, float, float]:
        """Value, low and high; NaN for null."""
        value, low, high = (math.nan if one is None else one for one in (self.value, self.low, self.high))
        return value, low, high


class Range(Record, kw_only=True):
    """A figure with its 95 % interval, in the figure's unit."""

    value: Annotated[float | None, key("", "the figure")]
    low: Annotated[float | None, key("", "lower end; null: not known")]
    high: Annotated[float | None, key("", "upper end; null: not known")]


class Skipped(Record, kw_only=True):
    """What was left out or failed, named by the keys of a row (phase, scene …)."""

    phase: Annotated[str | Absent | None, key("", "of what")] = ABSENT
    scene: Annotated[str | Absent | None, key("", "on which scene; null: all")] = ABSENT
    reason: Annotated[str, key("", "why, in one sentence")]


class Result(File):
    """A file that an experiment writes into a run."""


class Measured(Result, kw_only=True):
    """A file of an experiment, with what made it."""

    schema: Annotated[Literal[1], key("", "version of the form")]
    launches: Annotated[int | Absent, key("launches", "of each program")] = ABSENT
    seed: Annotated[int | Absent, key("", "of the order and of the padding")] = ABSENT
    cpu: Annotated[int | Absent | None, key("", "CPU that processes of one thread were pinned to")] = ABSENT
    took_s: Annotated[float | Absent, key("s", "that the experiment took")] = ABSENT
    context: Annotated[Context | Absent | None, key("", "where and of what it was made, as context.json")] = (
        ABSENT
    )

    @property
    def machine(self) -> str:
        """The name of its CPU."""
        return machine.name(self.context or None)


class PictureErrors(Record, kw_only=True):
    """Errors of a picture to its reference. Of fractals, pictures are averaged over 4×4 samples first."""

    psnr_db: Annotated[
        float | None, key("dB", "linear RGB in [0, 1]; null: infinite, where there is an RMSE")
    ]
    rmse: Annotated[float | None, key("linear RGB", "root mean square error")]
    fraction_over_1_255: Annotated[
        float | Absent | None, key("share of pixels", "any channel off by over 1/255")
    ] = ABSENT
    averaged: Annotated[bool | Absent, key("", "whether of 4×4 means")] = ABSENT
    wrong_ppm: Annotated[float | Absent | None, key("ppm", "pixels whose hit, miss or shape is wrong")] = (
        ABSENT
    )
    depth_agree_fraction: Annotated[
        float | Absent | None, key("share of pixels", "both miss, or both hit with |Δt| ≤ 1e-3·t")
    ] = ABSENT
    non_finite: Annotated[int | Absent, key("samples", "NaN or infinite where none may be")] = ABSENT

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


class HitErrors(Record, kw_only=True):
    """Errors of hits to ground truth, over the pixels whose camera ray truth proves."""

    evaluations: Annotated[float | Absent | None, key("evaluations/pixel", "of the scene's distance")] = (
        ABSENT
    )
    judged: Annotated[float | Absent | None, key("share of pixels", "whose hits are judged")] = ABSENT
    known: Annotated[float | Absent | None, key("share of pixels", "whose colour truth knows")] = ABSENT
    false_hits_ppm: Annotated[float | Absent | None, key("ppm", "hit where truth misses")] = ABSENT
    false_misses_ppm: Annotated[float | Absent | None, key("ppm", "miss where truth hits")] = ABSENT
    wrong_shape_ppm: Annotated[float | Absent | None, key("ppm", "another shape where both hit")] = ABSENT
    wrong_ppm: Annotated[float | Absent | None, key("ppm", "the three together")] = ABSENT
    dt_p50: Annotated[
        float | Absent | None, key("scene units", "median of |Δt| where the shape is right")
    ] = ABSENT
    dt_p99: Annotated[float | Absent | None, key("scene units", "99th percentile of it")] = ABSENT
    dt_p100: Annotated[float | Absent | None, key("scene units", "its maximum")] = ABSENT
    psnr_db: Annotated[float | Absent | None, key("dB", "shaded picture to truth; null: identical")] = ABSENT
    non_finite: Annotated[int | Absent, key("samples", "NaN or infinite where none may be")] = ABSENT


Ms = Annotated[float | Absent | None, key("ms", "median over process launches")]
MsLow = Annotated[float | Absent | None, key("ms", "lower end, 95 %")]
MsHigh = Annotated[float | Absent | None, key("ms", "upper end")]
MsLaunches = Annotated[list[float] | Absent, key("ms", "one per process launch")]
Times = Annotated[float | Absent | None, key("×", "time of the other over this one's")]
TimesLow = Annotated[float | Absent | None, key("×", "lower end, 95 %")]
TimesHigh = Annotated[float | Absent | None, key("×", "upper end")]


class Timed(Record, kw_only=True):
    """A time with its 95 % interval."""

    ms: Ms = ABSENT
    ms_low: MsLow = ABSENT
    ms_high: MsHigh = ABSENT
    launches: MsLaunches = ABSENT


class TimedErrors(HitErrors, kw_only=True):
    """A time with its 95 % interval, and errors of hits to ground truth."""

    ms: Ms = ABSENT
    ms_low: MsLow = ABSENT
    ms_high: MsHigh = ABSENT
    launches: MsLaunches = ABSENT


class Gain(Record, kw_only=True):
    """A ratio of times with its 95 % interval."""

    gain: Times = ABSENT
    gain_low: TimesLow = ABSENT
    gain_high: TimesHigh = ABSENT


class Antialiased(Record, kw_only=True):
    """Errors of pictures averaged over 4×4 samples."""

    psnr_db: Annotated[float | None, key("dB", "linear RGB; null: infinite")]
    rmse: Annotated[float | Absent | None, key("linear RGB", "root mean square error")] = ABSENT
    fraction_over_1_255: Annotated[float | None, key("share of pixels", "any channel off by over 1/255")]
    non_finite: Annotated[int | Absent, key("samples", "NaN or infinite where none may be")] = ABSENT


class Pair(Record, kw_only=True):
    """A phase's picture of a scene beside the reference's. The gate goes from hits to colours."""

    phase: Annotated[str, key("", "the phase, or phase@phase")]
    reference: Annotated[str | Absent, key("", "whose picture it is held against")] = ABSENT
    scene: Annotated[str, key("", "its name")]
    kind: Annotated[str | Absent, key("", "`fractal` where there is one, else `smooth`")] = msgspec.field(
        name="class", default=ABSENT
    )
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    height: Annotated[int, key("pixels", "of the picture", ge=1)]
    identical: Annotated[bool | Absent, key("", "every channel is equal bit for bit")] = ABSENT
    non_finite: Annotated[
        int | Absent, key("samples", "NaN or infinite where none may be, in either picture; must be 0")
    ] = ABSENT
    mask_mismatch_ppm: Annotated[float | Absent | None, key("ppm", "hit against miss")] = ABSENT
    id_mismatch_ppm: Annotated[float | Absent | None, key("ppm", "another shape where both hit")] = ABSENT
    dt_p99: Annotated[
        float | Absent | None, key("scene units", "99th percentile of |Δt| where both hit the same shape")
    ] = ABSENT
    dt_max: Annotated[float | Absent | None, key("scene units", "its maximum")] = ABSENT
    normal_p99_degrees: Annotated[
        float | Absent | None,
        key("degrees", "99th percentile of the angle between normals; not of unit length: 180"),
    ] = ABSENT
    depth_agree_fraction: Annotated[
        float | Absent | None, key("share of pixels", "both miss, or both hit with |Δt| ≤ 1e-3·t")
    ] = ABSENT
    psnr_db: Annotated[float | Absent | None, key("dB", "linear RGB in [0, 1]; null: infinite")] = ABSENT
    rmse: Annotated[float | Absent | None, key("linear RGB", "root mean square error")] = ABSENT
    fraction_over_1_255: Annotated[
        float | Absent | None, key("share of pixels", "any channel off by over 1/255")
    ] = ABSENT
    max_abs: Annotated[float | Absent | None, key("linear RGB", "largest difference, not clamped")] = ABSENT
    psnr_display_db: Annotated[float | Absent | None, key("dB", "after c^0.4545 and 8 bits")] = ABSENT
    fraction_over_1_255_display: Annotated[
        float | Absent | None, key("share of pixels", "the same of these")
    ] = ABSENT
    flip_mean: Annotated[float | Absent | None, key("", "FLIP of the display pictures, mean")] = ABSENT
    flip_max: Annotated[float | Absent | None, key("", "its maximum")] = ABSENT
    antialiased: Annotated[Antialiased | Absent | None, key("", "the same of 4×4 means, fractals")] = ABSENT
    tolerance: Annotated[
        dict[str, Any] | Absent | None, key("", "as phases/NAME/phase.json declares it, with its reason")
    ] = ABSENT
    failed: Annotated[list[str] | Absent | None, key("", "metrics outside of it")] = ABSENT
    why: Annotated[list[str] | Absent | None, key("", "the same in words")] = ABSENT
    within_tolerance: Annotated[bool | Absent | None, key("", "null: `left_to` judges it")] = ABSENT
    left_to: Annotated[str | Absent, key("", "command that judges a phase which declares `truth` alone")] = (
        ABSENT
    )
    reference_sha256: Annotated[str | Absent, key("", "of the reference's picture")] = ABSENT
    sha256: Annotated[str | Absent, key("", "of the phase's picture")] = ABSENT
    reference_binary_sha256: Annotated[str | Absent, key("", "of the reference's program")] = ABSENT
    binary_sha256: Annotated[str | Absent, key("", "of the phase's program")] = ABSENT
    reference_image: Annotated[str | Absent, key("", "float EXR below the run")] = ABSENT
    reference_png: Annotated[str | Absent, key("", "as displayed")] = ABSENT
    image: Annotated[str | Absent, key("", "float EXR below the run")] = ABSENT
    png: Annotated[str | Absent, key("", "as displayed")] = ABSENT
    reference_antialiased_png: Annotated[str | Absent, key("", "4×4 means as displayed")] = ABSENT
    antialiased_png: Annotated[str | Absent, key("", "4×4 means as displayed")] = ABSENT
    heatmap: Annotated[str | Absent, key("", "where the differences are")] = ABSENT


class Verify(Result, kw_only=True):
    """Pictures of every phase against baseline's: hits, depths, normals, colours, FLIP.

    The gate goes in this order: hash, mask and shape, depth and normal, linear picture, FLIP. NaN never
    passes: `non_finite` must be 0, whatever a phase declares.
    """

    made_by: ClassVar[str] = "verify"
    schema: Annotated[Literal[1] | Absent, key("", "version of the form")] = ABSENT
    reference: Annotated[str | Absent, key("", "the phase that all are held against")] = ABSENT
    flip_tool: Annotated[str | Absent, key("", "name and version")] = ABSENT
    picture_tool: Annotated[str | Absent, key("", "name and version")] = ABSENT
    pairs: Annotated[list[Pair] | None, key("", "one per phase and scene")]
    skipped: Annotated[list[Skipped] | Absent, key("", "what could not be drawn")] = ABSENT
