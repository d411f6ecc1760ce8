"""Ceilings of one core, measured by build/ceilings (common/ceilings): run, checked, kept with a run."""

import math
import os
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import msgspec

from study.bounds import peaks
from study.core import machine, run
from study.core.build import build
from study.core.cli import CANNOT_RUN, StudyError
from study.core.run_schema import Cpu
from study.core.schema import Record, key
from study.core.show import NOTHING, Column, cell, number, percent, plain, whole, word
from study.numbers.schema import Result

FILE = "ceilings.json"
LEVELS = ("L1", "L2", "L3", "memory")
KINDS = ("fma", "add", "mul", "minmax", "div", "sqrt", "rsqrt")
# Mixed: more per cycle than either where the units differ, and which mix is best depends on how.
TOGETHER = ("add+mul", "add+2mul", "2add+mul")
SECONDS = 120  # it takes five; ten on a slow machine
LACKS = "this CPU lacks "
TRIES = 6  # until the FMA ceilings agree
AGREE = 0.03  # single is twice double, and both what the ports allow, within that
CLOCK = 0.003  # of a sample (common/ceilings/samples.c): as much above what the ports allow says nothing
TSC_TOLERANCE = 0.01  # of one machine's: a calibration of 20 ms is far better
WIDTHS = (64, 128, 256, 512)  # of vectors; 64: scalar, 32 bits in single precision
_ELEMENTS = (("double", 64), ("single", 32))
_CPU = ("model", "vendor", "family", "model_number", "stepping")  # what tells machines apart


Positive = Annotated[float, msgspec.Meta(gt=0)]


class Ceiling(Record, kw_only=True, omit_defaults=True):
    """A rate. Arithmetic by precision and register width, bandwidth by level and working set.

    The clock is that of add chains right before and after each sample, under the kernel's own load.
    """

    name: Annotated[str, key("", "add, fma …; `add+mul`: mixed; load, store, copy (two instructions)")]
    precision: Annotated[str | None, key("", "double or single; of arithmetic")] = None
    level: Annotated[str | None, key("", "L1, L2, L3 or memory; of bandwidth")] = None
    bits: Annotated[int, key("bits", "of the register; the element's where scalar")]
    unit: Annotated[str, key("", "flop/core cycle or byte/core cycle")]
    value: Annotated[Positive | None, key("`unit`", "the best that was seen three times within 1 %")]
    reason: Annotated[str | None, key("", "why there is no value")] = None
    median: Annotated[Positive | None, key("`unit`", "of the samples")] = None
    low: Annotated[Positive | None, key("`unit`", "lower end, 95 %")] = None
    high: Annotated[Positive | None, key("`unit`", "upper end")] = None
    worst: Annotated[float | None, key("`unit`", "of the samples")] = None
    samples: Annotated[int | None, key("samples", "taken")] = None
    per_second: Annotated[Positive | None, key("1/s", "the same per second")] = None
    instructions_per_core_cycle: Annotated[Positive | None, key("1/core cycle", "of the kernel")] = None
    core_hz: Annotated[float | None, key("Hz", "clock under the kernel's load")] = None
    loop_operations: Annotated[int | None, key("operations", "of a pass of the loop")] = None
    loop_bytes: Annotated[int | None, key("bytes", "of a pass of the loop")] = None
    working_set_bytes: Annotated[int | None, key("bytes", "gone through")] = None
    working_set: Annotated[str | None, key("", "why that size")] = None


