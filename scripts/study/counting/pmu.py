"""Counts by the processor's own counters (perf stat), where the kernel offers them.

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

import ast
import functools
import math
import operator
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from study.core import machine, store, temporary
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.registry import Spec, cpu_flags
from study.core.run import GENERAL, _arguments, cpu_set, environment, render
from study.counting import backend
from study.counting.counts import Counts, Measured
from study.counting.hardware import perf
from study.counting.hardware.perf_stat import Line, parse

FOLDER = Path(__file__).with_name("events")
PARANOID = Path("/proc/sys/kernel/perf_event_paranoid")
FEW, MANY = 1, 3  # frames, whose difference is measured
ADDS = "FLOPs, cycles and a top-down split by hardware"
_KEYS = {"microarchitectures", "source", "notes", "events", "groups", "flops", "topdown"}
_OPERATORS: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


@dataclass
class Reading:
    """A frame by the counters. `topdown`: shares of the slots; `scaled`: events that shared a counter.

    `measured.calibrated` is None: not yet validated.
    """

    measured: Measured
    cycles: float
    loads: float | None
    stores: float | None
    topdown: dict[str, float] | None
    events: dict[str, float]
    scaled: list[str] = field(default_factory=list)
    source: str = ""

    @property
    def remark(self) -> str:
        flagged = f"; scaled, counters were shared: {', '.join(self.scaled)}" if self.scaled else ""
        return f"not yet validated on a machine with counters{flagged}"


def evaluate(formula: str, values: dict[str, float]) -> float:
    """Sums, differences, products and quotients of events and numbers. StudyError for anything else."""

    def value(node: ast.AST) -> float:
        if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            return _OPERATORS[type(node.op)](value(node.left), value(node.right))
        if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
            return node.value
        if isinstance(node, ast.Name) and node.id in values:
            return values[node.id]
        raise StudyError(f"formula '{formula}': {ast.unparse(node)} is neither event nor number")

    try:
        return value(ast.parse(formula, mode="eval").body)
    except SyntaxError:
        raise StudyError(f"formula '{formula}': not a formula") from None
    except ZeroDivisionError:
        return math.nan


def load(path: Path) -> dict[str, Any]:
    """One events file, checked: its keys, and that groups and formulas name its events. StudyError."""
    data = store.read_json(path)
    if not isinstance(data, dict) or data.keys() != _KEYS:
        raise StudyError(f"{path}: must be an object of {', '.join(sorted(_KEYS))}")
    events = data["events"]
    for name, event in events.items():
        if not event.get("perf") or not event.get("source"):
            raise StudyError(f"{path}: event {name}: 'perf' and 'source' are required")
    for name in (name for group in data["groups"] for name in group):
        if name not in events:
            raise StudyError(f"{path}: groups: no event {name}")
    if missing := events.keys() - {name for group in data["groups"] for name in group}:
        raise StudyError(f"{path}: in no group: {', '.join(sorted(missing))}")
    ones = dict.fromkeys(events, 1.0)
    topdown = data["topdown"] or {}
    for formula in [one["lanes"] for one in data["flops"]] + [
        value for key, value in topdown.items() if key not in ("source", "together")
    ]:
        try:
            evaluate(formula, ones)
        except StudyError as error:
            raise StudyError(f"{path}: {error}") from None
    return data


@functools.cache
def events_for(microarchitecture: str | None) -> dict[str, Any]:
    """The events file of a microarchitecture. StudyError (cannot run) if there is none."""
    known: list[str] = []
    for path in sorted(FOLDER.glob("*.json")):
        data = load(path)
        if microarchitecture in data["microarchitectures"]:
            return data
        known += data["microarchitectures"]
    raise StudyError(
        f"no events file for {microarchitecture or 'this processor'} (there are {', '.join(known)}); "
        "add scripts/study/counting/events/NAME.json",
        CANNOT_RUN,
    )


def tool() -> str:
    """Path of a perf that starts. StudyError if there is none."""
    path = perf.program()
    if not path:
        raise StudyError(
            "perf is missing (apt install linux-perf, on Ubuntu linux-tools-generic)",
            CANNOT_RUN,
        )
    return path


def available() -> tuple[bool, str]:
    """Whether hardware counters can be read here, and why not in one line (or the events' source)."""
    try:
        events = events_for(machine.cpu()["microarchitecture"])
        _stat(["true"], ["instructions", "cycles"], events, None)
    except StudyError as error:
        return False, f"no hardware counters here; they would add {ADDS} ({error})"
    return True, events["source"]


def _stat(
    command: list[str], names: list[str], events: dict[str, Any], cpus: set[int] | None
) -> dict[str, Line]:
    asked = ",".join(events["events"][name]["perf"] for name in names)
    topdown = events["topdown"]
    if topdown and topdown["together"] and topdown["slots"] in names:
        asked = f"{{{asked}}}:u"  # the metrics are read with the slots or not at all
    program = tool()
    with temporary.folder(prefix="stepwise-perf-") as folder:
        out = folder / "perf.csv"
        try:
            done = child.run(
                [program, "stat", "-x", ";", "-o", str(out), "-e", asked, "--", *command],
                capture_output=True,
                text=True,
                errors="replace",
                env=environment(more=GENERAL | {"LC_ALL": "C"}),
                preexec_fn=(lambda: os.sched_setaffinity(0, cpus)) if cpus else None,
            )
        except OSError as error:
            raise StudyError(f"{program}: {error.strerror}", CANNOT_RUN) from None
        if done.returncode:
            raise _refusal(done.stderr, command, done.returncode)
        try:
            return parse(out, names)
        except StudyError as error:
            # The file is gone when this is read: the line's number tells nothing.
            raise StudyError(str(error).replace(f"{out}:", "perf stat, line "), error.exit_status) from None


def _refusal(said: str, command: list[str], status: int) -> StudyError:
    if PARANOID.exists() and ("perf_event_paranoid" in said or "No permission" in said):
        now = PARANOID.read_text().strip()
        return StudyError(
            f"perf may not count here: kernel.perf_event_paranoid is {now}; "
            "`sudo sysctl kernel.perf_event_paranoid=2` lets it",
            CANNOT_RUN,
        )
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    if "Cannot find PMU" in said or "event syntax error" in said:
        reason = next((line.lstrip("\\_ ") for line in lines if "\\_" in line), lines[0])
        return StudyError(
            f"perf knows no such event here ({reason}): the kernel offers no counters", CANNOT_RUN
        )
    return StudyError(
        f"perf stat {Path(command[0]).name}: exit status {status}{f' ({lines[-1]})' if lines else ''}"
    )


def difference(few: dict[str, Line], many: dict[str, Line]) -> dict[str, float]:
    """Per frame: what MANY frames count more than FEW, over the frames between. StudyError if it is less."""
    found = {}
    for name, line in few.items():
        more = many[name].value - line.value
        if not more >= 0:
            raise StudyError(
                f"{line.event}: {many[name].value:.0f} in {MANY} frames and {line.value:.0f} in {FEW}"
            )
        found[name] = more / (MANY - FEW)
    return found


def read_frame(
    spec: Spec | str,
    scene_path: Path | str,
    height: int,
    width: int | None = None,
    *,
    cpu: int | None = None,
    target: str = "render",
) -> Reading:
    """One frame by the counters of this machine; `cpu`: pinned to it. StudyError if it has none."""
    spec = Spec.parse(spec) if isinstance(spec, str) else spec
    events = events_for(machine.cpu()["microarchitecture"])
    tool()
    scene, pinned = Path(scene_path).resolve(), cpu_set(cpu, 1)
    values: dict[str, float] = {}
    scaled: dict[str, None] = {}
    for group in events["groups"]:
        names = [n for n in group if events["events"][n].get("needs", "") in {"", *cpu_flags()}]
        per_frame = []
        for size in ((height, width), (1, 1)):
            lines = [
                _stat(_arguments(spec, scene, *size, reps=reps, target=target), names, events, pinned)
                for reps in (FEW, MANY)
            ]
            per_frame.append(difference(*lines))
            scaled |= {name: None for run in lines for name, line in run.items() if line.enabled < 100}
        frame, driver = per_frame
        for name in names:
            values.setdefault(name, max(frame[name] - driver[name], 0))
    header = render(spec, scene, height, width, target=target, general=True)
    return _reading(events, values, list(scaled), header, target)


def _reading(
    events: dict[str, Any],
    values: dict[str, float],
    scaled: list[str],
    header: dict[str, Any],
    target: str,
) -> Reading:
    total = Counts(instructions=round(values["instructions"]))
    for one in events["flops"]:
        if one.get("needs", "") in {"", *cpu_flags()}:
            key = one["kind"], one["precision"], one["bits"]
            total.lanes[key] += round(evaluate(one["lanes"], values))
    total.lanes = +total.lanes
    if not total.machine or not total.instructions:
        raise StudyError(
            "the counters read 0 FLOPs or instructions: this (virtual) machine only pretends to have them",
            CANNOT_RUN,
        )
    topdown = events["topdown"]
    shares = topdown and {
        key: evaluate(formula, values)
        for key, formula in topdown.items()
        if key not in ("source", "together", "slots")
    }
    measured = Measured(
        backend="pmu",
        variant=backend.variant(target),
        total=total,
        functions={},
        outside=None,
        calibrated=None,
        **backend.header(header),
    )
    return Reading(
        measured,
        values["cycles"],
        values.get("loads"),
        values.get("stores"),
        shares,
        values,
        scaled,
        events["source"],
    )


def measure(*frame: Any, **how: Any) -> Measured:
    """`read_frame`'s counts. `total` holds libm and libc too, no bytes and no mix; `functions` is empty."""
    return read_frame(*frame, **how).measured
