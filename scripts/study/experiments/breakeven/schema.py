"""breakeven.json."""

from __future__ import annotations

from typing import Annotated, ClassVar

from study.core.schema import ABSENT, Absent, Record, key
from study.numbers.schema import Interval, Measured, PictureErrors, Range, Skipped


class Row(Record, kw_only=True):
    """One scene, on one thread. A row without a kernel has `reason` and no times."""

    scene: Annotated[str, key("", "its name")]
    n: Annotated[int, key("pixels", "height of the picture", ge=1)]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    generated: Annotated[bool, key("", "whether code was generated for the scene")]
    reason: Annotated[str | Absent, key("", "why not")] = ABSENT
    compiler: Annotated[str | Absent, key("", "of the kernel")] = ABSENT
    hash: Annotated[str | Absent, key("", "the kernel's name in the cache")] = ABSENT
    compile_s: Annotated[float | Absent, key("s", "compiling, in the first launch: the cache is empty")] = (
        ABSENT
    )
    generate_ms: Annotated[float | Absent, key("ms", "of it writing the source")] = ABSENT
    setup_s: Annotated[float | Absent, key("s", "all of that launch's set-up (`prepare_ns`)")] = ABSENT
    load_ms: Annotated[float | Absent, key("ms", "checking and loading the kernel, in the second launch")] = (
        ABSENT
    )
    setup_found_ms: Annotated[float | Absent, key("ms", "all of the second launch's set-up")] = ABSENT
    general_launches_ms: Annotated[
        list[float] | Absent, key("ms", "of `against`, a launch each: median of its frames, without set-up")
    ] = ABSENT
    generated_launches_ms: Annotated[list[float] | Absent, key("ms", "the same with the kernel")] = ABSENT
    general_ms: Annotated[Interval | Absent, key("ms", "of these launches")] = ABSENT
    generated_ms: Annotated[Interval | Absent, key("ms", "of these launches")] = ABSENT
    gain: Annotated[Interval | Absent, key("×", "ratio of the medians")] = ABSENT
    break_even_frames: Annotated[
        Range | Absent, key("frames", "`setup_s` over what a frame gains; null: never, or not known")
    ] = ABSENT
    error: Annotated[
        PictureErrors | Absent, key("", "of the kernel's picture to the other's, at n = 180")
    ] = ABSENT


class Breakeven(Measured, kw_only=True):
    """After how many frames code compiled for a scene has paid."""

    made_by: ClassVar[str] = "breakeven"
    seconds: Annotated[float | Absent, key("s", "allowed")] = ABSENT
    phase: Annotated[str | Absent, key("", "that generates code")] = ABSENT
    against: Annotated[str | Absent, key("", "the phase without it")] = ABSENT
    rows: Annotated[list[Row], key("", "the scenes", min_length=1)]
    left_out: Annotated[list[Skipped] | Absent, key("", "what the seconds did not suffice for")] = ABSENT


SCHEMAS = {"breakeven.json": Breakeven}
