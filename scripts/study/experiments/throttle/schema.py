"""throttle.json."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from study.core.schema import ABSENT, Absent, key
from study.numbers.schema import Gain, Measured, Timed, TimedErrors


class Setting(TimedErrors, kw_only=True):
    """One setting of phase rods_simd, with its errors."""

    settings: Annotated[str, key("", "in the words of STEPWISE_RODS")]
    within: Annotated[bool | Absent, key("", "within the error allowed")] = ABSENT
    first_ms: Annotated[float | Absent | None, key("ms", "a first look; null: outside")] = ABSENT


class Large(Gain, kw_only=True):
    """The choice at another size; errors are of the one picture against the other."""

    width: Annotated[int, key("pixels", "of the picture")]
    n: Annotated[int, key("pixels", "its height")]
    chosen: Annotated[Timed, key("ms", "the chosen setting")]
    plain: Annotated[Timed, key("ms", "packets without rods")]
    psnr_db: Annotated[float | Absent | None, key("dB", "null: identical, where all is finite")] = ABSENT
    other_ppm: Annotated[float | Absent | None, key("ppm", "pixels with another hit")] = ABSENT
    non_finite: Annotated[int | Absent, key("samples", "of both")] = ABSENT


class Row(Gain, kw_only=True):
    """A scene: the fastest setting within the error that is allowed."""

    scene: Annotated[str, key("", "its name")]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    n: Annotated[int, key("pixels", "its height", ge=1)]
    psnr_db: Annotated[float | None, key("dB", "at least: asked for, or what packets alone reach")]
    wrong_ppm: Annotated[float | None, key("ppm", "at most")]
    tried: Annotated[int, key("settings", "tried")]
    within: Annotated[int, key("settings", "with rods, within the error")]
    all: Annotated[list[dict[str, Any]] | Absent, key("", "every setting with its errors; not published")] = (
        ABSENT
    )
    finalists: Annotated[
        dict[str, Timed] | Absent, key("ms", "the fastest within it, by which the choice was made")
    ] = ABSENT
    chosen: Annotated[Setting | None, key("", "timed anew, interleaved; null: none is within")]
    plain: Annotated[Setting, key("", "packets without rods")]
    large: Annotated[Large | Absent | None, key("", "both at another size")] = ABSENT


class Throttle(Measured, kw_only=True):
    """Rods first, then packets: the fastest settings within a stated error, by scene."""

    made_by: ClassVar[str] = "throttle"
    cpus: Annotated[int | Absent, key("CPUs", "that pictures were drawn on")] = ABSENT
    rows: Annotated[list[Row], key("", "scenes", min_length=1)]


SCHEMAS = {"throttle.json": Throttle}
