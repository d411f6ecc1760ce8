"""scaling.json."""

from __future__ import annotations

from typing import Annotated, ClassVar

from study.core.schema import ABSENT, Absent, Record, key
from study.numbers.schema import Interval, Measured, Range


class Row(Record, kw_only=True):
    """One point of a series by one phase. Points over 2.1 million pixels, and `crowd`, are timed only."""

    series: Annotated[str, key("", "what grows: `axes` and `titles` say it")]
    x: Annotated[float, key("`axes`", "how much; of bounces the rays of a chain, bounces + 1")]
    phase: Annotated[str, key("", "its name")]
    scene: Annotated[str, key("", "its name")]
    n: Annotated[int, key("pixels", "height of the picture", ge=1)]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    threads: Annotated[int, key("threads", "that drew it", ge=1)]
    max_steps: Annotated[int | Absent | None, key("evaluations", "null: the scene's own")] = ABSENT
    ns: Annotated[list[float], key("ns", "one per process launch: median of its timed frames")]
    ms: Annotated[Interval, key("ms", "a frame")]
    ns_per_pixel: Annotated[Interval | Absent, key("ns", "a pixel")] = ABSENT
    above_frame_mib: Annotated[
        float | Absent | None, key("MiB", "peak resident memory after the first frame less its float planes")
    ] = ABSENT
    evals_per_ray: Annotated[
        float | Absent | None,
        key("evaluations", "of the whole scene, camera ray; null: the phase has exact hits"),
    ] = ABSENT
    coverage: Annotated[float | Absent | None, key("share of pixels", "that hit")] = ABSENT
    non_finite: Annotated[int | Absent, key("samples", "NaN or infinite where none may be")] = ABSENT
    reference: Annotated[
        str | Absent | None, key("", "what errors are to: `truth`, else a phase in doubles; null: `why_none`")
    ] = ABSENT
    why_none: Annotated[str | Absent, key("", "why there is no error")] = ABSENT
    psnr_db: Annotated[float | Absent | None, key("dB", "null with an RMSE: infinite")] = ABSENT
    rmse: Annotated[float | Absent | None, key("linear RGB", "root mean square error")] = ABSENT
    wrong_ppm: Annotated[float | Absent | None, key("ppm", "hit, miss or shape wrong")] = ABSENT
    scenes: Annotated[
        int | Absent,
        key("scenes", "of `crowd`: one per launch, seeds from `scene_seed` on, in the order of `ns`"),
    ] = ABSENT


class Law(Record, kw_only=True):
    """factor·x^exponent through the points; 95 % by bootstrap over launches."""

    exponent: Annotated[Range, key("", "of all points")]
    factor: Annotated[float | None, key("as the figure", "at x = 1")]
    points: Annotated[int, key("points", "fitted")]
    first_x: Annotated[float, key("`axes`", "least x")]
    last_x: Annotated[float, key("`axes`", "largest x")]
    first: Annotated[Range, key("", "exponent of the first two points alone")]
    last: Annotated[Range, key("", "exponent of the last two points alone")]
    worst: Annotated[float | None, key("×", "largest residual as a factor")]
    worst_x: Annotated[float | None, key("`axes`", "there")]
    off: Annotated[list[float], key("`axes`", "x over 10 % off the law and beyond their noise")]
    holds: Annotated[bool | None, key("", "none is; null: two points")]


class Fit(Record, kw_only=True):
    """A series of a phase as a power law."""

    series: Annotated[str, key("", "its name")]
    title: Annotated[str | Absent, key("", "in words")] = ABSENT
    phase: Annotated[str, key("", "its name")]
    paper: Annotated[float | None, key("", "exponent of the paper's O(K·T·N²); null: it has none")]
    time: Annotated[Law, key("ns", "of a frame")]
    evals: Annotated[Law | None, key("evaluations", "of `evals_per_ray`; null: not counted")]
    verdict: Annotated[str, key("", "in words")]


class LeftOut(Record, kw_only=True):
    """A point that was not measured: too long, refused, or no memory."""

    series: Annotated[str, key("", "its name")]
    x: Annotated[float, key("`axes`", "where")]
    phase: Annotated[str, key("", "its name")]
    reason: Annotated[str, key("", "why")]
    foreseen_s: Annotated[float | Absent | None, key("s", "one frame")] = ABSENT
    scene: Annotated[str | Absent, key("", "its name")] = ABSENT


