"""What counting.qemu's plugin or counting.ptrace's stepper wrote: reads it, gives its blocks to functions,
libraries and call edges.
"""

from __future__ import annotations

import dataclasses
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from study.core.cli import StudyError
from study.counting.counts import Counts
from study.counting.decode import Decoded, Disassembler
from study.counting.elf import Program, exported

REGION = "phase_render"
# Who writes such a file: its first line, and how the program is said to have run.
_WRITERS = {
    "qemu_plugin": ("stepwise-qemu 1", "under QEMU"),
    "stepper": ("stepwise-steps 1", "in single steps"),
}
_WIDTHS = 6  # a masked instruction's active lanes are told for 1, 2, 4 … 32 of them
_PAGE, _LONGEST = 4096, 15  # bytes, of a page and of an instruction
_TROUBLE = {
    "threads": "started a second thread, which is not counted: run it with one",
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
    jumps to a function's entry, by address. `masked`: active lanes of a masked instruction, by address, for
    1, 2, 4 … 32 lanes.
    """

    start: int
    regions: int
    maps: list[tuple[int, int, int, str]] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)
    repeated: dict[tuple[int, int, int], tuple[int, int]] = field(default_factory=dict)
    taken: dict[int, int] = field(default_factory=dict)
    masked: dict[int, list[int]] = field(default_factory=dict)


@dataclass
class Profile:
    """Counts of a program's region. `outside`: per library; `edges`: as in study.counting.counts.Measured."""

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


def read(path: Path, writer: str = "qemu_plugin") -> Recording:
    """Parses what the writer wrote. StudyError with file and line for anything else or a part of it."""
    head, how = _WRITERS[writer]
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError(f"{path}: {getattr(error, 'strerror', None) or 'not text'}") from None
    if not lines or lines[0] != head:
        raise StudyError(f"{path}:1: not a recording of common/counting/{writer}.c ('{head}' is required)")
    found, counted, whole, trouble = Recording(0, 0), 0, False, None
    for number, line in enumerate(lines[1:], 2):
        kind, *rest = line.split(" ", 4) if line.startswith("map ") else line.split(" ")
        try:
            if whole:
                raise ValueError
            if kind == "trouble":
                (trouble,) = rest
                if trouble not in ("none", *_TROUBLE):
                    raise ValueError
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
            elif kind == "masked":
                counted += 1
                at, *lanes = rest
                if len(lanes) != _WIDTHS:
                    raise ValueError
                found.masked[_natural(at, 16)] = [_natural(n) for n in lanes]
            elif kind == "end":
                (announced,) = map(_natural, rest)
                whole = announced == counted
                if not whole:
                    raise ValueError
            else:
                raise ValueError
        except (ValueError, IndexError):
            raise StudyError(
                f"{path}:{number}: not a line of common/counting/{writer}.c: {line[:60]!r}"
            ) from None
    if not whole:
        raise StudyError(f"{path}:{len(lines)}: cut off here: its last line must be 'end'")
    if trouble != "none":
        raise StudyError(f"the program {how} {_TROUBLE[str(trouble)]}")
    if not found.regions:
        raise StudyError(f"the program {how} never returned from {REGION}, or never entered it")
    return found


@dataclass
class _Repeated:
    """A repeated string instruction: QEMU 7.2 comes by once per element and once to see that none is left
    (the stepper writes its turns and its elements as one sum, which comes to the same).

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
        self.bias = recording.start - program.code.address
        own = str(program.path.resolve())
        at = program.code.offset
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
        return any(
            0 <= address - self.bias - s.address < s.size for s in self.program.segments if s.executable
        )


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
                lanes = recording.masked.get(one.address) if one.mask and one.lanes else None
                counts.add(one, block.count, lanes and lanes[one.lanes.bit_length() - 1])
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
