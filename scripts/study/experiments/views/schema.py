"""views.json."""

from __future__ import annotations

from typing import Annotated, ClassVar

from study.core.schema import ABSENT, Absent, Record, key
from study.numbers.schema import Interval, Measured, Skipped


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
    general: Annotated[str | Absent | None, key("", "why no code was generated for it; else null")] = ABSENT
    ms: Annotated[Interval, key("ms", "a frame")]
    ratio: Annotated[
        Interval | None, key("×", "the parent's time over this one's, same run; null: no parent")
    ]
    reference: Annotated[
        str | Absent | None,
        key("", "what the errors are to: `truth`, else `baseline`; null: it is the reference"),
    ] = ABSENT
    psnr_db: Annotated[
        float | Absent | None, key("dB", "of a picture at `error_n`; null with an RMSE: infinite")
    ] = ABSENT
    rmse: Annotated[float | Absent | None, key("linear RGB", "of fractals over 4×4 means")] = ABSENT
    psnr_ideal_db: Annotated[float | Absent | None, key("dB", "to truth with the ideal shadow")] = ABSENT
    rmse_ideal: Annotated[float | Absent | None, key("linear RGB", "to truth with the ideal shadow")] = ABSENT
    wrong_ppm: Annotated[float | Absent | None, key("ppm", "hit, miss or shape wrong")] = ABSENT
    depth_agree_fraction: Annotated[float | Absent | None, key("share of pixels", "of fractals")] = ABSENT
    non_finite: Annotated[int | Absent, key("samples", "NaN or infinite where none may be")] = ABSENT


class Furthest(Record, kw_only=True):
    """Where a phase is furthest from a reference, over the views."""

    scene: Annotated[str, key("", "there")]
    view: Annotated[str, key("", "there")]
    no_value: Annotated[bool | Absent, key("", "whether no PSNR is known there")] = ABSENT
    psnr_db: Annotated[float | None, key("dB", "there")]
    parent_db: Annotated[float | Absent | None, key("dB", "its parent's, there")] = ABSENT
    parent_is_reference: Annotated[bool | Absent, key("", "so that it has none")] = ABSENT


class Rung(Record, kw_only=True):
    """A phase over all views. Its parent's time over its own, per view."""

    phase: Annotated[str, key("", "its name")]
    parent: Annotated[str, key("", "the phase before it")]
    views: Annotated[int, key("views", "measured that nothing was tuned on")]
    tuned: Annotated[dict[str, Interval | None], key("×", "ratios of the tuned views, by scene")]
    median: Annotated[
        Interval | None, key("×", "over the other views; the interval draws launches of each anew")
    ]
    worst: Annotated[Interval | None, key("×", "the worst of them")]
    worst_scene: Annotated[str | Absent | None, key("", "there")] = ABSENT
    worst_view: Annotated[str | Absent | None, key("", "there")] = ABSENT
    slower: Annotated[int, key("views", "whose whole interval is under 1")]
    to_truth: Annotated[Furthest | None, key("", "furthest from ground truth")]
    to_base: Annotated[Furthest | None, key("", "furthest from baseline")]
    wrong_ppm: Annotated[float | Absent | None, key("ppm", "the most of any view")] = ABSENT
    general: Annotated[int | Absent, key("views", "on which no code was generated")] = ABSENT
    verdict: Annotated[str, key("", "in words")]


class LeftOut(Skipped, kw_only=True):
    """What the time did not suffice for, or a phase refuses."""

    view: Annotated[str | Absent | None, key("", "of the scene")] = ABSENT


class Thumbnail(Record, kw_only=True):
    """A picture of a view."""

    scene: Annotated[str, key("", "its name")]
    view: Annotated[str, key("", "own, left, right or near")]
    change: Annotated[str | Absent, key("", "what was done to the camera")] = ABSENT
    tuned: Annotated[bool | Absent, key("", "as in a row")] = ABSENT
    picture: Annotated[str, key("", "below the run")]


class Views(Measured, kw_only=True):
    """Every phase against its parent on views that nothing was tuned on."""

    made_by: ClassVar[str] = "views"
    n: Annotated[int, key("pixels", "height of the timed pictures")]
    error_n: Annotated[int, key("pixels", "height of those that errors are of")]
    reps: Annotated[int | Absent, key("frames", "timed in a launch")] = ABSENT
    seconds: Annotated[float | Absent, key("s", "allowed")] = ABSENT
    reference: Annotated[str | Absent, key("", "where truth is not had")] = ABSENT
    rows: Annotated[list[Row], key("", "the views", min_length=1)]
    rungs: Annotated[list[Rung], key("", "phases that have a parent")]
    left_out: Annotated[list[LeftOut] | Absent, key("", "what the seconds did not suffice for")] = ABSENT
    failures: Annotated[list[LeftOut] | Absent, key("", "crashes")] = ABSENT
    thumbnails: Annotated[list[Thumbnail] | Absent, key("", "pictures of the views")] = ABSENT


SCHEMAS = {"views.json": Views}
