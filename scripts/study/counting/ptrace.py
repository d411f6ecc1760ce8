"""Counts what a program does, exactly, by running it one instruction at a time on this processor.

common/counting/stepper.c notes each instruction between the entry of `phase_render` and its return, and the
active lanes where it is masked. The very program that is timed runs, unchanged, with all the instruction
sets of the CPU, libm and libc seen from inside, some hundred thousand times slower. One thread only; calls
are not counted. Nothing is shared with the block counters but the decoder.
"""

import dataclasses
import functools
import itertools
import os
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec

from study.core import temporary
from study.core.build import build
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.registry import Scene, Spec
from study.core.run import USABLE
from study.counting import backend, calibration, elf
from study.counting.backend import REGION
from study.counting.counts import Counts
from study.counting.decode import decode
from study.counting.schema import Measurement

HOW = "single steps"
_CPUS = itertools.cycle(USABLE)
_TROUBLE = {
    "threads": "started a second thread, which is not counted: run it with one",
    "recursion": f"entered {REGION} again before it returned",
    "unfinished": f"ended inside {REGION}",
}


class Step(msgspec.Struct, array_like=True):
    """One instruction, as the stepper writes it; `active`: lanes of a masked one, for 1, 2, 4 … 32 lanes."""

    address: int
    count: int
    code: str
    loaded: int
    stored: int
    active: list[int]


class Steps(msgspec.Struct):
    """What the stepper writes. `maps`: first address, one behind the last, file."""

    trouble: Literal["none", "threads", "recursion", "unfinished"]
    bias: int
    regions: int
    maps: list[tuple[int, int, str]]
    steps: list[Step]


@dataclass
class Profile:
    """Counts of a program's region. `outside`: per library; `output`: what the program printed."""

    total: Counts
    functions: dict[str, Counts]
    outside: dict[str, Counts]
    output: str


def _stepper() -> Path:
    return build("common", "stepper")


def missing() -> str | None:
    """None if this back end can run here, else why not, in one line."""
    done = child.run([_stepper(), "--probe"], capture_output=True, text=True, errors="replace")
    if done.returncode == 0:
        return None
    said = done.stderr.strip().splitlines() or [f"stepper: exit status {done.returncode}"]
    return f"ptrace is not allowed here ({said[-1]}); it would count by single steps, AVX-512 too"


def count(arguments: list[str]) -> Profile:
    """Steps a program. Arguments are taken in a folder of the run's own: file names must be absolute.

    StudyError for a crash, or where nothing may be traced.
    """
    program = elf.read(arguments[0])
    name = Path(arguments[0]).name
    with temporary.folder(prefix="stepwise-steps-") as folder:
        out = folder / "steps.json"
        addresses = [f"{address:x}" for address in (program.entry, program.find(REGION).start)]
        # Both in turn on one CPU: a step waits for no other core to wake.
        alone = functools.partial(os.sched_setaffinity, 0, {next(_CPUS)})
        try:
            command = [str(_stepper()), str(out), *addresses, *arguments]
            done = backend.run(command, name, HOW, cwd=folder, preexec_fn=alone)
        except StudyError as error:
            if "stepper: " in str(error) and (why := missing()):
                raise StudyError(why, CANNOT_RUN) from None
            raise
        found = msgspec.json.decode(out.read_bytes(), type=Steps)
    if found.trouble != "none":
        raise StudyError(f"{name} under {HOW} {_TROUBLE[found.trouble]}")
    if not found.regions:
        raise StudyError(f"{name} under {HOW} never returned from {REGION}, or never entered it")
    return _profile(program, found, done.stdout)


def _profile(program: elf.Program, found: Steps, output: str) -> Profile:
    """Every instruction to the function or library that it lies in; `total` is of the functions."""
    functions: dict[str, Counts] = defaultdict(Counts)
    outside: dict[str, Counts] = defaultdict(Counts)
    for step in found.steps:
        address = step.address - found.bias
        if function := program.function_at(address):
            counts = functions[function.source_name]
        elif any(s.address <= address < s.address + s.size for s in program.segments):
            counts = outside["plt"]
        else:
            inside = (path for first, last, path in found.maps if first <= step.address < last)
            counts = outside[Path(next(inside, "(no file)")).name]
        one = decode(bytes.fromhex(step.code), address)[0]
        if one.repeat:
            one = dataclasses.replace(one, load=0, store=0)
            counts.load += step.loaded
            counts.store += step.stored
        masked = one.mask is not None and one.lanes
        counts.add(one, step.count, step.active[one.lanes.bit_length() - 1] if masked else None)
    return Profile(Counts.total(functions.values()), dict(functions), dict(outside), output)


def calibrate(part: str, repeats: int = 7) -> list[str]:
    """Differences of the known work's counts from what they must be, one line each."""
    try:
        profile = count([str(build("calibration", "calibrate")), part, str(repeats)])
    except StudyError as error:  # what cannot be run is not counted right
        return [str(error)]
    return calibration.differences(profile.functions, part, repeats)


@functools.cache
def calibrated() -> bool:
    """Whether the known work's counts were exact here, in all parts that this CPU can run on one thread."""
    program = build("calibration", "calibrate")
    files = (program, _stepper(), calibration.EXPECTED)
    parts = [part for part in calibration.runnable() if part != "threads"]
    return backend.known_work(program.parent / "ptrace.known", files, parts, calibrate)


def measure(spec: Spec, scene: Scene, height: int, variant: str = "shipped") -> Measurement:
    found = count(backend.command(spec, scene, height, variant))
    made = found.total, found.functions, found.outside
    return backend.measurement("ptrace", variant, found.output, *made, calibrated=calibrated())
