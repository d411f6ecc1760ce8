"""Function approximations: time against error of every implementation that runs here (common/functions).

Errors are in ulp of the exact value. Float functions of one argument: every float of the stated range against
double; floats of two arguments: stratified samples against double; doubles: stratified samples against MPFR.
Times are medians of interleaved rounds, of elements in the L1 cache: throughput of independent ones, latency
of a chain in which each waits for the last (less what the waiting itself costs: the chain of no function).
"""

import json
from collections import Counter
from collections.abc import Sequence

import msgspec
import numpy as np

from study.core import cli, machine
from study.experiments.functions import edges
from study.experiments.functions.schema import Entry, Functions
from study.measuring.function_bench import ARTICLE, bench, median, normalise
from study.numbers.schema import Range

FUNCTIONS = ("sqrt", "rsqrt", "exp", "log", "pow", "sin", "cos", "atan2", "acos")
ROUNDS, QUICK_ROUNDS = 25, 7
NORMALISE_ROUNDS = 11
QUICK_VECTORS = 16_384
WITHOUT_MPFR = "MPFR's header (libmpfr-dev) is not installed: no errors of the double entries"


class Listed(msgspec.Struct):
    """What the bench says of its entries."""

    mpfr: bool
    entries: list[Entry]


class Ran(msgspec.Struct):
    """An entry's times by round."""

    stream_ns: list[float] = []
    chain_ns: list[float] = []


def entries() -> tuple[list[Entry], bool]:
    found = msgspec.json.decode(bench("list"), type=Listed)
    return found.entries, found.mpfr


def evaluate(entry: Entry, a: np.ndarray, b: np.ndarray | None = None) -> np.ndarray:
    """Results of one entry; `a`, `b` in its format, a multiple of 16 long."""
    kind = edges.TYPES[entry.precision]
    data = b"".join(np.ascontiguousarray(x, kind).tobytes() for x in (a, b) if x is not None)
    return np.frombuffer(bench("evaluate", "--id", str(entry.id), data=data), kind)


def add_errors(rows: Sequence[Entry], quick: bool, threads: int, seed: int) -> None:
    """count, max_ulp, rms_ulp, worst_a, worst_b, non_finite to each entry that was tried."""
    flags = ("--quick",) * quick
    found = json.loads(bench("errors", *flags, "--threads", str(threads), "--seed", str(seed)))
    for row, errors in zip(rows, found.pop("entries"), strict=True):
        for name, value in errors.items() if errors.get("count") else ():
            setattr(row, name, value)


def add_times(rows: Sequence[Entry], rounds: int, seed: int, cpu: int | None) -> dict[str, Range]:
    """Stream and latency (ns and core cycles): medians with intervals. Returns the core's clocks.

    Stream figures are per element, latencies per call (of a whole vector).
    """
    found = json.loads(bench("times", "--rounds", str(rounds), "--seed", str(seed), cpu=cpu))
    ran = msgspec.convert(found.pop("entries"), list[Ran])
    clocks = {int(k.rpartition("_")[2]): np.array(v) for k, v in found.items()}
    taken = {row.id: ran[row.id] for row in rows if not row.missing}
    chains = {row.id: np.array(one.chain_ns) for row in rows if (one := taken.get(row.id))}
    links = [row for row in rows if row.function == "link" and row.id in chains]
    link = {(row.isa, row.precision): chains[row.id] for row in links}
    for row in rows:
        if row.id not in taken or row.function == "link":
            continue
        hz = clocks[0 if row.isa == "scalar" else row.bits]
        seen = bool((hz > 0).all())  # of a width the CPU's clock was not seen under, there are no cycles
        stream = np.array(taken[row.id].stream_ns)
        latency = chains[row.id] - link[row.isa, row.precision]
        row.stream_ns, row.latency_ns = median(stream), median(latency)
        row.stream_cycles = median(stream * hz * 1e-9) if seen else None
        row.latency_cycles = median(latency * hz * 1e-9) if seen else None
    return {f"core_hz_{bits}": median(values) for bits, values in clocks.items()}


def add_edges(rows: Sequence[Entry]) -> None:
    for row in rows:
        if not row.missing and row.function in FUNCTIONS:
            row.edges = edges.judge(*row.kind, lambda a, b, row=row: evaluate(row, a, b))


def on_front(row: Entry, rows: Sequence[Entry], time: str = "stream_ns") -> bool:
    """Whether none of `rows`, all of its function and precision, is as fast and exact, and better in one."""
    mine = (row.ns(time), row.ulp)
    others = ((r.ns(time), r.ulp) for r in rows)
    return not any(a <= mine[0] and b <= mine[1] and (a, b) != mine for a, b in others)


def mark_front(rows: Sequence[Entry]) -> None:
    """`front` to each entry with a time and an error: whether it is on the front of throughput."""
    able = [row for row in rows if row.max_ulp is not None and row.stream_ns]
    for row in able:
        row.front = on_front(row, [one for one in able if one.kind == row.kind])


def without(rows: Sequence[Entry], mpfr: bool) -> list[str]:
    """One sentence for each thing that is not here and what it would add."""
    lacking = [row for row in rows if row.missing]
    counts = Counter(
        (row.family if str(row.missing).startswith(("lib", "this")) else row.isa, row.missing)
        for row in lacking
    )
    said = [f"{which}: {why}; {count} entries are left out" for (which, why), count in counts.items()]
    return said + ([] if mpfr else [WITHOUT_MPFR])


def study(quick: bool, rounds: int, vectors: int, threads: int, seed: int, cpu: int | None) -> Functions:
    rows, mpfr = entries()
    lacking = without(rows, mpfr)
    if lacking:
        cli.say("\n".join(lacking))
    cli.doing("errors …")
    add_errors(rows, quick, threads, seed)
    cli.doing("edge cases …")
    add_edges(rows)
    cli.doing("times …")
    clocks = add_times(rows, rounds, seed, cpu)
    normalised = normalise(vectors, min(rounds, NORMALISE_ROUNDS), seed, cpu)
    mark_front(rows)
    settings = {"quick": quick, "rounds": rounds, "vectors": vectors, "threads": threads, "seed": seed}
    kept = [row for row in rows if row.function != "link"]
    found = {"clocks": clocks, "entries": kept, "normalise": normalised}
    about = {"context": machine.context(), "article": ARTICLE}
    return Functions(schema=1, **settings, **about, **found, without=lacking)


def wrong(rows: Sequence[Entry]) -> list[str]:
    """What no implementation may do: give no number within its range."""
    return [
        f"{r.function} ({r.precision}), {r.name}, {r.isa}: {r.non_finite} results not finite"
        for r in rows
        if r.non_finite
    ]
