"""Ceilings of one core, measured by build/ceilings (common/ceilings): run, checked, kept with a run."""

from __future__ import annotations

import json
import math
import os
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study.bounds import peaks, schema
from study.core import cli, machine, run, store
from study.core.build import build
from study.core.cli import CANNOT_RUN, StudyError

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

Row = dict[str, Any]


@dataclass(frozen=True)
class Ceilings:
    """One machine's ceilings. Per core cycle, the best that repeated itself; NaN for what it cannot do."""

    data: Row

    @property
    def rows(self) -> list[Row]:
        return self.data["ceilings"]

    def foreign(self, context: Mapping[str, Any], tsc_hz: float) -> str | None:
        """Why these are another machine's than a run's (context.json, TSC rate); None: nothing says so.

        `tsc_hz` NaN: not known. What either record lacks is not compared.
        """
        own, theirs = self.data.get("cpu") or {}, context.get("cpu") or {}
        if not other_cpu(own, theirs, (self.data["tsc_hz"], tsc_hz)):
            return None
        here, there = describe(own, self.data["tsc_hz"]), describe(theirs, tsc_hz)
        return f"ceilings of another machine: {here}; what was timed ran on {there}"

    def _value(self, field: str, **about: Any) -> float:
        found = (r for r in self.rows if all(r.get(key) == value for key, value in about.items()))
        value = next((r[field] for r in found if r["value"] is not None), None)
        return math.nan if value is None else float(value)

    def flops(self, name: str, precision: str, bits: int) -> float:
        """Flop per core cycle. `precision`: double or single; `bits`: the element's where scalar."""
        return self._value("value", name=name, precision=precision, bits=bits)

    def rate(self, name: str, precision: str, bits: int) -> float:
        """Instructions per core cycle."""
        return self._value("instructions_per_core_cycle", name=name, precision=precision, bits=bits)

    def issue(self, precision: str, bits: int) -> float:
        """Arithmetic instructions of any kind per core cycle: the most that was seen of any."""
        rates = [self.rate(name, precision, bits) for name in (*KINDS, *TOGETHER)]
        return max((rate for rate in rates if rate > 0), default=math.nan)

    @property
    def tries(self) -> int:
        """How often it was measured."""
        return int(self.data.get("tries", 1))

    def peak(self, name: str, precision: str, bits: int) -> float:
        """Flop per core cycle that the ports allow (study.bounds.peaks); NaN where that is not known."""
        return peaks.peak(self.data.get("cpu") or {}, name, precision, bits)

    def uneven(self) -> list[str]:
        """Widths at which FMA in single precision is not twice that in double (scalar: as much), in words.

        One unit does both, at one instruction rate: the slower of them was disturbed.
        """
        found = []
        for bits in WIDTHS:
            scalar = bits < 128
            ends = [self.flops("fma", name, element if scalar else bits) for name, element in _ELEMENTS]
            ratio, due = ends[1] / ends[0], 1 if scalar else 2
            if abs(ratio / due - 1) > AGREE:  # NaN: widths that this CPU lacks
                found.append(f"{'scalar' if scalar else f'{bits} bits'} {ratio:.3g} instead of {due}")
        return found

    def off_ports(self) -> tuple[list[str], list[str]]:
        """Ceilings above what the ports allow, and FMA ceilings more than AGREE below it, in words."""
        above, below = [], []
        for one in self.rows:
            if one["value"] is None or "precision" not in one:
                continue
            due = self.peak(one["name"], one["precision"], one["bits"])
            said = f"{one['name']} {one['precision']} {one['bits']} bits {one['value']:.4g} of {due:g}"
            if one["value"] > due * (1 + CLOCK):
                above.append(said)
            elif one["name"] == "fma" and one["value"] < due * (1 - AGREE):
                below.append(said)
        return above, below

    def steady(self) -> bool:
        """Whether the FMA ceilings agree with each other and, where those are known, with the ports."""
        above, below = self.off_ports()
        lost = [r for r in self.rows if r["name"] == "fma" and r["value"] is None]
        lost = [r for r in lost if not r["reason"].startswith(LACKS)]  # for the clock, not for the CPU
        return not (self.uneven() or below or lost or any(said.startswith("fma ") for said in above))

    def remarks(self) -> list[str]:
        """What speaks against these figures; nothing where they agree."""
        said, (above, below) = [], self.off_ports()
        times = "once" if self.tries == 1 else f"{self.tries} times"
        if uneven := self.uneven():
            said.append(
                f"FMA ceilings that do not agree (measured {times}), single over double precision: "
                f"{', '.join(uneven)}. The lower of the two was disturbed, and shares of it are too high."
            )
        if below:
            said.append(
                f"FMA ceilings more than {100 * AGREE:g}\u00a0% below what the ports allow, in flop/core "
                f"cycle (measured {times}): {', '.join(below)}. Disturbed; shares of them are too high."
            )
        if above:
            said.append(
                f"Ceilings above what the ports allow, in flop/core cycle: {', '.join(above)}. The clock "
                "beside them was measured too low; shares of them are too low by as much."
            )
        return said

    def better(self, other: Ceilings) -> Ceilings:
        """Of each ceiling the higher of two measurements of one machine that the ports allow; the lower
        where they allow neither.
        """

        def rank(row: Row) -> tuple[int, float]:
            if row["value"] is None:
                return 0, 0.0
            due = math.nan
            if "precision" in row:
                due = self.peak(row["name"], row["precision"], row["bits"])
            return (1, -row["value"]) if row["value"] > due * (1 + CLOCK) else (2, row["value"])

        pairs = zip(self.rows, other.rows, strict=True)
        rows = [max(pair, key=rank) for pair in pairs]
        seconds = sum(one.data.get("seconds", 0) for one in (self, other))
        more = {"ceilings": rows, "tries": self.tries + other.tries, "seconds": seconds}
        return Ceilings({**self.data, **more})

    def bandwidth(self, level: str, bits: int | None = None) -> float:
        """Bytes per core cycle from or to a level: the most of load, store and copy, of any width or one."""
        found = [
            r["value"]
            for r in self.rows
            if r.get("level") == level and r["value"] is not None and bits in (None, r["bits"])
        ]
        return max(found, default=math.nan)

    def bandwidth_by(self, level: str, bits: int) -> float:
        """The same by accesses of `bits`; where there were none (scalar floats), of any width."""
        own = self.bandwidth(level, bits)
        return own if own > 0 else self.bandwidth(level)


