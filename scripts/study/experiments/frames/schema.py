"""frames.json."""

from __future__ import annotations

from typing import Annotated, ClassVar

from study.core.schema import ABSENT, Absent, Record, key
from study.numbers.schema import Interval, Measured, PictureErrors, Skipped


class Marched(Record, kw_only=True):
    """The nearest parent that marches to its hits, by the same coarse hit distance."""

    phase: Annotated[str, key("", "that parent")]
    psnr_db: Annotated[float | None, key("dB", "as above")]
    rmse: Annotated[float | None, key("linear RGB", "as above")]
    depth_agree_fraction: Annotated[float | Absent | None, key("share of pixels", "as above")] = ABSENT
    bulb_psnr_db: Annotated[float | Absent | None, key("dB", "as above")] = ABSENT


class Row(PictureErrors, kw_only=True):
    """One phase, scene and hit distance. Errors are to `reference` by the same parameters."""

    phase: Annotated[str, key("", "its name")]
    scene: Annotated[str, key("", "its name")]
    hit: Annotated[str, key("", "the scene's own, or half a pixel at the mean distance of the shapes")]
    hit_distance: Annotated[
        float, key("scene units", "as used; `surface_offset` is at least three times that")
    ]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    n: Annotated[int, key("pixels", "its height", ge=1)]
    threads: Annotated[int, key("threads", "that drew it")]
    ms: Annotated[list[list[float]], key("ms", "launch by launch, every timed frame with its presenting")]
    frames_per_s: Annotated[Interval, key("1/s", "one over the median of the launches' medians")]
    frames: Annotated[int, key("frames", "timed")]
    median_ms: Annotated[float, key("ms", "of all frames")]
    p99_ms: Annotated[float | None, key("ms", "99th percentile; null: under 100 frames")]
    worst_ms: Annotated[float, key("ms", "the slowest frame")]
    present_ms: Annotated[float, key("ms", "of it gamma and 8 bits; median")]
    presented_by: Annotated[str | Absent, key("", "the phase, or the driver after it")] = ABSENT
    displayed_otherwise: Annotated[
        int | Absent | None, key("pixels", "that the phase presents unlike the driver")
    ] = ABSENT
    goal: Annotated[float, key("1/s", "asked for")]
    verdict: Annotated[str, key("", "`met` where the whole interval is")]
    reference: Annotated[str, key("", "whose picture the errors are to: the fastest phase in doubles")]
    to_own: Annotated[
        PictureErrors | None,
        key("", "the same errors to its picture by the scene's own parameters; null: as these"),
    ]
    bulb_psnr_db: Annotated[
        float | Absent | None,
        key("dB", "of 4×4 means whose samples all hit a fractal; null: none, or identical"),
    ] = ABSENT
    marched: Annotated[Marched | Absent | None, key("", "for comparison; null by the scene's own")] = ABSENT


class LeftOut(Skipped, kw_only=True):
    """What the time did not suffice for."""

    hit: Annotated[str | Absent, key("", "as in a row")] = ABSENT


class Frames(Measured, kw_only=True):
    """Frames a second, presenting included."""

    made_by: ClassVar[str] = "frames"
    threads: Annotated[int, key("threads", "of every row that can use them")]
    seconds: Annotated[float | Absent, key("s", "allowed")] = ABSENT
    away: Annotated[
        float | Absent, key("hit distances", "from the surface to where secondary rays start")
    ] = ABSENT
    rows: Annotated[list[Row], key("", "the rates", min_length=1)]
    left_out: Annotated[list[LeftOut] | Absent, key("", "what the seconds did not suffice for")] = ABSENT


SCHEMAS = {"frames.json": Frames}
