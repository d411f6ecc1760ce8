"""Ceilings of one core, measured by build/ceilings (common/ceilings): run, checked, kept with a run."""

from __future__ import annotations

import json
import math
import os
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study import machine, run, store
from study.build import build
from study.cli import CANNOT_RUN, StudyError

FILE = "ceilings.json"
LEVELS = ("L1", "L2", "L3", "memory")
KINDS = ("fma", "add", "mul", "minmax", "div", "sqrt", "rsqrt")
# Mixed: more per cycle than either where the units differ, and which mix is best depends on how.
TOGETHER = ("add+mul", "add+2mul", "2add+mul")
SECONDS = 120  # it takes five; ten on a slow machine
TSC_TOLERANCE = 0.01  # of one machine's: a calibration of 20 ms is far better
_CPU = ("model", "vendor", "family", "model_number", "stepping")  # what tells machines apart
_NUMBERS = ("value", "median", "low", "high", "per_second", "instructions_per_core_cycle")

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
        changed = _differ(own, theirs) or abs(self.data["tsc_hz"] / tsc_hz - 1) > TSC_TOLERANCE
        if not changed:
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

    def bandwidth(self, level: str, bits: int | None = None) -> float:
        """Bytes per core cycle from or to a level: the most of load, store and copy, of any width or one."""
        found = [
            r["value"]
            for r in self.rows
            if r.get("level") == level and r["value"] is not None and bits in (None, r["bits"])
        ]
        return max(found, default=math.nan)


def describe(cpu: Mapping[str, Any], tsc_hz: float) -> str:
    """A machine in a few words; its numbers tell apart what calls itself by one name."""
    numbers = [cpu.get(key) for key in ("family", "model_number", "stepping")]
    told = f" ({'/'.join(map(str, numbers))})" if None not in numbers else ""
    clock = f", TSC {tsc_hz / 1e9:.3f} GHz" if tsc_hz > 0 else ""
    return f"{cpu.get('model') or 'a CPU that is not recorded'}{told}{clock}"


def _differ(own: Mapping[str, Any], theirs: Mapping[str, Any]) -> bool:
    """Whether two records of a CPU are of different ones. What either lacks is not compared."""
    return any(None not in (own.get(k), theirs.get(k)) and own[k] != theirs[k] for k in _CPU)


def refuse(folder: Path, context: Mapping[str, Any]) -> None:
    """StudyError if the run in `folder` was made on another machine than this one."""
    here, there = machine.cpu(), context.get("cpu") or {}
    if _differ(here, there):
        raise StudyError(
            f"{folder}: a run of another machine, {describe(there, math.nan)}; its ceilings cannot be "
            f"measured here, on {describe(here, math.nan)}"
        )


def check(data: Any, where: str) -> Ceilings:
    """`data` as ceilings. Raises StudyError that names what is wrong in it."""

    def wrong(what: str) -> StudyError:
        return StudyError(f"{where}: {what}; make it again with scripts/ceilings.py --run RUN")

    if not isinstance(data, dict) or data.get("schema") != 1:
        raise wrong("no ceilings of schema 1")
    rows = data.get("ceilings")
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise wrong("no list of ceilings")
    for key in ("tsc_hz", "core_hz"):
        if not _positive(data.get(key)):
            raise wrong(f"{key} is no positive number")
    if not isinstance(data.get("cpu", {}), dict):
        raise wrong("cpu is no object")
    for row in rows:
        about = " ".join(str(row.get(key)) for key in ("name", "precision", "level", "bits") if key in row)
        if not {"name", "bits", "value", "unit"} <= row.keys() or not row.keys() & {"precision", "level"}:
            raise wrong(f"the ceiling '{about}' lacks its name, bits, value, unit or what it is of")
        if row["value"] is None:
            if not row.get("reason"):
                raise wrong(f"the ceiling '{about}' has neither value nor reason")
        elif bad := [key for key in _NUMBERS if not _positive(row.get(key))]:
            raise wrong(f"{bad[0]} of the ceiling '{about}' is no positive number")
    return Ceilings(data)


def _positive(value: Any) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and math.isfinite(value) and value > 0


def measure(cpu: int | None = None, samples: int | None = None) -> Ceilings:
    """Runs build/ceilings, pinned to `cpu` (the last usable one), for about five seconds.

    Beside what it printed stands which CPU this is.
    """
    program = build(".", "ceilings")
    arguments = [str(program), "--json", *(["--samples", str(samples)] if samples else [])]
    cpus = run.cpu_set(run.USABLE[-1] if cpu is None else cpu, 1)
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
    return check(data | {"cpu": {key: about[key] for key in _CPU}}, str(program))


def read(folder: Path) -> Ceilings:
    """A run's ceilings. Raises StudyError, also where there are none."""
    path = folder / FILE
    if not path.exists():
        raise StudyError(f"{path} is missing: no ceilings; run scripts/ceilings.py --run {folder}")
    return check(store.read_json(path), str(path))


def write(folder: Path, ceilings: Ceilings) -> Path:
    store.write_json(folder / FILE, ceilings.data)
    return folder / FILE