def describe(cpu: Mapping[str, Any], tsc_hz: float) -> str:
    """A machine in a few words; its numbers tell apart what calls itself by one name."""
    numbers = [cpu.get(key) for key in ("family", "model_number", "stepping")]
    told = f" ({'/'.join(map(str, numbers))})" if None not in numbers else ""
    clock = f", TSC {tsc_hz / 1e9:.3f} GHz" if tsc_hz > 0 else ""
    return f"{cpu.get('model') or 'a CPU that is not recorded'}{told}{clock}"


def other_cpu(
    own: Mapping[str, Any], theirs: Mapping[str, Any], tsc_hz: Sequence[float] = (math.nan, math.nan)
) -> bool:
    """Whether two records of a CPU are of different ones, or their TSC rates are. What either lacks, or NaN,
    is not compared."""
    changed = any(None not in (own.get(k), theirs.get(k)) and own[k] != theirs[k] for k in _CPU)
    return changed or abs(tsc_hz[0] / tsc_hz[1] - 1) > TSC_TOLERANCE


def refuse(folder: Path, context: Mapping[str, Any]) -> None:
    """StudyError if the run in `folder` was made on another machine than this one."""
    here, there = cli.plain(machine.cpu()), context.get("cpu") or {}
    if other_cpu(here, there):
        raise StudyError(
            f"{folder}: a run of another machine, {describe(there, math.nan)}; its ceilings cannot be "
            f"measured here, on {describe(here, math.nan)}"
        )


def check(data: Any, where: str) -> Ceilings:
    """`data` as ceilings. Raises StudyError that names what is wrong in it."""
    return Ceilings(schema.Ceilings.checked(data, where))


def measure(cpu: int | None = None, samples: int | None = None, tries: int = TRIES) -> Ceilings:
    """Runs build/ceilings, pinned to `cpu` (the last usable one), for about five seconds; again, up to
    `tries` times in all, until its FMA ceilings agree (Ceilings.steady): a neighbour may be busy for
    seconds, which spoils all samples of a ceiling. Of each the best that was allowed is kept.

    Beside what it printed stands which CPU this is, and how often it ran.
    """
    program = build(".", "ceilings")
    made = _once(program, cpu, samples)
    while made.tries < tries and not made.steady():
        made = made.better(_once(program, cpu, samples))
    return made


def _once(program: Path, cpu: int | None, samples: int | None) -> Ceilings:
    arguments = [str(program), "--json", *(["--samples", str(samples)] if samples else [])]
    cpus = run.cpu_set(run.FASTEST if cpu is None else cpu, 1)
    try:
        done = subprocess.run(
            arguments,
            capture_output=True,
            text=True,
            timeout=SECONDS,
            preexec_fn=lambda: os.sched_setaffinity(0, cpus or ()),
        )
    except OSError as error:
        raise StudyError(f"{program}: {error.strerror}", CANNOT_RUN) from None
    except subprocess.TimeoutExpired:
        raise StudyError(f"{program}: not done after {SECONDS} s", CANNOT_RUN) from None
    if done.returncode:
        said = done.stderr.strip().splitlines()
        raise StudyError(said[-1] if said else f"{program}: exit status {done.returncode}", CANNOT_RUN)
    try:
        data = json.loads(done.stdout)
    except json.JSONDecodeError:
        raise StudyError(f"{program}: printed no JSON object but {done.stdout[:60]!r}") from None
    about = machine.cpu()
    return check(
        data | {"cpu": {key: about[key] for key in (*_CPU, "microarchitecture")}, "tries": 1}, str(program)
    )


def read(folder: Path) -> Ceilings:
    """A run's ceilings. Raises StudyError, also where there are none."""
    path = folder / FILE
    if not path.exists():
        raise StudyError(f"{path} is missing: no ceilings; run scripts/stepwise ceilings --run {folder}")
    return Ceilings(schema.Ceilings.read(path))


def write(folder: Path, ceilings: Ceilings) -> Path:
    store.write_json(folder / FILE, ceilings.data)
    return folder / FILE
