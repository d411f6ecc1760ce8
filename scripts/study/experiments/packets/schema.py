"""packets.json."""

from typing import Annotated, ClassVar

from study.core.schema import Record, key
from study.measuring.schema import Gain, Timed, Times, TimesHigh, TimesLow
from study.numbers.schema import Measured

Ratio = Annotated[float | None, key("×", "ours over Embree's rays a second, asked this way")]
RatioLow = Annotated[float | None, key("×", "lower end, 95 %")]
RatioHigh = Annotated[float | None, key("×", "upper end")]


class Rate(Record, kw_only=True):
    """Million rays a second on one thread."""

    mrays: Annotated[float, key("10⁶ rays/s", "of the launches' median repetitions")]
    mrays_low: Annotated[float | None, key("10⁶ rays/s", "lower end, 95 %")] = None
    mrays_high: Annotated[float | None, key("10⁶ rays/s", "upper end")] = None


class Variant(Rate, kw_only=True):
    """One way of the phase."""

    name: Annotated[str, key("", "`own`: the phase's own settings")]
    lanes: Annotated[int, key("lanes", "rays at once")]


class Agreement(Record, kw_only=True):
    """Hits beside Embree's."""

    compared: Annotated[int, key("rays", "whose hits are within the bounds")]
    other_shape: Annotated[int, key("rays", "that met another shape, or only one of the two met any")]
    dt_max: Annotated[float | None, key("scene units", "largest |Δt| where both met the same")]


class Rays(Record, kw_only=True):
    """One scene and kind of rays. Embree's ratios are its time over ours, in the same processes."""

    scene: Annotated[str, key("", "spheres40, trio_balls or spheres4096")]
    kind: Annotated[str, key("", "primary, shadow, mirror or scattered")]
    rays: Annotated[int, key("rays", "how many")]
    variants: Annotated[list[Variant], key("10⁶ rays/s", "ways of the phase")]
    embree: Annotated[str, key("", "its version, or why it is not compared")]
    embree16: Annotated[Rate | None, key("10⁶ rays/s", "packets of 16; null: not compared")] = None
    embree16_ratio: Ratio = None
    embree16_ratio_low: RatioLow = None
    embree16_ratio_high: RatioHigh = None
    embree1: Annotated[Rate | None, key("10⁶ rays/s", "single rays")] = None
    embree1_ratio: Ratio = None
    embree1_ratio_low: RatioLow = None
    embree1_ratio_high: RatioHigh = None
    embree_stream: Annotated[Rate | None, key("10⁶ rays/s", "256 rays a call, Embree 3")] = None
    embree_stream_ratio: Ratio = None
    embree_stream_ratio_low: RatioLow = None
    embree_stream_ratio_high: RatioHigh = None
    agreement: Annotated[Agreement | None, key("", "of the hits; null: not compared")] = None
    newton_dt_max: Annotated[float | None, key("scene units", "largest |Δt| of `root by Newton`")] = None


class Threads(Timed, kw_only=True):
    """Times on so many threads. `gain`: its time over that of packets."""

    gain: Times = None
    gain_low: TimesLow = None
    gain_high: TimesHigh = None
    threads: Annotated[int, key("threads", "that drew it")]


class Limits(Record, kw_only=True):
    """A picture by some limits of its march, and its error."""

    hit_distance: Annotated[float | None, key("scene units", "null: the scene's own")] = None
    max_steps: Annotated[int | None, key("evaluations", "null: the scene's own")] = None
    psnr_db: Annotated[float | None, key("dB", "to truth; null: identical")]
    wrong_ppm: Annotated[float | None, key("ppm", "hit, miss or shape wrong")]
    non_finite: Annotated[int, key("samples", "NaN or infinite where none may be")]


class Drawn(Limits, kw_only=True):
    """A phase by the limits at which it is fastest at the wanted error."""

    phase: Annotated[str, key("", "its name")]
    target_db: Annotated[float | None, key("dB", "what packets reach, at most 80")]
    reached: Annotated[bool, key("", "within 0.1 dB; else the nearest that it comes")]
    threads: Annotated[list[Threads], key("", "by number of threads")]


class Scene(Record, kw_only=True):
    """A scene that ray tracing and sphere tracing both draw."""

    scene: Annotated[str, key("", "its name")]
    width: Annotated[int, key("pixels", "of the picture")]
    n: Annotated[int, key("pixels", "its height")]
    rows: Annotated[list[Drawn], key("", "phases")]


class Normalise(Gain, kw_only=True):
    """One way to normalise vectors. `gain` is over scalar code."""

    vectors: Annotated[int, key("vectors", "normalised")]
    isa: Annotated[str, key("", "instruction set")]
    layout: Annotated[str, key("", "AoS or SoA")]
    name: Annotated[str, key("", "as in functions.json")]
    max_ulp: Annotated[float | None, key("ulp", "largest error")]
    ms: Annotated[float, key("ms", "median")]
    ms_low: Annotated[float | None, key("ms", "lower end")]
    ms_high: Annotated[float | None, key("ms", "upper end")]


class Article(Record, kw_only=True):
    """What the article says of normalising vectors."""

    scalar_ms: Annotated[float, key("ms", "scalar code")]
    sse_ms: Annotated[float, key("ms", "SSE")]
    speed_up: Annotated[float, key("×", "of the two")]
    cpu: Annotated[str, key("", "its CPU")]


class Packets(Measured, kw_only=True):
    """Rays a second beside Embree; ray tracing against sphere tracing at equal error."""

    made_by: ClassVar[str] = "packets"
    reps: Annotated[int | None, key("repetitions", "in a launch")] = None
    article: Annotated[Article, key("", "what the article says")]
    ray_n: Annotated[int, key("pixels", "height of the camera's rays")]
    rays: Annotated[list[Rays], key("", "scenes and kinds of rays", min_length=1)]
    drawn: Annotated[list[Scene], key("", "ray tracing against sphere tracing at equal error")]
    normalise: Annotated[list[Normalise], key("", "vectors normalised")]


FILE = "packets.json"
SCHEMAS = {FILE: Packets}
