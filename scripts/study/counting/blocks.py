"""Assembly block counters: what the timed region executed, counted exactly by the program itself.

build/SPEC/render-blocks is the shipped code with a counter in every basic block (counting.assembly), and
render-blocks-calls the same source with its functions kept. What a block does is decoded from its bytes once;
times its count it is what was executed. Masked instructions add up their active lanes, repeated ones their
iterations. All instruction sets, any number of threads. libm and libc are not seen inside; direct calls of
them are (`edges`). Counters have 64 bits.
"""

from __future__ import annotations

import dataclasses
import functools
import subprocess
import threading
from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study.core import run, store
from study.core.build import build
from study.core.cli import StudyError
from study.core.registry import Spec
from study.core.schema import BROKEN
from study.counting import backend, calibration
from study.counting.assembly import digest
from study.counting.counts import Counts, Measured
from study.counting.decode import Decoded, Disassembler
from study.counting.elf import is_part, source_name

BACKEND = "blocks"
TARGETS = {"shipped": "render-blocks", "calls": "render-blocks-calls"}
ABSURD = 1 << 62  # executions of a block: centuries
CALIBRATION_REPEATS = 7
_LOCK = threading.Lock()


def missing() -> str | None:
    """None, or what is missing, in one line: all it needs is what builds and analyses a phase."""
    return None


@dataclass(frozen=True)
class Block:
    """`symbol`: of the function; `entry`: what enters the block calls the function."""

    symbol: str
    entry: bool
    code: tuple[Decoded, ...]


@dataclass(frozen=True)
class Table:
    """What the counters of one program stand for. `path`: of the file, for messages."""

    path: Path
    hash: str
    blocks: list[Block]
    calls: list[tuple[int, str, int | None]]
    masked: dict[tuple[int, int], int]
    repeated: dict[tuple[int, int], int]


def read_table(path: Path) -> Table:
    """StudyError for a table that is missing, cut off, changed or another thing's JSON.

    Decoded once for as long as its file is the same: many scenes are counted by one program.
    """
    try:
        about = path.stat()
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror}") from None
    return _read_table(path, about.st_mtime_ns, about.st_size, about.st_ino)


@functools.lru_cache(maxsize=4)
def _read_table(path: Path, *_: int) -> Table:
    data = store.read_json(path)
    try:
        if data["hash"] != digest(data):
            raise StudyError(f"{path}: was changed since it was made; remove its folder and build again")
        disassembler = Disassembler()
        blocks = [
            Block(
                b["function"], b["entry"], tuple(disassembler.decode(bytes.fromhex(b["bytes"]), b["offset"]))
            )
            for b in data["blocks"]
        ]
        return Table(
            path,
            data["hash"],
            blocks,
            [(int(a), str(b), c) for a, b, c in data["calls"]],
            {(int(b), int(i)): n for n, (b, i) in enumerate(data["masked"])},
            {(int(b), int(i)): n for n, (b, i) in enumerate(data["repeated"])},
        )
    except BROKEN as error:
        raise StudyError(
            f"{path}: not a block table of scripts/study/counting/assembly.py ({error!r})"
        ) from None


def _numbers(said: dict[str, Any], key: str, size: int, table: Table) -> list[int]:
    numbers = said.get(key)
    if not isinstance(numbers, list) or len(numbers) != size:
        have = len(numbers) if isinstance(numbers, list) else "no"
        raise StudyError(f"{table.path}: {size} counters are described, the program has {have} ({key})")
    for n in numbers:
        if not isinstance(n, int) or isinstance(n, bool) or not 0 <= n < ABSURD:
            raise StudyError(
                f"{table.path}: a counter says {n!r}, which cannot be: overflow, or a stray write"
            )
    return numbers


