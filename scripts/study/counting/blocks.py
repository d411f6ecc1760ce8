"""Assembly block counters: what the timed region executed, counted exactly by the program itself.

build/SPEC/render-blocks is the shipped code with a counter in every basic block (counting.assembly), and
render-blocks-calls the same source with its functions kept. What a block does is decoded from its bytes once;
times its count it is what was executed. Masked instructions add up their active lanes, repeated ones their
iterations. All instruction sets, any number of threads. libm and libc are not seen inside; direct calls of
them are (`edges`). Counters have 64 bits.
"""

import dataclasses
import functools
import subprocess
from collections import Counter, defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import msgspec

from study.core import run
from study.core.build import build
from study.core.cli import StudyError
from study.core.registry import Scene, Spec
from study.counting import assembly, backend, calibration
from study.counting.counts import Counts
from study.counting.decode import Decoded, decode
from study.counting.elf import is_part, source_name
from study.counting.schema import Measurement

BACKEND = "blocks"
TARGETS = {"shipped": "render-blocks", "calls": "render-blocks-calls"}
CALIBRATION_REPEATS = 7


class Ran(msgspec.Struct):
    """What a program with counters printed of them."""

    counts: Literal["basic blocks"]
    table: str
    blocks: list[int]
    masked: list[int]
    repeated: list[int]


@dataclasses.dataclass(frozen=True)
class Table:
    """A program's table; `masked`, `repeated`: block and place → counter. `code`: of the blocks that ran."""

    path: Path
    raw: assembly.Table
    code: dict[int, list[Decoded]]
    masked: dict[tuple[int, int], int]
    repeated: dict[tuple[int, int], int]

    def decoded(self, number: int) -> list[Decoded]:
        if number not in self.code:
            block = self.raw.blocks[number]
            self.code[number] = decode(bytes.fromhex(block.bytes), block.offset)
        return self.code[number]


@functools.lru_cache(maxsize=4)
def read_table(path: Path) -> Table:
    """Read once: many scenes are counted by one program."""
    raw = msgspec.json.decode(path.read_bytes(), type=assembly.Table)
    masked, repeated = ({key: n for n, key in enumerate(keys)} for keys in (raw.masked, raw.repeated))
    return Table(path, raw, {}, masked, repeated)


def evaluate(
    table: Table, printed: Mapping[str, Any]
) -> tuple[Counts, dict[str, Counts], dict[str, dict[str, int]]]:
    """Total, functions by source name and edges, from what a program with counters printed. StudyError for
    counts that cannot be."""
    try:
        ran = msgspec.convert(printed, Ran)
    except msgspec.ValidationError as error:
        raise StudyError(f"{table.path}: not the counts of a program with counters: {error}") from None
    if ran.table != table.raw.hash:
        raise StudyError(f"{table.path}: not the table of the program that ran; build it again")
    functions: defaultdict[str, Counts] = defaultdict(Counts)
    for number, (block, times) in enumerate(zip(table.raw.blocks, ran.blocks, strict=True)):
        if not times:
            continue
        counts = functions[source_name(block.function)]
        if block.entry and not is_part(block.function):
            counts.calls += times
        for place, one in enumerate(table.decoded(number)):
            if (number, place) in table.repeated:
                rounds = ran.repeated[table.repeated[number, place]]
                counts.load += one.load * rounds
                counts.store += one.store * rounds
                one = dataclasses.replace(one, load=0, store=0)
            lanes = table.masked.get((number, place))
            counts.add(one, times, None if lanes is None else ran.masked[lanes])
    return Counts.total(functions.values()), dict(functions), _edges(table.raw, ran.blocks)


def _edges(table: assembly.Table, ran: list[int]) -> dict[str, dict[str, int]]:
    edges: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for number, callee, otherwise in table.calls:
        times = ran[number] - (0 if otherwise is None else ran[otherwise])
        if times and not is_part(callee):
            edges[source_name(table.blocks[number].function)][source_name(callee)] += times
    return {caller: dict(callees) for caller, callees in edges.items()}


def measure(
    spec: Spec,
    scene: Scene,
    height: int,
    variant: str = "shipped",
    *,
    width: int | None = None,
    threads: int = 1,
) -> Measurement:
    """One picture's timed region. `variant`: "shipped", or "calls" for one without inlining.

    DriverError as study.core.run has it if the program ends badly; StudyError for counts that cannot be.
    """
    target = TARGETS[variant]
    folder = build(spec, target).parent
    wide, high = scene.size(height, width)
    printed = run.render(spec, scene.path, high, wide, threads=threads, target=target, timed=False)
    table = read_table(folder / target.removeprefix("render-") / "table.json")
    total, functions, edges = evaluate(table, printed)
    return backend.measurement(
        BACKEND, variant, printed, total, functions, edges=edges, calibrated=calibrated()
    )


def calibrate(part: str, repeats: int = CALIBRATION_REPEATS) -> list[str]:
    """Differences of the known work's counts from what they must be, one line each. DriverError if the
    program says that something was not kept."""
    program = build("calibration", "calibrate-blocks")
    printed = run._parse("".join(run._lines([str(program), part, str(repeats)], None, 0)), str(program))
    total, functions, edges = evaluate(read_table(program.parent / "blocks" / "table.json"), printed)
    found = calibration.differences(functions, part, repeats, edges)
    known = Counts.total(calibration.expected(part, repeats).values()).machine
    return (
        [*found, f"{part}, FLOPs: {total.machine}, not {known}"] if known not in (0, total.machine) else found
    )


@functools.cache
def calibrated() -> bool:
    """Whether the known work's counts were exact on this machine, in all parts that this CPU can run."""
    program = build("calibration", "calibrate-blocks")
    files = (program, calibration.EXPECTED)
    try:
        return backend.known_work(program.parent / "blocks.known", files, calibration.runnable(), calibrate)
    except (run.DriverError, subprocess.SubprocessError):
        return False  # the program itself says that something was not kept
