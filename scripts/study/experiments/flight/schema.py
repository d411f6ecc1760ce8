"""flight.json."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from study.core.schema import Record, key
from study.numbers.schema import Measured, TimedErrors


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
    article: Annotated[dict[str, Any], key("", "what the article of rod marching says")]
    psnr_db: Annotated[float, key("dB", "that the throttle is to keep, or what packets alone reach")]
    wrong_ppm: Annotated[float, key("ppm", "of wrong hits that it may have, or what packets alone have")]
    rows: Annotated[list[Row], key("", "scenes", min_length=1)]


SCHEMAS = {"flight.json": Flight}
