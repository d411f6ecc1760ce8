"""frames.json."""

from typing import Annotated, ClassVar

from study.core.schema import key
from study.numbers.schema import Interval, Measured, PictureErrors, Skipped


class Row(PictureErrors, kw_only=True):
    """One phase, scene and hit distance. Errors are to `reference` by the same parameters."""

    phase: Annotated[str, key("", "its name")]
    scene: Annotated[str, key("", "its name")]
    hit: Annotated[str, key("", "the scene's own, or half a pixel at the mean distance of the shapes")]
    hit_distance: Annotated[float, key("scene units", "as used")]
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
    presented_by: Annotated[str | None, key("", "the phase, or the driver after it")] = None
    displayed_otherwise: Annotated[int | None, key("pixels", "not as the driver presents")] = None
    reference: Annotated[str, key("", "whose picture the errors are to: the fastest phase in doubles")]
    to_own: Annotated[PictureErrors | None, key("", "to the scene's own parameters; null: as these")]


class LeftOut(Skipped, kw_only=True):
    """What the time did not suffice for."""

    hit: Annotated[str | None, key("", "as in a row")] = None


class Frames(Measured, kw_only=True):
    """Frames a second, presenting included."""

    made_by: ClassVar[str] = "frames"
    threads: Annotated[int, key("threads", "of every row that can use them")]
    seconds: Annotated[float | None, key("s", "allowed")] = None
    away: Annotated[float, key("hit distances", "from the surface to where secondary rays start")] = 3
    rows: Annotated[list[Row], key("", "the rates", min_length=1)]
    left_out: Annotated[list[LeftOut], key("", "what the seconds did not suffice for")] = []


FILE = "frames.json"
SCHEMAS = {FILE: Frames}
