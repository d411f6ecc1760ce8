"""scaling.json."""

from typing import Annotated, ClassVar

from study.core.schema import Record, key
from study.numbers.power_laws import Law
from study.numbers.schema import Interval, Measured


class Row(Record, kw_only=True):
    """One point of a series by one phase. Points over 2.1 million pixels, and `crowd`, are timed only."""

    series: Annotated[str, key("", "what grows: `axes` and `titles` say it")]
    x: Annotated[float, key("`axes`", "how much; of bounces the rays of a chain, bounces + 1")]
    phase: Annotated[str, key("", "its name")]
    scene: Annotated[str, key("", "its name")]
    n: Annotated[int, key("pixels", "height of the picture", ge=1)]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    threads: Annotated[int, key("threads", "that drew it", ge=1)]
    max_steps: Annotated[int | None, key("evaluations", "null: the scene's own")] = None
    ns: Annotated[list[float], key("ns", "one per process launch: median of its timed frames")]
    ms: Annotated[Interval, key("ms", "a frame")]
    ns_per_pixel: Annotated[Interval | None, key("ns", "a pixel")] = None
    evals_per_ray: Annotated[float | None, key("evaluations", "of a camera ray; null: exact hits")] = None
    coverage: Annotated[float | None, key("share of pixels", "that hit")] = None
    non_finite: Annotated[int | None, key("samples", "NaN or infinite where none may be")] = None
    reference: Annotated[str | None, key("", "`truth`, else a phase in doubles; null: `why_none`")] = None
    why_none: Annotated[str | None, key("", "why there is no error")] = None
    psnr_db: Annotated[float | None, key("dB", "null with an RMSE: infinite")] = None
    rmse: Annotated[float | None, key("linear RGB", "root mean square error")] = None
    wrong_ppm: Annotated[float | None, key("ppm", "hit, miss or shape wrong")] = None
    scenes: Annotated[int | None, key("scenes", "of `crowd`: one per launch, in the order of `ns`")] = None


class Fit(Record, kw_only=True):
    """A series of a phase as a power law."""

    series: Annotated[str, key("", "its name")]
    title: Annotated[str, key("", "in words")]
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
    foreseen_s: Annotated[float | None, key("s", "one frame")] = None
    scene: Annotated[str | None, key("", "its name")] = None


class Crowd(Record, kw_only=True):
    """How a phase grows with the shapes."""

    phase: Annotated[str, key("", "its name")]
    n: Annotated[int | None, key("pixels", "height of the pictures")] = None
    shapes: Annotated[int | None, key("shapes", "the largest number measured")] = None
    ratio: Annotated[Interval | None, key("×", "time over that of 16 shapes; of `crowd`, if any")] = None
    coverage: Annotated[list[float | None] | None, key("share of pixels", "that hit, of both")] = None
    scenes: Annotated[list[int] | None, key("scenes", "of `crowd`; null: one of each")] = None
    mean_ms: Annotated[list[float] | None, key("ms", "their means; `ratio` is of these, by Welch")] = None
    by_medians: Annotated[Interval | None, key("×", "the ratio of the medians beside it")] = None


class Scaling(Measured, kw_only=True):
    """Time, evaluations and error against n, shapes, steps, bounces, threads."""

    made_by: ClassVar[str] = "scaling"
    n: Annotated[int, key("pixels", "height where it does not grow")]
    scene_seed: Annotated[int | None, key("", "of generated scenes")] = None
    seconds: Annotated[float | None, key("s", "allowed")] = None
    rows: Annotated[list[Row], key("", "the points", min_length=1)]
    fits: Annotated[list[Fit], key("", "power laws")]
    left_out: Annotated[list[LeftOut], key("", "points that were not measured")]
    goals: Annotated[list[Crowd], key("", "growth with the shapes, by phase")]
    axes: Annotated[dict[str, str], key("", "series → what x is, with its unit")]
    titles: Annotated[dict[str, str], key("", "series → in words")]


SCHEMAS = {"scaling.json": Scaling}
