"""Counts what a program does, exactly, by running it under QEMU's user-mode emulator.

A plugin (common/qemu_plugin.c) counts executions of every block between the entry of `phase_render` and
its return; study.decode says what the block's bytes do. The very program that is timed runs, unchanged,
some hundred times slower, with libm and libc seen from inside. No AVX-512, and one thread only: QEMU has
no AVX-512, and its plugins' counters are not atomic.

QEMU's plugin API: docs/devel/tcg-plugins.rst. Run for real with QEMU 7.2 (Debian 12); the plugin's other
branches (QEMU 9 and newer) are written from the documentation and not tested.
"""

from __future__ import annotations

import dataclasses
import functools
import os
import shutil
import subprocess
import tempfile
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from study import backend, calibration, store
from study.build import build
from study.cli import CANNOT_RUN, StudyError
from study.counts import Counts, Measured
from study.decode import Decoded, Disassembler
from study.elf import Program, exported
from study.registry import Spec, find_phase
from study.run import GENERAL, UNTIMED, _arguments

EMULATOR = "qemu-x86_64"
REGION = "phase_render"
_HEAD = "stepwise-qemu 1"
_PAGE, _LONGEST = 4096, 15  # bytes, of a page and of an instruction
_TROUBLE = {
    "threads": "started a second thread; QEMU's counters are not atomic: run it with one",
    "recursion": f"entered {REGION} again before it returned",
    "unfinished": f"ended inside {REGION}",
    "memory": "ran out of memory while counting",
}


@dataclass(frozen=True)
class Block:
    """Bytes at an address of the guest that were executed `count` times from their first instruction."""

    address: int
    count: int
    code: bytes


@dataclass
class Recording:
    """What the plugin wrote. `start`: where the program's first executable segment lies, in the guest.

    `maps`: (first address, one behind the last, offset in the file, file), in the host.
    `repeated`: (address, block's address, block's size) to bytes loaded and stored. `taken`: of conditional
    jumps to a function's entry, by address.
    """

    start: int
    regions: int
    maps: list[tuple[int, int, int, str]] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)
    repeated: dict[tuple[int, int, int], tuple[int, int]] = field(default_factory=dict)
    taken: dict[int, int] = field(default_factory=dict)


@dataclass
class Profile:
    """Counts of a program's region. `outside`: per library; `edges`: as in study.counts.Measured."""

    total: Counts
    functions: dict[str, Counts]
    outside: dict[str, Counts]
    edges: dict[str, dict[str, int]]
    output: str


def _natural(text: str, base: int = 10) -> int:
    """Digits and nothing else. ValueError."""
    if not text.isalnum():
        raise ValueError(text)
    return int(text, base)


