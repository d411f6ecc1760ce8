"""Function approximations: time against error of every implementation that runs here (common/functions).

Errors are in ulp of the exact value. Float functions of one argument: every float of the stated range against
double; floats of two arguments: stratified samples against double; doubles: stratified samples against MPFR.
Times are medians of interleaved rounds, of elements in the L1 cache: throughput of independent ones, latency
of a chain in which each waits for the last (less what the waiting itself costs: the chain of no function).
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from study.core import machine, run
from study.core.build import build
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.experiments.functions import edges as functions_edges
from study.experiments.functions.schema import Functions
from study.numbers import stats

FILE = "functions.json"
FUNCTIONS = ("sqrt", "rsqrt", "exp", "log", "pow", "sin", "cos", "atan2", "acos")
ROUNDS, QUICK_ROUNDS = 25, 7
NORMALISE_ROUNDS = 11
VECTORS, QUICK_VECTORS = 20_000_000, 16_384
TABLES = {  # instruction: instruction set, precision
    "rsqrtss": ("scalar", "float"),
    "rsqrtps": ("SSE", "float"),
    "vrsqrtps": ("AVX2", "float"),
    "vrsqrt14ps": ("AVX-512", "float"),
    "vrsqrt14pd": ("AVX-512", "double"),
}
ARTICLE = {
    "cpu": "Core 2 Duo, 1.6 GHz",
    "vectors": VECTORS,
    "scalar_ms": 3156,
    "sse_ms": 172,
    "speedup": 18.35,
    "source": 'J. Bikker, "Architecture of a Real-Time Ray-Tracer" (NHTV Breda)',
}
WITHOUT_MPFR = "MPFR's header (libmpfr-dev) is not installed: no errors of the double entries"
Row = dict[str, Any]


def program() -> Path:
    return build("functions", "bench")


def bench(*arguments: str, cpu: int | None = None, data: bytes | None = None) -> bytes:
    """Standard output of build/functions/bench, pinned to `cpu`. StudyError with what it said."""
    pin = run.cpu_set(cpu, 1)
    done = child.run(
        [program(), *arguments],
        input=data,
        capture_output=True,
        preexec_fn=(lambda: os.sched_setaffinity(0, pin)) if pin else None,
    )
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        raise StudyError(said[-1] if said else f"bench: exit status {done.returncode}", CANNOT_RUN)
    return done.stdout


def entries() -> tuple[list[Row], bool]:
    """All entries with their `missing`, and whether there is MPFR."""
    found = json.loads(bench("list"))
    return found["entries"], found["mpfr"]


def targets() -> list[Row]:
    """What each function is tried and timed on."""
    return json.loads(bench("list"))["targets"]


def evaluate(entry: Row, a: np.ndarray, b: np.ndarray | None = None) -> np.ndarray:
    """Results of one entry; `a`, `b` in its format, a multiple of 16 long."""
    kind = functions_edges.TYPES[entry["precision"]]
    data = np.ascontiguousarray(a, kind).tobytes() + (
        b"" if b is None else np.ascontiguousarray(b, kind).tobytes()
    )
    return np.frombuffer(bench("evaluate", "--id", str(entry["id"]), data=data), kind)


def _interval(values: Sequence[float]) -> Row:
    found = stats.median_interval(values)
    return {"value": found.value, "low": found.low, "high": found.high}


def add_errors(rows: list[Row], quick: bool, threads: int, seed: int) -> None:
    """count, max_ulp, rms_ulp, worst_a, worst_b, non_finite to each entry that was tried."""
    flags = ["--quick"] * quick
    found = json.loads(bench("errors", *flags, "--threads", str(threads), "--seed", str(seed)))
    for row, errors in zip(rows, found["entries"], strict=True):
        row |= {key: value for key, value in errors.items() if errors["count"]}


def add_times(rows: list[Row], rounds: int, seed: int, cpu: int | None) -> Row:
    """stream and latency (ns), stream_cycles and latency_cycles (core cycles): medians with intervals.

    Stream figures are per element, latencies per call (of a whole vector). Returns the core's clocks.
    """
    found = json.loads(bench("times", "--rounds", str(rounds), "--seed", str(seed), cpu=cpu))
    clocks = {int(k.rpartition("_")[2]): np.array(v) for k, v in found.items() if k != "entries"}
    taken = {row["id"]: found["entries"][row["id"]] for row in rows if not row["missing"]}
    link = {
        (row["isa"], row["precision"]): np.array(taken[row["id"]]["chain_ns"])
        for row in rows
        if row["function"] == "link" and row["id"] in taken
    }
    for row in rows:
        if row["id"] not in taken or row["function"] == "link":
            continue
        hz = clocks[0 if row["isa"] == "scalar" else row["bits"]]
        stream = np.array(taken[row["id"]]["stream_ns"])
        latency = np.array(taken[row["id"]]["chain_ns"]) - link[row["isa"], row["precision"]]
        for name, values in (("stream", stream), ("latency", latency)):
            row[f"{name}_ns"] = _interval(values)
            # of a width the CPU's clock was not seen under, there is none
            row[f"{name}_cycles"] = _interval(values * hz * 1e-9) if (hz > 0).all() else None
    return {f"core_hz_{bits}": _interval(values) for bits, values in clocks.items()}


def normalise(vectors: int, rounds: int, seed: int, cpu: int | None) -> list[Row]:
    """P2's benchmark: ns per vector and bandwidth per size, kernel and width, over sizes up to `vectors`."""
    flags = ["--vectors", str(vectors), "--rounds", str(rounds), "--seed", str(seed)]
    rows = json.loads(bench("normalise", *flags, cpu=cpu))["rows"]
    scalar = {r["vectors"]: r["ns"] for r in rows if (r["isa"], r["layout"]) == ("scalar", "AoS")}
    floor = {(r["vectors"], r["isa"]): r["ns"] for r in rows if r["name"] == "no arithmetic"}
    for row in rows:
        size, taken = row["vectors"], row["ns"]
        ratio = stats.ratio_interval(scalar[size], taken)
        row["speedup"] = {"value": ratio.value, "low": ratio.low, "high": ratio.high}
        bound = floor.get((size, row["isa"]))
        # 1: as fast as loading and storing alone
        row["share_of_memory"] = float(np.median(bound) / np.median(taken)) if bound else None
        row["bytes"] = 12 * size
        row["ns"] = _interval(taken)
        row["gb_per_s"] = 24 / row["ns"]["value"]  # 12 bytes in, 12 out
    return rows