def evaluate(
    table: Table, said: dict[str, Any]
) -> tuple[Counts, dict[str, Counts], dict[str, dict[str, int]]]:
    """Total, functions by source name and edges, from what a program with counters printed."""
    if said.get("counts") != "basic blocks":
        raise StudyError(f"{table.path}: the program printed no counts of basic blocks")
    if said.get("table") != table.hash:
        raise StudyError(f"{table.path}: not the table of the program that ran; build it again")
    ran = _numbers(said, "blocks", len(table.blocks), table)
    active = _numbers(said, "masked", len(table.masked), table)
    iterations = _numbers(said, "repeated", len(table.repeated), table)
    functions: defaultdict[str, Counts] = defaultdict(Counts)
    for number, (block, times) in enumerate(zip(table.blocks, ran, strict=True)):
        if not times:
            continue
        counts = functions[source_name(block.symbol)]
        if block.entry and not is_part(block.symbol):
            counts.calls += times
        for place, one in enumerate(block.code):
            if (number, place) in table.repeated:
                rounds = iterations[table.repeated[number, place]]
                counts.load += one.load * rounds
                counts.store += one.store * rounds
                one = dataclasses.replace(one, load=0, store=0)
            lanes = table.masked.get((number, place))
            if lanes is not None and active[lanes] > one.lanes * times:
                raise StudyError(
                    f"{table.path}: {active[lanes]} lanes in {times} executions of {one.mnemonic} "
                    f"with {one.lanes}, which cannot be"
                )
            counts.add(one, times, None if lanes is None else active[lanes])
    total = Counts()
    for counts in functions.values():
        total.merge(counts)
    return total, dict(functions), _edges(table, ran)


def _edges(table: Table, ran: list[int]) -> dict[str, dict[str, int]]:
    edges: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for number, callee, otherwise in table.calls:
        caller = table.blocks[number].symbol
        times = ran[number] - (0 if otherwise is None else ran[otherwise])
        if times < 0:
            raise StudyError(f"{table.path}: {times} calls of {callee} by {caller}, which cannot be")
        if times and not is_part(callee):
            edges[source_name(caller)][source_name(callee)] += times
    return {caller: dict(callees) for caller, callees in edges.items()}


def measure(
    spec: Spec | str,
    scene_path: Path,
    height: int,
    width: int | None = None,
    *,
    variant: str = "shipped",
    threads: int = 1,
) -> Measured:
    """One picture's timed region. `variant`: "shipped", or "calls" for one without inlining.

    DriverError as study.core.run has it if the program ends badly; StudyError for counts that cannot be.
    """
    if variant not in TARGETS:
        raise StudyError(f"no variant '{variant}'; there are {', '.join(TARGETS)}")
    spec = Spec.parse(spec) if isinstance(spec, str) else spec
    target = TARGETS[variant]
    with _LOCK:  # measured by several threads, built by one
        build(spec, target)
    said = run.render(spec, scene_path, height, width, threads=threads, target=target, timed=False)
    folder = build(spec, target).parent
    table = read_table(folder / target.removeprefix("render-") / "table.json")
    total, functions, edges = evaluate(table, said)
    return Measured(
        backend=BACKEND,
        variant=variant,
        total=total,
        functions=functions,
        outside=None,
        calibrated=calibrated(),
        edges=edges,
        **backend.header(said),
    )


def calibrate(part: str, repeats: int = CALIBRATION_REPEATS) -> list[str]:
    """Differences of the known work's counts from what they must be, one line each.

    StudyError if the program cannot run, DriverError if it crashes.
    """
    program = build("calibration", "calibrate-blocks")
    said = run._parse("".join(run._lines([str(program), part, str(repeats)], None, 0)), str(program))
    total, functions, edges = evaluate(read_table(program.parent / "blocks" / "table.json"), said)
    found = calibration.differences(functions, part, repeats, edges)
    known = sum(counts.machine for counts in calibration.expected(part, repeats).values())
    if calibration.expected(part, repeats) and total.machine != known:
        found.append(f"{part}, FLOPs in total: {total.machine} instead of {known}")
    return found


@functools.cache
def _calibrated() -> bool:
    program = build("calibration", "calibrate-blocks")
    files = (program, calibration.EXPECTED)
    runnable = [part for part, lacking in calibration.parts().items() if not lacking]
    return backend.known_work(program.parent / "blocks.json", __name__, files, runnable, calibrate)


def calibrated() -> bool:
    """Whether the known work's counts were exact on this machine, in all parts that this CPU can run.

    Kept in build/calibration/blocks.json, by program and analysis.
    """
    with _LOCK:
        try:
            return _calibrated()
        except (run.DriverError, subprocess.SubprocessError):
            return False  # the program itself says that something was not kept
