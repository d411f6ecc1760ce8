"""Times, gains, errors of hits and animations, as result files have them."""

from typing import Annotated

from study.core.schema import Record, key

Ms = Annotated[float | None, key("ms", "median over process launches")]
MsLow = Annotated[float | None, key("ms", "lower end, 95 %")]
MsHigh = Annotated[float | None, key("ms", "upper end")]
MsLaunches = Annotated[list[float] | None, key("ms", "one per process launch")]
Times = Annotated[float | None, key("×", "time of the other over this one's")]
TimesLow = Annotated[float | None, key("×", "lower end, 95 %")]
TimesHigh = Annotated[float | None, key("×", "upper end")]


class Timed(Record, kw_only=True):
    """A time with its 95 % interval."""

    ms: Ms = None
    ms_low: MsLow = None
    ms_high: MsHigh = None
    launches: MsLaunches = None


class Gain(Record, kw_only=True):
    """A ratio of times with its 95 % interval."""

    gain: Times = None
    gain_low: TimesLow = None
    gain_high: TimesHigh = None


class HitErrors(Record, kw_only=True):
    """Errors of hits to ground truth, over the pixels whose camera ray truth proves."""

    evaluations: Annotated[float | None, key("evaluations/pixel", "of the scene's distance")] = None
    judged: Annotated[float | None, key("share of pixels", "whose hits are judged")] = None
    known: Annotated[float | None, key("share of pixels", "whose colour truth knows")] = None
    false_hits_ppm: Annotated[float | None, key("ppm", "hit where truth misses")] = None
    false_misses_ppm: Annotated[float | None, key("ppm", "miss where truth hits")] = None
    wrong_shape_ppm: Annotated[float | None, key("ppm", "another shape where both hit")] = None
    wrong_ppm: Annotated[float | None, key("ppm", "the three together")] = None
    dt_p50: Annotated[float | None, key("scene units", "median of |Δt| where the shape is right")] = None
    dt_p99: Annotated[float | None, key("scene units", "99th percentile of it")] = None
    dt_p100: Annotated[float | None, key("scene units", "its maximum")] = None
    psnr_db: Annotated[float | None, key("dB", "shaded picture to truth; null: identical")] = None
    non_finite: Annotated[int | None, key("samples", "NaN or infinite where none may be")] = None


class TimedErrors(HitErrors, kw_only=True):
    """A time with its 95 % interval, and errors of hits to ground truth."""

    ms: Ms = None
    ms_low: MsLow = None
    ms_high: MsHigh = None
    launches: MsLaunches = None


class Spread(Record, kw_only=True):
    """Milliseconds of a frame with its update."""

    mean: Annotated[float, key("ms", "of all frames")]
    p5: Annotated[float | None, key("ms", "5th percentile")] = None
    p50: Annotated[float | None, key("ms", "median")] = None
    p95: Annotated[float | None, key("ms", "95th percentile")] = None
    most: Annotated[float | None, key("ms", "the slowest")] = None


class FrameErrors(HitErrors, kw_only=True):
    """Errors of one frame to ground truth, and its size."""

    width: Annotated[int | None, key("pixels", "of the picture")] = None
    n: Annotated[int | None, key("pixels", "its height")] = None


class Animation(Record, kw_only=True):
    """The first frames of spheres40_animated by one program. One process: no interval."""

    phase: Annotated[str, key("", "its name")]
    settings: Annotated[str | None, key("", "how it is told to work")] = None
    threads: Annotated[int, key("threads", "that drew it")]
    frames: Annotated[int, key("frames", "drawn")]
    width: Annotated[int, key("pixels", "of the picture")]
    n: Annotated[int, key("pixels", "its height")]
    ms: Annotated[Spread, key("ms", "of a frame with its update")]
    update_ms: Annotated[float | None, key("ms", "of it the update, median")] = None
    core_ns_per_pixel: Annotated[float, key("ns", "mean × threads over pixels")]
    all_ms: Annotated[list[float] | None, key("ms", "every frame, in order")] = None
    error: Annotated[FrameErrors | None, key("", "of the picture at its beginning, to truth")] = None
    common_frames: Annotated[int | None, key("frames", "the fewest that a row has")] = None
    common_ms: Annotated[float | None, key("ms", "mean of that many first ones")] = None


class Article(Record, kw_only=True):
    """What an article says of its animation."""

    ms: Annotated[float, key("ms", "mean of a frame")]
    cores: Annotated[int, key("cores", "of its CPU")]
    width: Annotated[int, key("pixels", "of its pictures")]
    height: Annotated[int, key("pixels", "of its pictures")]
    frames: Annotated[int, key("frames", "timed")]
    spheres: Annotated[int, key("spheres", "in its scene")]
    bits: Annotated[int, key("bits", "of fraction")]
    cpu: Annotated[str, key("", "its name")]
