"""flight.json and throttle.json."""

from typing import Annotated, ClassVar

from study.core.schema import Record, key
from study.measuring.schema import Gain, Timed, TimedErrors
from study.numbers.schema import Measured


class Article(Record, kw_only=True):
    """What the article of rod marching says."""

    frames_a_second: Annotated[float, key("1/s", "of its program")]
    of: Annotated[str, key("", "what it draws, and on what")]


class Way(TimedErrors, kw_only=True):
    """One way to draw the picture of a place: time on one thread, and error to ground truth."""

    name: Annotated[str, key("", "rods, packets, throttle or fastest")]
    phase: Annotated[str, key("", "that draws it")]
    settings: Annotated[str, key("", "in the words of STEPWISE_RODS; empty: the phase's own")]


class Place(Record, kw_only=True):
    """Where the camera is at one time of its flight."""

    seconds: Annotated[float, key("s", "of the scene", ge=0)]
    position: Annotated[list[float], key("scene units", "of the camera")]
    within: Annotated[int, key("settings", "of the throttle, with rods, within the error allowed")]
    ways: Annotated[list[Way], key("", "to draw it", min_length=1)]


class Row(Record, kw_only=True):
    """A scene whose camera has a path."""

    scene: Annotated[str, key("", "its name")]
    width: Annotated[int, key("pixels", "of the pictures", ge=1)]
    n: Annotated[int, key("pixels", "their height", ge=1)]
    period: Annotated[float, key("s", "of the path")]
    places: Annotated[list[Place], key("", "along the path", min_length=1)]


class Flight(Measured, kw_only=True):
    """Frames a second and error along a camera's path: by rods, by packets, by a phase of the ladder."""

    made_by: ClassVar[str] = "flight"
    article: Annotated[Article, key("", "what the article of rod marching says")]
    psnr_db: Annotated[float, key("dB", "that the throttle is to keep, or what packets alone reach")]
    wrong_ppm: Annotated[float, key("ppm", "of wrong hits that it may have, or what packets alone have")]
    rows: Annotated[list[Row], key("", "scenes", min_length=1)]


class Setting(TimedErrors, kw_only=True):
    """One setting of phase rods_simd, with its errors."""

    settings: Annotated[str, key("", "in the words of STEPWISE_RODS")]
    within: Annotated[bool | None, key("", "within the error allowed")] = None
    first_ms: Annotated[float | None, key("ms", "a first look; null: outside")] = None


class Large(Gain, kw_only=True):
    """The choice at another size; errors are of the one picture against the other."""

    width: Annotated[int, key("pixels", "of the picture")]
    n: Annotated[int, key("pixels", "its height")]
    chosen: Annotated[Timed, key("ms", "the chosen setting")]
    plain: Annotated[Timed, key("ms", "packets without rods")]
    psnr_db: Annotated[float | None, key("dB", "null: identical, where all is finite")] = None
    other_ppm: Annotated[float, key("ppm", "pixels with another hit")]
    non_finite: Annotated[int, key("samples", "of both")]


class Choice(Gain, kw_only=True):
    """A scene: the fastest setting within the error that is allowed."""

    scene: Annotated[str, key("", "its name")]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    n: Annotated[int, key("pixels", "its height", ge=1)]
    psnr_db: Annotated[float | None, key("dB", "at least: asked for, or what packets alone reach")]
    wrong_ppm: Annotated[float | None, key("ppm", "at most")]
    tried: Annotated[int, key("settings", "tried")]
    within: Annotated[int, key("settings", "with rods, within the error")]
    finalists: Annotated[dict[str, Timed], key("ms", "the fastest within it, by which the choice was made")]
    chosen: Annotated[Setting | None, key("", "timed anew, interleaved; null: none is within")]
    plain: Annotated[Setting, key("", "packets without rods")]
    large: Annotated[Large | None, key("", "both at another size")] = None


class Throttle(Measured, kw_only=True):
    """Rods first, then packets: the fastest settings within a stated error, by scene."""

    made_by: ClassVar[str] = "flight --still"
    cpus: Annotated[int | None, key("CPUs", "that pictures were drawn on")] = None
    rows: Annotated[list[Choice], key("", "scenes", min_length=1)]


FILE, THROTTLE = "flight.json", "throttle.json"
SCHEMAS = {FILE: Flight, THROTTLE: Throttle}