class Memory(Record, kw_only=True):
    """One frame at 3840×2160."""

    series: Annotated[str | Absent, key("", "memory")] = ABSENT
    x: Annotated[float | Absent, key("", "its place")] = ABSENT
    phase: Annotated[str, key("", "its name")]
    scene: Annotated[str, key("", "its name")]
    shapes: Annotated[int | Absent, key("shapes", "of the scene")] = ABSENT
    threads: Annotated[int | Absent, key("threads", "that drew it")] = ABSENT
    width: Annotated[int | Absent, key("pixels", "of the picture")] = ABSENT
    n: Annotated[int | Absent, key("pixels", "its height")] = ABSENT
    seconds: Annotated[float | Absent, key("s", "of the frame")] = ABSENT
    peak_rss_mib: Annotated[float | Absent, key("MiB", "peak resident memory")] = ABSENT
    above_frame_mib: Annotated[float, key("MiB", "of it beyond 12 bytes a pixel")]


class Goal(Record, kw_only=True):
    """How a phase grows with the shapes, and its memory."""

    phase: Annotated[str, key("", "its name")]
    n: Annotated[int | Absent | None, key("pixels", "height of the pictures")] = ABSENT
    shapes: Annotated[int | Absent | None, key("shapes", "the largest number measured")] = ABSENT
    ratio: Annotated[
        Interval | None, key("×", "time of that many shapes over that of 16; of `crowd` where it is there")
    ]
    coverage: Annotated[list[float | None] | Absent | None, key("share of pixels", "that hit, of both")] = (
        ABSENT
    )
    shapes_goal: Annotated[str, key("", "`met` where the whole interval is; at 4,096 shapes")]
    above_frame_mib: Annotated[float | Absent | None, key("MiB", "the most of `memory`")] = ABSENT
    memory_goal: Annotated[str, key("", "`met` where it is")]
    scenes: Annotated[list[int] | Absent | None, key("scenes", "of `crowd`; null: one of each")] = ABSENT
    mean_ms: Annotated[
        list[float] | Absent, key("ms", "their means; `ratio` is of these, by Welch's interval")
    ] = ABSENT
    by_medians: Annotated[Interval | Absent | None, key("×", "the ratio of the medians beside it")] = ABSENT


class Thumbnail(Record, kw_only=True):
    """A picture of a generated scene."""

    series: Annotated[str, key("", "its name")]
    x: Annotated[float, key("`axes`", "where")]
    scene: Annotated[str, key("", "its name")]
    coverage: Annotated[float | Absent | None, key("share of pixels", "that hit")] = ABSENT
    picture: Annotated[str, key("", "below the run")]


class Scaling(Measured, kw_only=True):
    """Time, evaluations and error against n, shapes, steps, bounces, threads."""

    made_by: ClassVar[str] = "scaling"
    n: Annotated[int | Absent, key("pixels", "height where it does not grow")] = ABSENT
    scene_seed: Annotated[int | Absent, key("", "of generated scenes")] = ABSENT
    seconds: Annotated[float | Absent | None, key("s", "allowed")] = ABSENT
    coverage_wanted: Annotated[
        float | Absent | None, key("share of pixels", "that generated scenes are made to have hit, at 160×90")
    ] = ABSENT
    rows: Annotated[list[Row], key("", "the points", min_length=1)]
    fits: Annotated[list[Fit], key("", "power laws")]
    left_out: Annotated[list[LeftOut], key("", "points that were not measured")]
    memory: Annotated[list[Memory], key("", "frames at 3840×2160")]
    goals: Annotated[list[Goal], key("", "growth and memory by phase")]
    thumbnails: Annotated[list[Thumbnail] | Absent, key("", "pictures of generated scenes")] = ABSENT
    axes: Annotated[dict[str, str] | Absent, key("", "series → what x is, with its unit")] = ABSENT
    titles: Annotated[dict[str, str] | Absent, key("", "series → in words")] = ABSENT


SCHEMAS = {"scaling.json": Scaling}
