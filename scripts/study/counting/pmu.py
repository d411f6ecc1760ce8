"""Counts by the processor's own counters, as perf stat reads them, where the kernel offers them.

Events and formulas of each microarchitecture are in events/NAME.json, with where they are from.

What is counted is a process, not the timed region. So the same picture is rendered with 1 and with 3
frames, and half the difference is a frame: start, scene and set-up fall out. What the driver does around
each frame (clocks, record) is taken off by the same difference of a picture of one pixel. Left in are the
driver's own per pixel (the 8-bit picture: six minima and maxima); what is lost is one pixel of the phase's.
Events are measured in groups that fit the counters, each in runs of its own. User mode only. libm and libc
are inside. Bytes are not counted, nor, by Intel's events, which lanes a mask left out.

Not yet validated: no machine with such counters was at hand. The output says so.
"""

from __future__ import annotations

import csv
import functools
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

from study.core import machine, temporary
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.registry import Scene, Spec, cpu_flags
from study.core.run import GENERAL, _arguments, cpu_set, environment, render
from study.counting import backend, perf
from study.counting.counts import Counts
from study.counting.schema import Measurement

FOLDER = Path(__file__).with_name("events")
FEW, MANY = 1, 3  # frames, whose difference is measured
ADDS = "FLOPs, cycles and a top-down split by hardware"


class Event(msgspec.Struct):
    """`perf`: as perf stat -e takes it; `needs`: a CPU flag."""

    perf: str
    source: str
    needs: str = ""


class Flop(msgspec.Struct):
    """`lanes`: a formula of events."""

    kind: str
    precision: str
    bits: int
    lanes: str
    needs: str = ""


_SHARES = {
    "bad_speculation": "bad speculation",
    "front_end": "front-end bound",
    "back_end": "back-end bound",
    "other": "the other thread",
}


class Topdown(msgspec.Struct, rename=_SHARES):
    """Formulas of the shares of the slots. `together`: its events are read in one group or not at all."""

    source: str
    together: bool
    slots: str
    retiring: str
    bad_speculation: str
    front_end: str
    back_end: str
    other: str | None = None


class Events(msgspec.Struct, forbid_unknown_fields=True):
    """events/NAME.json."""

    microarchitectures: list[str]
    source: str
    notes: list[str]
    events: dict[str, Event]
    groups: list[list[str]]
    flops: list[Flop]
    topdown: Topdown | None


@dataclass(frozen=True)
class Line:
    """One event of perf's output. `value` is perf's, scaled to the whole run; `enabled`: share of it, %."""

    event: str
    value: float
    enabled: float


@dataclass(frozen=True)
class Reading:
    """A frame by the counters. `topdown`: shares of the slots; `scaled`: events that shared a counter."""

    measured: Measurement
    topdown: dict[str, float] | None
    events: dict[str, float]
    scaled: list[str]

    @property
    def remark(self) -> str:
        flagged = f"; scaled, counters were shared: {', '.join(self.scaled)}" if self.scaled else ""
        return f"not yet validated on a machine with counters{flagged}"


def evaluate(formula: str, values: Mapping[str, float]) -> float:
    """Of events and numbers; NaN for a quotient over nothing."""
    try:
        return float(eval(formula, {"__builtins__": {}}, dict(values)))  # of this package's own files
    except ZeroDivisionError:
        return math.nan


@functools.cache
def every() -> list[Events]:
    return [msgspec.json.decode(path.read_bytes(), type=Events) for path in sorted(FOLDER.glob("*.json"))]


def events_for(microarchitecture: str | None) -> Events:
    """The events file of a microarchitecture. StudyError (cannot run) if there is none."""
    for one in every():
        if microarchitecture in one.microarchitectures:
            return one
    known = ", ".join(name for one in every() for name in one.microarchitectures)
    raise StudyError(
        f"no events file for {microarchitecture or 'this processor'} (there are {known}); "
        "add scripts/study/counting/events/NAME.json",
        CANNOT_RUN,
    )


def missing() -> str | None:
    """None, or why hardware counters cannot be read here, in one line."""
    try:
        _stat(["true"], ["instructions", "cycles"], events_for(machine.cpu()["microarchitecture"]), None)
    except StudyError as error:
        return f"no hardware counters here; they would add {ADDS} ({error})"
    return None


