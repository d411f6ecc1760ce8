"""views.json."""

import math
from typing import Annotated, ClassVar

from study.core.schema import Record, key
from study.numbers.schema import Interval, Measured, Skipped


def decibels(psnr_db: float | None, rmse: float | None) -> float:
    """JSON's null is infinite where the RMSE is a number, else NaN."""
    return psnr_db if psnr_db is not None else math.nan if rmse is None else math.inf


class Row(Record, kw_only=True):
    """One phase and view of a scene, on one thread."""

    phase: Annotated[str, key("", "its name")]
    parent: Annotated[str | None, key("", "the phase before it")]
    scene: Annotated[str, key("", "its name")]
    view: Annotated[str, key("", "own, left, right or near")]
    change: Annotated[str, key("", "what was done to the camera")]
    tuned: Annotated[bool, key("", "whether constants may be tuned on it")]
    width: Annotated[int, key("pixels", "of the timed picture", ge=1)]
    n: Annotated[int, key("pixels", "its height", ge=1)]
    ns: Annotated[list[float], key("ns", "one per process launch: median of its timed frames")]
    general: Annotated[str | None, key("", "why no code was generated for it; else null")] = None
    ms: Annotated[Interval, key("ms", "a frame")]
    ratio: Annotated[Interval | None, key("×", "parent's time over this one's; null: no parent")]
    reference: Annotated[str | None, key("", "`truth`, else `baseline`; null: it is the reference")] = None
    psnr_db: Annotated[float | None, key("dB", "at `error_n`; null with an RMSE: infinite")] = None
    rmse: Annotated[float | None, key("linear RGB", "of fractals over 4×4 means")] = None
    psnr_ideal_db: Annotated[float | None, key("dB", "to truth with the ideal shadow")] = None
    rmse_ideal: Annotated[float | None, key("linear RGB", "to truth with the ideal shadow")] = None
    wrong_ppm: Annotated[float | None, key("ppm", "hit, miss or shape wrong")] = None
    depth_agree_fraction: Annotated[float | None, key("share of pixels", "of fractals")] = None
    non_finite: Annotated[int | None, key("samples", "NaN or infinite where none may be")] = None

    @property
    def ends(self) -> tuple[float, float, float]:
        """The ratio to the parent and its interval."""
        return self.ratio.ends if self.ratio else (math.nan,) * 3

    @property
    def wins(self) -> bool:
        """A phase that ran its parent's code, its general one, gains nothing: a ratio beside 1 is noise."""
        return not self.general and self.ends[1] > 1

    @property
    def loses(self) -> bool:
        return self.ends[2] < 1

    @property
    def level(self) -> float:
        return decibels(self.psnr_db, self.rmse)


class Furthest(Record, kw_only=True):
    """Where a phase is furthest from a reference, over the views."""

    scene: Annotated[str, key("", "there")]
    view: Annotated[str, key("", "there")]
    no_value: Annotated[bool, key("", "whether no PSNR is known there")]
    psnr_db: Annotated[float | None, key("dB", "there")]
    parent_db: Annotated[float | None, key("dB", "its parent's, there")]
    parent_is_reference: Annotated[bool, key("", "so that it has none")]


class Gain(Record, kw_only=True):
    """A phase over all views. Its parent's time over its own, per view."""

    phase: Annotated[str, key("", "its name")]
    parent: Annotated[str, key("", "the phase before it")]
    views: Annotated[int, key("views", "measured that nothing was tuned on")]
    tuned: Annotated[dict[str, Interval | None], key("×", "ratios of the tuned views, by scene")]
    median: Annotated[Interval | None, key("×", "over the other views; launches of each drawn anew")]
    worst: Annotated[Interval | None, key("×", "the worst of them")]
    worst_scene: Annotated[str | None, key("", "there")] = None
    worst_view: Annotated[str | None, key("", "there")] = None
    slower: Annotated[int, key("views", "whose whole interval is under 1")]
    to_truth: Annotated[Furthest | None, key("", "furthest from ground truth")]
    to_base: Annotated[Furthest | None, key("", "furthest from baseline")]
    wrong_ppm: Annotated[float | None, key("ppm", "the most of any view")] = None
    general: Annotated[int, key("views", "on which no code was generated")] = 0
    verdict: Annotated[str, key("", "in words")]


class LeftOut(Skipped, kw_only=True):
    """What the time did not suffice for, or a phase refuses."""

    view: Annotated[str | None, key("", "of the scene")] = None


class Views(Measured, kw_only=True):
    """Every phase against its parent on views that nothing was tuned on."""

    made_by: ClassVar[str] = "views"
    n: Annotated[int, key("pixels", "height of the timed pictures")]
    error_n: Annotated[int, key("pixels", "height of those that errors are of")]
    seconds: Annotated[float | None, key("s", "allowed")] = None
    reference: Annotated[str | None, key("", "where truth is not had")] = None
    rows: Annotated[list[Row], key("", "the views", min_length=1)]
    steps: Annotated[list[Gain], key("", "phases that have a parent")]
    left_out: Annotated[list[LeftOut], key("", "what the seconds did not suffice for")]
    failures: Annotated[list[LeftOut], key("", "crashes")]


SCHEMAS = {"views.json": Views}