def read(path: Path) -> Recording:
    """Parses what the plugin wrote. StudyError with file and line for anything else or a part of it."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError(f"{path}: {getattr(error, 'strerror', None) or 'not text'}") from None
    if not lines or lines[0] != _HEAD:
        raise StudyError(f"{path}:1: not a recording of common/qemu_plugin.c ('{_HEAD}' is required)")
    found, counted, whole, trouble = Recording(0, 0), 0, False, None
    for number, line in enumerate(lines[1:], 2):
        kind, *rest = line.split(" ", 4) if line.startswith("map ") else line.split(" ")
        try:
            if whole:
                raise ValueError
            if kind == "trouble":
                (trouble,) = rest
            elif kind == "start":
                (found.start,) = (_natural(x, 16) for x in rest)
            elif kind == "regions":
                (found.regions,) = map(_natural, rest)
            elif kind == "map":
                first, last, offset = (_natural(x, 16) for x in rest[:3])
                found.maps.append((first, last, offset, rest[3]))
            elif kind == "block":
                counted += 1
                address, count, code = _natural(rest[0], 16), _natural(rest[1]), bytes.fromhex(rest[2])
                if len(rest) != 3 or not count or not code:
                    raise ValueError
                found.blocks.append(Block(address, count, code))
            elif kind == "repeated":
                counted += 1
                key = _natural(rest[0], 16), _natural(rest[1], 16), _natural(rest[2])
                found.repeated[key] = _natural(rest[3]), _natural(rest[4])
            elif kind == "taken":
                counted += 1
                at, turns = rest
                found.taken[_natural(at, 16)] = _natural(turns)
            elif kind == "end":
                (announced,) = map(_natural, rest)
                whole = announced == counted
                if not whole:
                    raise ValueError
            else:
                raise ValueError
        except (ValueError, IndexError):
            raise StudyError(f"{path}:{number}: not a line of common/qemu_plugin.c: {line[:60]!r}") from None
    if not whole:
        raise StudyError(f"{path}:{len(lines)}: cut off here: its last line must be 'end'")
    if trouble != "none":
        raise StudyError(f"the program under QEMU {_TROUBLE.get(str(trouble), trouble)}")
    if not found.regions:
        raise StudyError(f"the program under QEMU never returned from {REGION}, or never entered it")
    return found


@dataclass
class _Repeated:
    """A repeated string instruction: QEMU 7.2 comes by once per element and once to see that none is left.

    So it was executed `executed` minus the elements times. A comparison that ends early lacks that last
    time: then `fresh`, how often it was reached from the instruction before it. Bytes are its accesses'.
    """

    one: Decoded
    counts: Counts
    executed: int = 0
    fresh: int = 0
    loaded: int = 0
    stored: int = 0

    def add(self) -> None:
        element = self.one.load + self.one.store
        elements = (self.loaded + self.stored) // element if element else 0
        times = max(self.executed - elements, self.fresh, 1)
        self.counts.add(dataclasses.replace(self.one, load=0, store=0), times)
        self.counts.load += self.loaded
        self.counts.store += self.stored


class _Place:
    """Whose code lies at an address of the guest."""

    def __init__(self, program: Program, recording: Recording) -> None:
        self.program = program
        self.bias = recording.start - program.code
        own = str(program.path.resolve())
        at = program.code_offset
        # QEMU may keep the guest's memory away from its own by an offset: the same file shows it.
        shift = next(
            (
                first + at - offset - recording.start
                for first, last, offset, path in recording.maps
                if path == own and offset <= at < offset + last - first
            ),
            0,
        )
        self.libraries = [(a - shift, b - shift, path) for a, b, _, path in recording.maps if path != own]

    def owner(self, address: int) -> str:
        for first, last, path in self.libraries:
            if first <= address < last:
                return path
        return "(no file)"

    def inside(self, address: int) -> bool:
        return any(a <= address - self.bias < b for a, b in self.program.segments)


def attribute(program: Program, recording: Recording, output: str = "") -> Profile:
    """Gives every block's instructions to the functions and libraries that they lie in.

    `total` is the program's own: the sum of `functions`, without what libraries do. A function's calls are
    the executions of its first instruction, however it was reached from elsewhere; a direct jump to another
    function's entry (a call in last place) is an edge like a call.
    """
    decoder, place = Disassembler(), _Place(program, recording)
    functions: dict[str, Counts] = defaultdict(Counts)
    libraries: dict[str, Counts] = defaultdict(Counts)
    edges: dict[str, Counter[str]] = defaultdict(Counter)
    repeated: dict[int, _Repeated] = {}
    taken = dict(recording.taken)  # of all blocks that end with the jump
    for block in recording.blocks:
        for one in decoder.decode(block.code, block.address):
            if not one.known:
                # QEMU 7 reports an instruction that reaches into the next page with the block before it, as
                # far as it was read, and runs it in the next block. No part of one is an instruction.
                if one.address % _PAGE > _PAGE - _LONGEST:
                    break
                raise StudyError(f"{program.path}: unknown instruction at {one.address - place.bias:#x}")
            at = one.address - place.bias
            if not place.inside(one.address):
                counts = libraries[place.owner(one.address)]
            elif function := program.function_at(at):
                counts = functions[function.source_name]
                if at == function.start and not function.is_part:
                    counts.calls += block.count
                if callee := _callee(program, one, place.bias):
                    always = one.is_call or one.mnemonic == "jmp"
                    turns = block.count if always else taken.pop(one.address, 0)
                    if one.is_call or callee != function.source_name:
                        edges[function.source_name][callee] += turns
                    else:  # the head of a loop, not a call
                        functions[callee].calls -= turns
            else:
                counts = libraries["plt"]
            if not one.repeat:
                counts.add(one, block.count)
                continue
            turns = repeated.setdefault(one.address, _Repeated(one, counts))
            turns.executed += block.count
            turns.fresh += block.count if one.address > block.address else 0
            loaded, stored = recording.repeated.get((one.address, block.address, len(block.code)), (0, 0))
            turns.loaded += loaded
            turns.stored += stored
    for turns in repeated.values():
        turns.add()
    _library_calls(libraries, edges)
    total = Counts()
    for counts in functions.values():
        total.merge(counts)
    total.calls = recording.regions
    return Profile(
        total,
        dict(sorted(functions.items())),
        {Path(path).name: counts for path, counts in sorted(libraries.items())},
        {caller: dict(+callees) for caller, callees in sorted(edges.items()) if +callees},
        output,
    )


def _callee(program: Program, one: Decoded, bias: int) -> str | None:
    """Whose entry a direct call or jump goes to."""
    if not one.target:
        return None
    target = one.target - bias
    if name := program.imports.get(target):
        return name
    function = program.function_at(target)
    return function.source_name if function and function.start == target and not function.is_part else None


def _library_calls(libraries: dict[str, Counts], edges: dict[str, Counter[str]]) -> None:
    called: Counter[str] = Counter()
    for callees in edges.values():
        called.update(callees)
    for path, counts in libraries.items():
        if path.startswith("/"):
            counts.calls = sum(called[name] for name in exported(path) & called.keys())


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
    program = Program(arguments[0])
    begin, ends = program.find(region).start, program.returns_of(region)
    plugin = build("common", "qemu_plugin.so")  # type: ignore[arg-type]
    with tempfile.TemporaryDirectory(prefix="stepwise-qemu-") as folder:
        options = {
            "code": f"{program.code:x}",
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
            done = subprocess.run(
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
        out = Path(folder) / "recording"
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
    return attribute(Program(arguments[0]), recording, output)


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
    here = Path(__file__).parent
    analysis = [here / f"{name}.py" for name in ("qemu", "backend", "elf", "decode", "counts", "calibration")]
    files = (program, plugin, Path(emulator()), calibration.EXPECTED, *analysis)

    def differences(part: str) -> list[str]:
        try:
            return calibrate(part)
        except StudyError as error:  # what cannot be run is not counted right
            return [str(error)]

    return backend.known_work(program.parent / "qemu.json", files, calibration_parts(), differences)


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
