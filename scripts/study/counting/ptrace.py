"""Counts what a program does, exactly, by running it one instruction at a time on this processor.

common/counting/stepper.c notes each instruction between the entry of `phase_render` and its return, and the
active lanes where it is masked. The very program that is timed runs, unchanged, with all the instruction
sets of the CPU, libm and libc seen from inside, some hundred thousand times slower. One thread only.
Nothing is shared with the block counters but the decoder.
"""

from __future__ import annotations

import functools
import itertools
import os
import subprocess
from pathlib import Path

from study.core import temporary
from study.core.build import build
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.registry import Spec
from study.core.run import GENERAL, UNTIMED, USABLE, _arguments
from study.counting import backend, calibration, elf
from study.counting.counts import Measured
from study.counting.decode import Disassembler
from study.counting.recording import REGION, Block, Profile, Recording, attribute, read

HOW = "single steps"
_CPUS = itertools.cycle(USABLE)


def _stepper() -> Path:
    return build("common", "stepper")  # type: ignore[arg-type]


def available() -> str | None:
    """None if this back end can run here, else why not, in one line."""
    done = child.run([_stepper(), "--probe"], capture_output=True, text=True, errors="replace")
    if done.returncode == 0:
        return None
    said = done.stderr.strip().splitlines() or [f"stepper: exit status {done.returncode}"]
    return f"ptrace is not allowed here ({said[-1]}); it would count by single steps, AVX-512 too"


def record(arguments: list[str], region: str = REGION) -> tuple[Recording, str]:
    """Steps a program: what the stepper wrote, and the program's standard output.

    Arguments are taken in a folder of the run's own: file names must be absolute. StudyError for a crash, or
    where nothing may be traced.
    """
    program = elf.read(arguments[0])
    jumps = [f"{a:x}+{b:x}" for a, b, _ in program.conditional_entries()]
    addresses = (program.entry, program.code.address, program.find(region).start)
    with temporary.folder(prefix="stepwise-steps-") as folder:
        out = folder / "recording"
        done = child.run(
            [_stepper(), out, *(f"{a:x}" for a in addresses), *jumps, "--", *arguments],
            capture_output=True,
            text=True,
            errors="replace",
            cwd=folder,
            env=os.environ | GENERAL | {UNTIMED: "1"},
            stdin=subprocess.DEVNULL,
            # Both in turn on one CPU: a step waits for no other core to wake.
            preexec_fn=functools.partial(os.sched_setaffinity, 0, {next(_CPUS)}),
        )
        if done.returncode:
            if "stepper: " in done.stderr and (why := available()):
                raise StudyError(why, CANNOT_RUN)
            raise backend.failed(done, Path(arguments[0]).name, HOW)
        return joined(read(out, "stepper")), done.stdout


def joined(recording: Recording) -> Recording:
    """Instructions that follow each other and were executed as often as one block: what is known of values
    along straight-line code (counting.decode) is known only within a block.
    """
    decoder, blocks = Disassembler(), []
    open_end, behind = False, 0
    for step in sorted(recording.blocks, key=lambda block: block.address):
        one = decoder.decode(step.code, step.address)[0]
        code = step.code[: one.length]
        last = blocks[-1] if blocks else None
        if last and open_end and behind == step.address and last.count == step.count and not one.repeat:
            blocks[-1] = Block(last.address, last.count, last.code + code)
        else:
            blocks.append(Block(step.address, step.count, code))
        open_end, behind = not one.ends_block and not one.repeat, step.address + one.length
    recording.blocks = blocks
    return recording


def count(arguments: list[str], region: str = REGION) -> Profile:
    """`record` and `attribute` in one: counts of a program's region."""
    recording, output = record(arguments, region)
    return attribute(elf.read(arguments[0]), recording, output)


def calibrate(part: str, repeats: int = 7) -> list[str]:
    """Differences of the known work's counts from what they must be, one line each."""
    profile = count([str(build("calibration", "calibrate")), part, str(repeats)])  # type: ignore[arg-type]
    found = calibration.differences(profile.functions, part, repeats, profile.edges)
    known = sum(counts.machine for counts in calibration.expected(part, repeats).values())
    if known and profile.total.machine != known:
        found.append(f"{part}, FLOPs in total: {profile.total.machine} instead of {known}")
    return found


def calibration_parts() -> list[str]:
    """Those that this CPU can run, on one thread."""
    return [part for part, lacking in calibration.parts().items() if not lacking and part != "threads"]


@functools.cache
def calibrated() -> bool:
    """Whether the known work's counts were exact on this machine, in all parts that it can run.

    Kept in build/calibration/ptrace.json, by program, stepper and analysis.
    """
    program = build("calibration", "calibrate")  # type: ignore[arg-type]
    files = (program, _stepper(), calibration.EXPECTED)

    def differences(part: str) -> list[str]:
        try:
            return calibrate(part)
        except StudyError as error:  # what cannot be run is not counted right
            return [str(error)]

    return backend.known_work(
        program.parent / "ptrace.json", __name__, files, calibration_parts(), differences
    )


def measure(
    spec: Spec | str,
    scene_path: Path | str,
    height: int,
    width: int | None = None,
    *,
    target: str = "render",
) -> Measured:
    """One picture on one thread. `target`: build/SPEC/TARGET, for one without inlining render-calls."""
    spec = Spec.parse(spec) if isinstance(spec, str) else spec
    arguments = [*_arguments(spec, Path(scene_path).resolve(), height, width, target=target), "--json"]
    profile = count(arguments)
    return Measured(
        backend="ptrace",
        variant=backend.variant(target),
        total=profile.total,
        functions=profile.functions,
        outside=profile.outside,
        calibrated=calibrated(),
        edges=profile.edges,
        **backend.header_of(profile.output, arguments[0], HOW),
    )
