"""The bench of function approximations (common/functions), and the normalisation of vectors that it times."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

from study.core import run
from study.core.build import build
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.schema import Record, key
from study.numbers import stats
from study.numbers.schema import Range

VECTORS = 20_000_000


class Normalise(Record, kw_only=True):
    """One way to normalise vectors."""

    vectors: Annotated[int, key("vectors", "normalised")]
    isa: Annotated[str, key("", "instruction set")]
    bits: Annotated[int | None, key("bits", "of the register")] = None
    name: Annotated[str, key("", "of the kernel")]
    layout: Annotated[str, key("", "AoS or SoA")]
    max_ulp: Annotated[float | None, key("ulp", "largest error")] = None
    rms_ulp: Annotated[float | None, key("ulp", "root mean square error")] = None
    ns: Annotated[Range, key("ns", "per vector")]
    speedup: Annotated[Range, key("×", "over scalar triples")]
    share_of_memory: Annotated[
        float | None, key("share", "time of the same loads and stores alone over its own")
    ] = None
    bytes: Annotated[int, key("bytes", "moved")] = 0
    gb_per_s: Annotated[float | None, key("GB/s", "moved")] = None


class Article(Record, kw_only=True):
    """The article's figures beside it."""

    cpu: Annotated[str, key("", "its machine")]
    vectors: Annotated[int, key("vectors", "normalised")]
    scalar_ms: Annotated[float, key("ms", "scalar code")]
    sse_ms: Annotated[float, key("ms", "SSE code")]
    speedup: Annotated[float, key("×", "of the two")]
    source: Annotated[str | None, key("", "the article")] = None


ARTICLE = Article(
    cpu="Core 2 Duo, 1.6 GHz",
    vectors=VECTORS,
    scalar_ms=3156,
    sse_ms=172,
    speedup=18.35,
    source='J. Bikker, "Architecture of a Real-Time Ray-Tracer" (NHTV Breda)',
)


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


def median(values: Sequence[float] | np.ndarray) -> Range:
    return Range.of(stats.median_interval(values))


class SaidRow(msgspec.Struct):
    """A row as the bench prints it; ns of each round."""

    vectors: int
    isa: str
    name: str
    layout: str
    ns: list[float]
    bits: int | None = None
    max_ulp: float | None = None
    rms_ulp: float | None = None


class Said(msgspec.Struct):
    rows: list[SaidRow]


def normalise(vectors: int, rounds: int, seed: int, cpu: int | None) -> list[Normalise]:
    """P2's benchmark: ns per vector and bandwidth per size, kernel and width, over sizes up to `vectors`."""
    flags = ["--vectors", str(vectors), "--rounds", str(rounds), "--seed", str(seed)]
    rows = msgspec.json.decode(bench("normalise", *flags, cpu=cpu), type=Said).rows
    scalar = {r.vectors: r.ns for r in rows if (r.isa, r.layout) == ("scalar", "AoS")}
    floor = {(r.vectors, r.isa): r.ns for r in rows if r.name == "no arithmetic"}
    made = []
    for row in rows:
        bound = floor.get((row.vectors, row.isa))
        middle = float(np.median(row.ns))
        told = msgspec.structs.asdict(row) | {
            "ns": median(row.ns),
            "bytes": 12 * row.vectors,
            "speedup": Range.of(stats.ratio_interval(scalar[row.vectors], row.ns)),
            # 1: as fast as loading and storing alone
            "share_of_memory": float(np.median(bound) / middle) if bound else None,
            "gb_per_s": 24 / middle,  # 12 bytes in, 12 out
        }
        made.append(Normalise(**told))
    return made
