"""breakeven.json."""

from __future__ import annotations

from typing import Annotated, ClassVar

from study.core.schema import Record, key
from study.numbers.schema import Interval, Measured, PictureErrors, Range, Skipped


class Row(Record, kw_only=True):
    """One scene, on one thread. A row without a kernel has `reason` and no times."""

    scene: Annotated[str, key("", "its name")]
    n: Annotated[int, key("pixels", "height of the picture", ge=1)]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    generated: Annotated[bool, key("", "whether code was generated for the scene")]
    reason: Annotated[str | None, key("", "why not")] = None
    compiler: Annotated[str | None, key("", "of the kernel")] = None
    compile_s: Annotated[float | None, key("s", "compiling, in the first launch: the cache is empty")] = None
    setup_s: Annotated[float | None, key("s", "all of that launch's set-up (`prepare_ns`)")] = None
    setup_found_ms: Annotated[float | None, key("ms", "all of the second launch's set-up")] = None
    general_launches_ms: Annotated[list[float] | None, key("ms", "of `against`, a launch each")] = None
    generated_launches_ms: Annotated[list[float] | None, key("ms", "the same with the kernel")] = None
    general_ms: Annotated[Interval | None, key("ms", "of these launches")] = None
    generated_ms: Annotated[Interval | None, key("ms", "of these launches")] = None
    gain: Annotated[Interval | None, key("×", "ratio of the medians")] = None
    break_even_frames: Annotated[
        Range | None, key("frames", "`setup_s` over what a frame gains; null: never")
    ] = None
    error: Annotated[PictureErrors | None, key("", "of the kernel's picture to the other's, n = 180")] = None


class Breakeven(Measured, kw_only=True):
    """The number of frames after which code compiled for a scene has paid."""

    made_by: ClassVar[str] = "breakeven"
    seconds: Annotated[float | None, key("s", "allowed")] = None
    phase: Annotated[str, key("", "that generates code")]
    against: Annotated[str, key("", "the phase without it")]
    rows: Annotated[list[Row], key("", "the scenes", min_length=1)]
    left_out: Annotated[list[Skipped], key("", "what the seconds did not suffice for")]


SCHEMAS = {"breakeven.json": Breakeven}