def rsqrt_tables(rows: Sequence[Row]) -> list[Row]:
    """SHA-256 of each instruction's results for all 2²⁴ floats in [1, 4), little-endian, in order.

    That of doubles gets the same arguments, as doubles. Whose CPU it was is the file's `context`.
    """
    bits = np.arange(1 << 24, dtype=np.uint32) + np.uint32(0x3F800000)
    arguments = bits.view(np.float32)
    exact = 1 / np.sqrt(arguments.astype(np.float64))
    found = []
    for instruction, (isa, precision) in TABLES.items():
        name = f"{instruction.removeprefix('v')} + 0"
        wanted = (name, isa, "rsqrt", precision)
        entry = next(
            (r for r in rows if (r["name"], r["isa"], r["function"], r["precision"]) == wanted), None
        )
        row: Row = {"instruction": instruction, "isa": isa, "precision": precision}
        if entry is None or entry["missing"]:
            found.append(row | {"missing": (entry or {}).get("missing") or "no such entry"})
            continue
        values = evaluate(entry, arguments)
        error = float(np.max(np.abs(values.astype(np.float64) / exact - 1)))
        found.append(row | {"sha256": hashlib.sha256(values).hexdigest(), "max_relative_error": error})
    return found


def add_edges(rows: list[Row]) -> None:
    """`edges` to each entry that runs: argument, value, exact, right."""
    for row in rows:
        if not row["missing"] and row["function"] in FUNCTIONS:
            row["edges"] = functions_edges.judge(
                row["function"], row["precision"], lambda a, b, row=row: evaluate(row, a, b)
            )


def on_front(row: Row, rows: Sequence[Row], time: str = "stream_ns") -> bool:
    """Whether none of `rows`, all of its function and precision, is as fast and exact, and better in one."""
    mine = (row[time]["value"], row["max_ulp"])
    others = ((r[time]["value"], r["max_ulp"]) for r in rows)
    return not any(a <= mine[0] and b <= mine[1] and (a, b) != mine for a, b in others)


def mark_front(rows: Sequence[Row]) -> None:
    """`front` to each entry with a time and an error: whether it is on the front of throughput."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if row.get("max_ulp") is not None and "stream_ns" in row:
            groups.setdefault((row["function"], row["precision"]), []).append(row)
    for group in groups.values():
        for row in group:
            row["front"] = on_front(row, group)


def without(rows: Sequence[Row], mpfr: bool) -> list[str]:
    """One sentence for each thing that is not here and what it would add."""
    counts: dict[tuple[str, str], int] = {}
    for row in rows:
        if row["missing"]:
            which = row["family"] if row["missing"].startswith(("lib", "this")) else row["isa"]
            counts[which, row["missing"]] = counts.get((which, row["missing"]), 0) + 1
    said = [f"{which}: {why}; {count} entries are left out" for (which, why), count in counts.items()]
    return said + ([] if mpfr else [WITHOUT_MPFR])


def study(
    quick: bool, rounds: int, vectors: int, threads: int, seed: int, cpu: int | None, say=lambda text: None
) -> Row:
    """Everything functions.json has."""
    rows, mpfr = entries()
    lacking = without(rows, mpfr)
    for sentence in lacking:
        say(sentence)
    say("errors …")
    add_errors(rows, quick, threads, seed)
    say("edge cases and tables of rsqrt …")
    add_edges(rows)
    tables = rsqrt_tables(rows)
    say("times …")
    clocks = add_times(rows, rounds, seed, cpu)
    vectors_rows = normalise(vectors, min(rounds, NORMALISE_ROUNDS), seed, cpu)
    mark_front(rows)
    settings = {"quick": quick, "rounds": rounds, "vectors": vectors, "threads": threads, "seed": seed}
    return {
        "schema": 1,
        **settings,
        "context": machine.context(),
        "clocks": clocks,
        "targets": targets(),
        "entries": [r for r in rows if r["function"] != "link"],
        "normalise": vectors_rows,
        "article": ARTICLE,
        "rsqrt_tables": tables,
        "without": lacking,
    }


def read(folder: Path) -> Row:
    """functions.json of a folder. StudyError if it is none, or of another schema."""
    path = Path(folder) / FILE
    return Functions.read(path)


def wrong(rows: Sequence[Row]) -> list[str]:
    """What no implementation may do: give no number within its range."""
    return [
        f"{r['function']} ({r['precision']}), {r['name']}, {r['isa']}: {r['non_finite']} results not finite"
        for r in rows
        if r.get("non_finite")
    ]


def level(row: Row) -> float:
    """Largest error in ulp; infinite where a result was not finite."""
    return math.inf if row.get("max_ulp") is None else row["max_ulp"]
