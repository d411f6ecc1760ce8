"""Counts what a program does, exactly, by running it under QEMU's user-mode emulator.

A plugin (common/counting/qemu_plugin.c) counts executions of every block between the entry of `phase_render`
and its return; decode says what the block's bytes do. The very program that is timed runs, unchanged,
some hundred times slower, with libm and libc seen from inside. No AVX-512, and one thread only: QEMU has
no AVX-512, and its plugins' counters are not atomic.

QEMU's plugin API: docs/devel/tcg-plugins.rst. Run for real with QEMU 7.2 (Debian 12); the plugin's other
branches (QEMU 9 and newer) are written from the documentation and not tested.
"""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
from pathlib import Path

from study.core import store, temporary
from study.core.build import build
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.registry import Spec, find_phase
from study.core.run import GENERAL, UNTIMED, _arguments
from study.counting import backend, calibration, elf
from study.counting.counts import Measured
from study.counting.recording import REGION, Profile, Recording, attribute, read

EMULATOR = "qemu-x86_64"


@functools.cache
def emulator() -> str:
    """Path of the emulator. StudyError if it is missing."""
    path = shutil.which(EMULATOR)
    if not path:
        raise StudyError(
            f"{EMULATOR} is missing (Debian, Ubuntu: apt install qemu-user); it would count by emulation",
            CANNOT_RUN,
        )
    return path


def available() -> str | None:
    """None if this back end can run here, else why not, in one line."""
    try:
        emulator()
    except StudyError as error:
        return str(error)
    return None


def record(arguments: list[str], region: str = REGION, *, callback: bool = False) -> tuple[Recording, str]:
    """Runs a program under QEMU: what the plugin wrote, and the program's standard output.

    Arguments are taken in a folder of the run's own: file names must be absolute. `callback`: count by
    callbacks, as QEMU 9 and newer need it. StudyError for a crash, or a plugin that cannot be loaded.
    """
    program = elf.read(arguments[0])
    begin, ends = program.find(region).start, program.returns_of(region)
    plugin = build("common", "qemu_plugin.so")  # type: ignore[arg-type]
    with temporary.folder(prefix="stepwise-qemu-") as folder:
        options = {
            "code": f"{program.code.address:x}",
            "begin": f"{begin:x}",
            "end": "+".join(f"{end:x}" for end in ends),
            "callback": "on" if callback else "off",
            "out": "recording",  # in `folder`: a comma would end it
        }
        told = ",".join(
            [
                str(plugin).replace(",", ",,"),
                *(f"{key}={value}" for key, value in options.items()),
                *(f"jump={a:x}+{b:x}+{c:x}" for a, b, c in program.conditional_entries()),
            ]
        )
        try:
            done = child.run(
                [emulator(), "-cpu", "max", "-plugin", told, *arguments],
                capture_output=True,
                text=True,
                errors="replace",
                cwd=folder,
                env=os.environ | GENERAL | {UNTIMED: "1"},
                stdin=subprocess.DEVNULL,
            )
        except OSError as error:
            raise StudyError(f"{EMULATOR}: {error.strerror}", CANNOT_RUN) from None
        name = Path(arguments[0]).name
        if done.returncode:
            raise backend.failed(done, name, "QEMU", "; QEMU has no AVX-512")
        out = folder / "recording"
        if not out.exists():
            said = done.stderr.strip().splitlines()
            raise StudyError(
                f"{name} under QEMU: nothing was recorded{f' ({said[-1]})' if said else ''}; "
                "a qemu-user with plugins is required"
            )
        return read(out), done.stdout


def count(arguments: list[str], region: str = REGION, *, callback: bool = False) -> Profile:
    """`record` and `attribute` in one: counts of a program's region."""
    recording, output = record(arguments, region, callback=callback)
    return attribute(elf.read(arguments[0]), recording, output)


def refuse(spec: Spec) -> str | None:
    """Why QEMU cannot run the phase, or None."""
    for name in dict.fromkeys([spec.phase, spec.flags_from]):
        wide = [flag for flag in find_phase(name).isa if flag.startswith("avx512")]
        if wide:
            return f"{spec}: needs {wide[0]}, which QEMU does not have; the block counters count it"
    return None


def calibrate(part: str, repeats: int = 7) -> list[str]:
    """Differences of the known work's counts from what they must be, one line each."""
    profile = count([str(build("calibration", "calibrate")), part, str(repeats)])
    return calibration.differences(profile.functions, part, repeats, profile.edges)


def calibration_parts() -> list[str]:
    """Those that QEMU can run: no AVX-512, one thread."""
    table = store.read_json(calibration.EXPECTED)["parts"]
    return [
        name
        for name, part in table.items()
        if name != "threads" and not any(flag.startswith("avx512") for flag in part["needs"])
    ]


@functools.cache
def calibrated() -> bool:
    """Whether the known work's counts were exact on this machine, in all parts that QEMU can run.

    Kept in build/calibration/qemu.json, by program, plugin, emulator and analysis.
    """
    program, plugin = build("calibration", "calibrate"), build("common", "qemu_plugin.so")
    files = (program, plugin, Path(emulator()), calibration.EXPECTED)

    def differences(part: str) -> list[str]:
        try:
            return calibrate(part)
        except StudyError as error:  # what cannot be run is not counted right
            return [str(error)]

    return backend.known_work(program.parent / "qemu.json", __name__, files, calibration_parts(), differences)


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
    if reason := refuse(spec):
        raise StudyError(reason, CANNOT_RUN)
    emulator()
    scene = Path(scene_path).resolve()
    arguments = [*_arguments(spec, scene, height, width, target=target), "--json"]
    profile = count(arguments)
    header = backend.header_of(profile.output, arguments[0], "QEMU")
    return Measured(
        backend="qemu",
        variant=backend.variant(target),
        total=profile.total,
        functions=profile.functions,
        outside=profile.outside,
        calibrated=calibrated(),
        edges=profile.edges,
        **header,
    )