class Ceilings(Result, kw_only=True, omit_defaults=True):
    """What one core does at best, measured then and there."""

    made_by: ClassVar[str] = "ceilings"
    schema: Annotated[Literal[1], key("", "version of the form")]
    compiler: Annotated[str | None, key("", "version")] = None
    cpu: Annotated[Cpu | None, key("", "whose they are")] = None
    tsc_hz: Annotated[float, key("Hz", "timer's rate", gt=0)]
    core_hz: Annotated[float, key("Hz", "clock of add chains, with nothing beside them", gt=0)]
    core_hz_load: Annotated[
        dict[str, float | None] | None, key("Hz", "bits of the register → clock under FMAs of that width")
    ] = None
    timer_overhead_cycles: Annotated[
        int | None, key("timer cycles", "smallest difference of an empty pair of readings")
    ] = None
    cache_bytes: Annotated[dict[str, Any] | None, key("bytes", "level → size")] = None
    estimate: Annotated[str | None, key("", "how `value` is made")] = None
    seconds: Annotated[float | None, key("s", "that measuring took")] = None
    tries: Annotated[
        int | None, key("", "how often all was measured, until the FMA ceilings agree within 3 %; absent: 1")
    ] = None
    ceilings: Annotated[list[Ceiling], key("", "the rates", min_length=1)]

    def _find(self, name: str, precision: str, bits: int) -> Ceiling | None:
        which = name, precision, bits
        return next((one for one in self.ceilings if (one.name, one.precision, one.bits) == which), None)

    def flops(self, name: str, precision: str, bits: int) -> float:
        """Flop per core cycle; NaN for what it cannot do. `bits`: the element's where scalar."""
        found = self._find(name, precision, bits)
        return found.value if found and found.value is not None else math.nan

    def rate(self, name: str, precision: str, bits: int) -> float:
        """Instructions per core cycle."""
        found = self._find(name, precision, bits)
        return (found and found.instructions_per_core_cycle) or math.nan

    def issue(self, precision: str, bits: int) -> float:
        """Arithmetic instructions of any kind per core cycle: the most that was seen of any."""
        rates = [self.rate(name, precision, bits) for name in (*KINDS, *TOGETHER)]
        return max((rate for rate in rates if rate > 0), default=math.nan)

    def peak(self, one: Ceiling) -> float:
        """Flop per core cycle that the ports allow (study.bounds.peaks); NaN where that is not known."""
        return peaks.peak(self.cpu, one.name, one.precision, one.bits) if one.precision else math.nan

    def doubts(self) -> list[str]:
        """FMA ceilings in single precision that are not twice those in double (scalar: as much), since one
        unit does both, and ceilings off what the ports allow, in words: these were disturbed, or their clock
        was measured too low."""
        found = []
        for bits in WIDTHS:
            due = 1 if bits < 128 else 2
            double, single = (
                self.flops("fma", name, max(bits, of) if due > 1 else of) for name, of in _ELEMENTS
            )
            if abs(single / double / due - 1) > AGREE:  # NaN: widths that this CPU lacks
                width = "scalar" if due == 1 else f"{bits} bits"
                found.append(f"fma {width} {single / double:.3g} instead of {due}")
        for one in self.ceilings:
            if one.value is not None and one.precision is not None:
                peak = self.peak(one)
                low = one.name == "fma" and one.value < peak * (1 - AGREE)
                if low or one.value > peak * (1 + CLOCK):
                    found.append(f"{one.name} {one.precision} {one.bits} bits {one.value:.4g} of {peak:g}")
        return found

    def steady(self) -> bool:
        """Whether the FMA ceilings agree with each other and, where those are known, with the ports."""
        fmas = (one for one in self.ceilings if one.name == "fma" and one.value is None)
        lost = [one for one in fmas if not (one.reason or "").startswith(LACKS)]  # for the clock
        return not (lost or any(said.startswith("fma ") for said in self.doubts()))

    def remarks(self) -> list[str]:
        """What speaks against these figures; nothing where they agree."""
        if not (doubts := self.doubts()):
            return []
        times = f"{self.tries} times" if self.tries and self.tries > 1 else "once"
        return [
            f"Ceilings that were disturbed (measured {times}): {', '.join(doubts)}: single over double "
            "precision, or flop/core cycle of what the ports allow. Shares of them are off by as much."
        ]

    def better(self, other: Self) -> Self:
        """The higher of two measurements of each ceiling that the ports of the machine allow; the lower
        where they allow neither.
        """

        def rank(one: Ceiling) -> tuple[int, float]:
            if one.value is None:
                return 0, 0.0
            return (1, -one.value) if one.value > self.peak(one) * (1 + CLOCK) else (2, one.value)

        pairs = zip(self.ceilings, other.ceilings, strict=True)
        return msgspec.structs.replace(
            self,
            ceilings=[max(pair, key=rank) for pair in pairs],
            tries=(self.tries or 1) + (other.tries or 1),
            seconds=(self.seconds or 0) + (other.seconds or 0),
        )

    def bandwidth(self, level: str, bits: int | None = None) -> float:
        """Bytes per core cycle from or to a level: the most of load, store and copy, of any width or one."""
        mine = (one for one in self.ceilings if one.level == level and bits in (None, one.bits))
        return max((one.value for one in mine if one.value is not None), default=math.nan)

    def bandwidth_by(self, level: str, bits: int) -> float:
        """The same by accesses of `bits`; where there were none (scalar floats), of any width."""
        own = self.bandwidth(level, bits)
        return own if own > 0 else self.bandwidth(level)


def describe(cpu: Cpu, tsc_hz: float = math.nan) -> str:
    """A machine in a few words; its numbers tell apart what calls itself by one name."""
    numbers = (cpu.family, cpu.model_number, cpu.stepping)
    told = f" ({'/'.join(map(str, numbers))})" if None not in numbers else ""
    clock = f", timer {tsc_hz / 1e9:.3f} GHz" if tsc_hz > 0 else ""
    return f"{cpu.model or 'a CPU that is not recorded'}{told}{clock}"


