"""Counts by the processor's own counters, as perf stat reads them, where the kernel offers them.

Events of each microarchitecture are in events/NAME.json, with where they are from.

What is counted is a process, not the timed region. So the same picture is rendered with 1 and with 3
frames, and half the difference is a frame: start, scene and set-up fall out. What the driver does around
each frame (clocks, record) is taken off by the same difference of a picture of one pixel. Left in are the
driver's own per pixel (the 8-bit picture: six minima and maxima); what is lost is one pixel of the phase's.
Events are measured in groups that fit the counters, each in runs of its own. User mode only. libm and libc
are inside. Bytes are not counted, nor, by Intel's events, which lanes a mask left out.

Not yet validated: no machine with such counters was at hand. The output says so.
"""

import csv
import functools
from collections.abc import Sequence
from pathlib import Path

import msgspec

from study.core import machine, temporary
from study.core.cli import BAD_INPUT, CANNOT_RUN, StudyError
from study.core.host import child
from study.core.registry import Scene, Spec, cpu_flags
from study.core.run import GENERAL, _arguments, environment, render
from study.counting import backend, perf
from study.counting.counts import Counts
from study.counting.schema import Measurement

FOLDER = Path(__file__).with_name("events")
UNSUPPORTED = "<not supported>"
FEW, MANY = 1, 3  # frames, whose difference is measured


class Event(msgspec.Struct):
    """`perf`: as perf stat -e takes it; `needs`: a CPU flag."""

    perf: str
    source: str
    needs: str = ""


class Flop(msgspec.Struct):
    """`lanes`: operations for each count of the event."""

    kind: str
    precision: str
    bits: int
    event: str
    lanes: float
    needs: str = ""


class Events(msgspec.Struct, forbid_unknown_fields=True):
    """events/NAME.json."""

    microarchitectures: list[str]
    source: str
    notes: list[str]
    events: dict[str, Event]
    groups: list[list[str]]
    flops: list[Flop]


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


def here() -> Events:
    return events_for(machine.cpu().microarchitecture)


def missing() -> str | None:
    """None, or why hardware counters cannot be read here, in one line."""
    try:
        _stat(["true"], ["instructions", "cycles"], here())
    except StudyError as error:
        return f"no hardware counters here; they would add FLOPs and instructions by hardware ({error})"
    return None


def parse(text: str, names: Sequence[str]) -> dict[str, float]:
    """Output of `perf stat -x ';'` of the events `names`, in that order (perf-stat(1), CSV FORMAT): values,
    scaled to the whole run where events shared a counter.

    StudyError for an event that is not supported or was not counted, and for other text. An unsupported event
    keeps the others of its group from being counted: it is the one that is named.
    """
    fields = [one for one in csv.reader(text.splitlines(), delimiter=";") if len(one) > 4 and one[2]]
    if len(fields) != len(names):
        raise StudyError(f"perf stat: {len(fields)} events, {len(names)} were asked for")
    found = {}
    for value, _, event, *_ in sorted(fields, key=lambda one: one[0] != UNSUPPORTED):
        if value.startswith("<not"):
            cannot = CANNOT_RUN if value == UNSUPPORTED else BAD_INPUT
            raise StudyError(f"perf stat: {event} was {value.strip('<>')}", cannot)
    for name, (value, _, event, *_) in zip(names, fields, strict=True):
        try:
            found[name] = float(value)
        except ValueError:
            raise StudyError(f"perf stat: {event}: no number: {value[:40]!r}") from None
    return found


def _stat(command: list[str], names: Sequence[str], events: Events) -> dict[str, float]:
    program = perf.program()
    if not program:
        raise StudyError("perf is missing (apt install linux-perf, Ubuntu: linux-tools-generic)", CANNOT_RUN)
    with temporary.folder(prefix="stepwise-perf-") as folder:
        out, asked = folder / "perf.csv", ",".join(events.events[name].perf for name in names)
        done = child.run(
            [program, "stat", "-x", ";", "-o", str(out), "-e", asked, "--", *command],
            capture_output=True,
            text=True,
            errors="replace",
            env=environment(more=GENERAL | {"LC_ALL": "C"}),
        )
        if done.returncode:
            said = [line.strip() for line in done.stderr.splitlines() if line.strip()]
            last = (said or [f"exit status {done.returncode}"])[-1]
            raise StudyError(perf.forbidden() or f"perf stat: {last}", CANNOT_RUN)
        return parse(out.read_text(encoding="utf-8"), names)


def measure(spec: Spec, scene: Scene, height: int, variant: str = "shipped") -> Measurement:
    """One frame by the counters of this machine; StudyError if it has none. `total` holds libm and libc too,
    and no bytes; `functions` is empty."""
    events, flags = here(), {"", *cpu_flags()}
    target, (wide, high) = backend.TARGETS[variant], scene.size(height)

    def a_frame(names: list[str], *size: int) -> dict[str, float]:
        """Per frame: what MANY frames count more than FEW, over the frames between."""
        few, many = (
            _stat(_arguments(spec, scene.path.resolve(), *size, reps=reps, target=target), names, events)
            for reps in (FEW, MANY)
        )
        return {name: (many[name] - few[name]) / (MANY - FEW) for name in names}

    values: dict[str, float] = {}
    for group in events.groups:
        names = [name for name in group if events.events[name].needs in flags]
        whole, empty = a_frame(names, high, wide), a_frame(names, 1, 1)
        values = {name: max(whole[name] - empty[name], 0) for name in names} | values
    total = Counts(instructions=round(values["instructions"]))
    for one in events.flops:
        if one.needs in flags:
            total.lanes[one.kind, one.precision, one.bits] += round(one.lanes * values[one.event])
    total.lanes = +total.lanes
    if not total.machine or not total.instructions:
        text = "the counters read 0 FLOPs or instructions: this (virtual) machine only pretends to have them"
        raise StudyError(text, CANNOT_RUN)
    printed = render(spec, scene.path, high, wide, target=target, general=True)
    return backend.measurement("pmu", variant, printed, total)