def parse(text: str, names: Sequence[str]) -> dict[str, Line]:
    """Output of `perf stat -x ';'` of the events `names`, in that order (perf-stat(1), CSV FORMAT).

    StudyError for an event that is not supported or was not counted, and for other text.
    """
    fields = [one for one in csv.reader(text.splitlines(), delimiter=";") if len(one) > 4 and one[2]]
    if len(fields) != len(names):
        raise StudyError(f"perf stat: {len(fields)} events, {len(names)} were asked for")
    found = {}
    for name, (value, _, event, _, share, *_) in zip(names, fields, strict=True):
        if value.startswith("<not"):
            cannot = CANNOT_RUN if "supported" in value else 2
            raise StudyError(f"perf stat: {event} was {value.strip('<>')}", cannot)
        try:
            found[name] = Line(event, float(value), float(share))
        except ValueError:
            raise StudyError(f"perf stat: {event}: no number: {value[:40]!r}, {share[:40]!r}") from None
    return found


def _stat(command: list[str], names: Sequence[str], events: Events, cpus: set[int] | None) -> dict[str, Line]:
    asked = ",".join(events.events[name].perf for name in names)
    if events.topdown and events.topdown.together and events.topdown.slots in names:
        asked = f"{{{asked}}}:u"
    program = perf.program()
    if not program:
        raise StudyError(
            "perf is missing (apt install linux-perf, on Ubuntu linux-tools-generic)", CANNOT_RUN
        )
    with temporary.folder(prefix="stepwise-perf-") as folder:
        out = folder / "perf.csv"
        done = child.run(
            [program, "stat", "-x", ";", "-o", str(out), "-e", asked, "--", *command],
            capture_output=True,
            text=True,
            errors="replace",
            env=environment(more=GENERAL | {"LC_ALL": "C"}),
            preexec_fn=(lambda: os.sched_setaffinity(0, cpus)) if cpus else None,
        )
        if done.returncode:
            said = [line.strip() for line in done.stderr.splitlines() if line.strip()]
            if lacking := perf.forbidden():
                raise StudyError(lacking, CANNOT_RUN)
            raise StudyError(f"perf stat: {(said or [f'exit status {done.returncode}'])[-1]}", CANNOT_RUN)
        return parse(out.read_text(encoding="utf-8"), names)


def difference(few: Mapping[str, Line], many: Mapping[str, Line]) -> dict[str, float]:
    """Per frame: what MANY frames count more than FEW, over the frames between."""
    return {name: (many[name].value - line.value) / (MANY - FEW) for name, line in few.items()}


def read_frame(
    spec: Spec, scene: Scene, height: int, variant: str = "shipped", cpu: int | None = None
) -> Reading:
    """One frame by the counters of this machine; `cpu`: pinned to it. StudyError if it has none."""
    events, pinned = events_for(machine.cpu()["microarchitecture"]), cpu_set(cpu, 1)
    target, (wide, high) = backend.TARGETS[variant], scene.size(height)
    values: dict[str, float] = {}
    scaled: dict[str, None] = {}
    for group in events.groups:
        names = [name for name in group if events.events[name].needs in {"", *cpu_flags()}]
        frame, driver = (
            [
                _stat(
                    _arguments(spec, scene.path.resolve(), *size, reps=reps, target=target),
                    names,
                    events,
                    pinned,
                )
                for reps in (FEW, MANY)
            ]
            for size in ((high, wide), (1, 1))
        )
        scaled |= {name: None for run in frame + driver for name, line in run.items() if line.enabled < 100}
        whole, empty = difference(*frame), difference(*driver)
        for name in names:
            values.setdefault(name, max(whole[name] - empty[name], 0))
    total = Counts(instructions=round(values["instructions"]))
    for one in events.flops:
        if one.needs in {"", *cpu_flags()}:
            total.lanes[one.kind, one.precision, one.bits] += round(evaluate(one.lanes, values))
    total.lanes = +total.lanes
    if not total.machine or not total.instructions:
        text = "the counters read 0 FLOPs or instructions: this (virtual) machine only pretends to have them"
        raise StudyError(text, CANNOT_RUN)
    printed = render(spec, scene.path, high, wide, target=target, general=True)
    made = backend.measurement("pmu", variant, printed, total)
    return Reading(made, shares(events.topdown, values), values, list(scaled))


def shares(topdown: Topdown | None, values: Mapping[str, float]) -> dict[str, float] | None:
    """The top-down split, by its fields."""
    if topdown is None:
        return None
    names = ("retiring", "bad_speculation", "front_end", "back_end", "other")
    formulas = {name: getattr(topdown, name) for name in names}
    return {name: evaluate(formula, values) for name, formula in formulas.items() if formula}


def measure(spec: Spec, scene: Scene, height: int, variant: str = "shipped") -> Measurement:
    """`read_frame`'s counts. `total` holds libm and libc too, and no bytes; `functions` is empty."""
    return read_frame(spec, scene, height, variant).measured
