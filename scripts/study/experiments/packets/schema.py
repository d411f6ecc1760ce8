"""packets.json."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from study.core.schema import ABSENT, Absent, Record, key
from study.experiments.moving.schema import Animation, with_means
from study.numbers.schema import Gain, Measured, Timed, TimedErrors, Times, TimesHigh, TimesLow


class Rate(Record, kw_only=True):
    """Million rays a second on one thread."""

    mrays: Annotated[float | None, key("10⁶ rays/s", "of the launches' median repetitions")]
    mrays_low: Annotated[float | Absent | None, key("10⁶ rays/s", "lower end, 95 %")] = ABSENT
    mrays_high: Annotated[float | Absent | None, key("10⁶ rays/s", "upper end")] = ABSENT


class Variant(Rate, kw_only=True):
    """One way of the phase."""

    name: Annotated[str, key("", "`own`: the phase's own settings")]
    lanes: Annotated[int | Absent, key("lanes", "rays at once")] = ABSENT


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
    embree16: Annotated[Rate | Absent | None, key("10⁶ rays/s", "packets of 16; null: not compared")] = ABSENT
    embree16_ratio: Annotated[float | Absent | None, key("×", "packets of 16")] = ABSENT
    embree16_ratio_low: Annotated[float | Absent | None, key("×", "lower end")] = ABSENT
    embree16_ratio_high: Annotated[float | Absent | None, key("×", "upper end")] = ABSENT
    embree1: Annotated[Rate | Absent | None, key("10⁶ rays/s", "single rays")] = ABSENT
    embree1_ratio: Annotated[float | Absent | None, key("×", "single rays")] = ABSENT
    embree1_ratio_low: Annotated[float | Absent | None, key("×", "lower end")] = ABSENT
    embree1_ratio_high: Annotated[float | Absent | None, key("×", "upper end")] = ABSENT
    embree_stream: Annotated[Rate | Absent | None, key("10⁶ rays/s", "256 rays a call, Embree 3")] = ABSENT
    embree_stream_ratio: Annotated[float | Absent | None, key("×", "256 rays a call")] = ABSENT
    embree_stream_ratio_low: Annotated[float | Absent | None, key("×", "lower end")] = ABSENT
    embree_stream_ratio_high: Annotated[float | Absent | None, key("×", "upper end")] = ABSENT
    agreement: Annotated[Agreement | Absent | None, key("", "of the hits; null: not compared")] = ABSENT
    newton_dt_max: Annotated[
        float | Absent | None,
        key("scene units", "largest |Δt| of the approximate root with a Newton step to the exact"),
    ] = ABSENT


class Threads(Timed, kw_only=True):
    """Times on so many threads. `gain`: its time over that of packets."""

    gain: Times = ABSENT
    gain_low: TimesLow = ABSENT
    gain_high: TimesHigh = ABSENT
    threads: Annotated[int, key("threads", "that drew it")]


class Drawn(Record, kw_only=True):
    """A phase by the limits at which it is fastest at the wanted error."""

    phase: Annotated[str, key("", "its name")]
    target_db: Annotated[float | None, key("dB", "what packets reach, at most 80")]
    reached: Annotated[bool | Absent, key("", "within 0.1 dB; else the nearest that it comes")] = ABSENT
    hit_distance: Annotated[float | None, key("scene units", "null: the scene's own")]
    max_steps: Annotated[int | Absent | None, key("evaluations", "null: the scene's own")] = ABSENT
    psnr_db: Annotated[float | None, key("dB", "to truth; null: identical")]
    wrong_ppm: Annotated[float | None, key("ppm", "hit, miss or shape wrong")]
    non_finite: Annotated[int, key("samples", "NaN or infinite where none may be")]
    threads: Annotated[list[Threads], key("", "by number of threads")]


class Scene(Record, kw_only=True):
    """A scene that ray tracing and sphere tracing both draw."""

    scene: Annotated[str, key("", "its name")]
    width: Annotated[int, key("pixels", "of the picture")]
    n: Annotated[int, key("pixels", "its height")]
    rows: Annotated[list[Drawn], key("", "phases")]


class Root(TimedErrors, kw_only=True):
    """A frame of spheres40 by one root on one thread. `gain`: of newton over exact."""

    scene: Annotated[str | Absent, key("", "its name")] = ABSENT
    width: Annotated[int | Absent, key("pixels", "of the picture")] = ABSENT
    n: Annotated[int | Absent, key("pixels", "its height")] = ABSENT
    gain: Times = ABSENT
    gain_low: TimesLow = ABSENT
    gain_high: TimesHigh = ABSENT
    root: Annotated[str, key("", "`exact`, or `newton`: approximate with one step")]


class Normalise(Gain, kw_only=True):
    """One way to normalise vectors. `gain` is over scalar code."""

    vectors: Annotated[int, key("vectors", "normalised")]
    isa: Annotated[str, key("", "instruction set")]
    layout: Annotated[str, key("", "AoS or SoA")]
    name: Annotated[str, key("", "as in functions.json")]
    max_ulp: Annotated[float | Absent | None, key("ulp", "largest error")] = ABSENT
    ms: Annotated[float | None, key("ms", "median")]
    ms_low: Annotated[float | Absent | None, key("ms", "lower end")] = ABSENT
    ms_high: Annotated[float | Absent | None, key("ms", "upper end")] = ABSENT


class Tree(Animation, kw_only=True):
    """The animation by a tree that is built anew in each frame's update."""

    tree: Annotated[str, key("", "BVH or kd-tree")]


class Packets(Measured, kw_only=True):
    """Rays a second beside Embree; ray tracing against sphere tracing at equal error."""

    made_by: ClassVar[str] = "packets"
    reps: Annotated[int | Absent, key("repetitions", "in a launch")] = ABSENT
    article: Annotated[dict[str, Any], key("", "what the article says")]
    goals: Annotated[
        dict[str, float | None] | Absent, key("×", "kind of rays → our rate over Embree's fastest")
    ] = ABSENT
    ray_n: Annotated[int | Absent, key("pixels", "height of the camera's rays")] = ABSENT
    rays: Annotated[list[Rays], key("", "scenes and kinds of rays", min_length=1)]
    drawn: Annotated[list[Scene], key("", "ray tracing against sphere tracing at equal error")]
    roots: Annotated[list[Root] | Absent, key("", "exact and approximate")] = ABSENT
    animation: Annotated[list[Tree] | Absent, key("", "by either tree")] = ABSENT
    normalise: Annotated[list[Normalise] | Absent, key("", "vectors normalised")] = ABSENT

    @classmethod
    def current(cls, data: Any) -> Any:
        return with_means(data)


SCHEMAS = {"packets.json": Packets}