def other_cpu(own: Cpu, theirs: Cpu, tsc_hz: Sequence[float] = (math.nan, math.nan)) -> bool:
    """Whether two records of a CPU are of different ones, or their timers' rates are. What either lacks, or
    NaN, is not compared."""
    pairs = [(getattr(own, name), getattr(theirs, name)) for name in _CPU]
    changed = any(None not in pair and pair[0] != pair[1] for pair in pairs)
    return changed or abs(tsc_hz[0] / tsc_hz[1] - 1) > TSC_TOLERANCE


def refuse(folder: Path, there: Cpu) -> None:
    """StudyError if the run in `folder` was made on another CPU than this one."""
    here = machine.cpu()
    if other_cpu(here, there):
        raise StudyError(
            f"{folder}: a run of another machine, {describe(there)}; its ceilings cannot be measured here, "
            f"on {describe(here)}"
        )


def measure(cpu: int | None = None, samples: int | None = None, tries: int = TRIES) -> Ceilings:
    """Runs build/ceilings, pinned to `cpu` (the last usable one), for about five seconds; again, up to
    `tries` times in all, until its FMA ceilings agree (Ceilings.steady): a neighbour may be busy for
    seconds, which spoils all samples of a ceiling. Of each the best that was allowed is kept.

    Beside what it printed stands which CPU this is, and how often it ran.
    """
    program = build(".", "ceilings")
    made = _once(program, cpu, samples)
    for _ in range(1, tries):
        if made.steady():
            break
        made = made.better(_once(program, cpu, samples))
    return made


def _once(program: Path, cpu: int | None, samples: int | None) -> Ceilings:
    arguments = [str(program), *(["--samples", str(samples)] if samples else [])]
    cpus = run.cpu_set(run.FASTEST if cpu is None else cpu, 1)
    try:
        done = subprocess.run(
            arguments,
            capture_output=True,
            text=True,
            timeout=SECONDS,
            preexec_fn=lambda: os.sched_setaffinity(0, cpus or ()),
        )
    except subprocess.TimeoutExpired:
        raise StudyError(f"{program}: not done after {SECONDS} s", CANNOT_RUN) from None
    if done.returncode:
        said = done.stderr.strip().splitlines()
        raise StudyError(said[-1] if said else f"{program}: exit status {done.returncode}", CANNOT_RUN)
    made = msgspec.json.decode(done.stdout, type=Ceilings)
    about = machine.cpu()
    known = Cpu(**{name: getattr(about, name) for name in (*_CPU, "microarchitecture")})
    return msgspec.structs.replace(made, cpu=known, tries=1)


# --- as tables, a column per kernel


def _best(name: str) -> Column:
    def text(line: dict[str, Any]) -> str:
        found = line.get(name) or {}
        value, median = (number(found.get(key), 4) for key in ("value", "median"))
        return f"{value} ({median})" if found.get("value") else NOTHING

    return Column("best (median)", name, text)


COMPUTE = [
    Column("", "precision", word("precision")),
    Column("", "width", word("width")),
    Column("fma by the ports", "flop/core cycle", plain("peak", 4)),
    Column("fma by the ports", "measured of it", lambda line: percent(cell(line, "of_peak"))),
    *[_best(name) for name in (*KINDS, *TOGETHER)],
]
BANDWIDTH = [
    Column("", "level", word("level")),
    Column("", "working set, KiB", whole("kib")),
    Column("", "width", word("width")),
    *[_best(name) for name in ("load", "store", "copy")],
]


def grid(limits: Ceilings, by: str) -> list[dict[str, Any]]:
    """A row per precision or level (`by`) and width; in each ceiling's column what its file says of it."""
    lines: dict[tuple[str, int], dict[str, Any]] = {}
    widest = max((one.bits for one in limits.ceilings if one.precision), default=math.inf)
    for one in limits.ceilings:
        if (group := getattr(one, by)) is None:
            continue
        what = " (scalar)" if one.bits == peaks.ELEMENT[one.precision or "double"] else ""
        if one.bits > widest:  # one instruction of arm64
            what = " (two registers)"
        line = lines.setdefault((group, one.bits), {by: group, "width": f"{one.bits} bits{what}"})
        line |= {one.name: msgspec.to_builtins(one)}
        if one.working_set_bytes is not None:
            line |= {"kib": one.working_set_bytes / 1024 or math.nan}
        if one.name == "fma":
            peak = limits.peak(one)
            line |= {"peak": peak, "of_peak": (one.value or math.nan) / peak}
    return list(lines.values())


SCHEMAS = {FILE: Ceilings}
