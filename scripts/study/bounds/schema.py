"""ceilings.json."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

import msgspec

from study.core.run_schema import Cpu
from study.core.schema import ABSENT, Absent, Record, key
from study.numbers.schema import Result

Positive = Annotated[float, msgspec.Meta(gt=0)]


class Ceiling(Record, kw_only=True):
    """A rate. Arithmetic by precision and register width, bandwidth by level and working set.

    The clock is that of add chains right before and after each sample, under the kernel's own load.
    """

    name: Annotated[str, key("", "add, fma …; `add+mul`: mixed; load, store, copy (two instructions)")]
    precision: Annotated[str | Absent, key("", "double or single; of arithmetic")] = ABSENT
    level: Annotated[str | Absent, key("", "L1, L2, L3 or memory; of bandwidth")] = ABSENT
    bits: Annotated[int, key("bits", "of the register; the element's where scalar")]
    unit: Annotated[str, key("", "flop/core cycle or byte/core cycle")]
    value: Annotated[Positive | None, key("`unit`", "the best that was seen three times within 1 %")]
    reason: Annotated[str | Absent, key("", "why there is no value")] = ABSENT
    median: Annotated[Positive | Absent | None, key("`unit`", "of the samples")] = ABSENT
    low: Annotated[Positive | Absent | None, key("`unit`", "lower end, 95 %")] = ABSENT
    high: Annotated[Positive | Absent | None, key("`unit`", "upper end")] = ABSENT
    worst: Annotated[float | Absent | None, key("`unit`", "of the samples")] = ABSENT
    samples: Annotated[int | Absent, key("samples", "taken")] = ABSENT
    per_second: Annotated[Positive | Absent | None, key("1/s", "the same per second")] = ABSENT
    instructions_per_core_cycle: Annotated[Positive | Absent | None, key("1/core cycle", "of the kernel")] = (
        ABSENT
    )
    core_hz: Annotated[float | Absent | None, key("Hz", "clock under the kernel's load")] = ABSENT
    loop_operations: Annotated[int | Absent, key("operations", "of a pass of the loop")] = ABSENT
    loop_bytes: Annotated[int | Absent, key("bytes", "of a pass of the loop")] = ABSENT
    working_set_bytes: Annotated[int | Absent, key("bytes", "gone through")] = ABSENT
    working_set: Annotated[str | Absent, key("", "why that size")] = ABSENT

    def __post_init__(self) -> None:
        if ABSENT in (self.precision, self.level) and self.precision is self.level:
            raise ValueError("neither a precision nor a level")
        numbers = (self.median, self.low, self.high, self.per_second, self.instructions_per_core_cycle)
        if self.value is None and not self.reason:
            raise ValueError("neither value nor reason")
        if self.value is not None and any(one in (None, ABSENT) for one in numbers):
            raise ValueError("a value without its median, interval or rates")


class Ceilings(Result, kw_only=True):
    """What one core does at best, measured then and there."""

    made_by: ClassVar[str] = "ceilings"
    schema: Annotated[Literal[1], key("", "version of the form")]
    compiler: Annotated[str | Absent, key("", "version")] = ABSENT
    cpu: Annotated[Cpu | Absent, key("", "whose they are")] = ABSENT
    tsc_hz: Annotated[float, key("Hz", "TSC rate", gt=0)]
    core_hz: Annotated[float, key("Hz", "clock of add chains, with nothing beside them", gt=0)]
    core_hz_load: Annotated[
        dict[str, float | None] | Absent, key("Hz", "bits of the register → clock under FMAs of that width")
    ] = ABSENT
    timer_overhead_cycles: Annotated[
        int | Absent, key("TSC cycles", "smallest difference of an empty pair of readings")
    ] = ABSENT
    cache_bytes: Annotated[dict[str, Any] | Absent, key("bytes", "level → size")] = ABSENT
    estimate: Annotated[str | Absent, key("", "how `value` is made")] = ABSENT
    seconds: Annotated[float | Absent, key("s", "that measuring took")] = ABSENT
    tries: Annotated[
        int | Absent,
        key("", "how often all was measured, until the FMA ceilings agree within 3 %; absent: 1"),
    ] = ABSENT
    ceilings: Annotated[list[Ceiling], key("", "the rates", min_length=1)]


SCHEMAS = {"ceilings.json": Ceilings}
