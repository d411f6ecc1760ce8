"""The article's own benchmark, normalising vectors: by the program of stepwise functions."""

from __future__ import annotations

import msgspec
from msgspec.structs import asdict

from study.core import run, show
from study.experiments.packets.schema import Article, Normalise, Packets
from study.experiments.section import Claim
from study.measuring import function_bench, hit_tables, launches

ARTICLE = Article(scalar_ms=3156, sse_ms=172, speed_up=18.35, cpu="Core 2 Duo, 1.6 GHz")
VECTORS = function_bench.VECTORS  # the article's
ROUNDS = 6  # the fewest that have an interval
SCALAR, SSE = ("scalar", "AoS", "1/sqrt"), ("SSE", "SoA", "rsqrtps + 1")  # one Newton step


class Kernel(msgspec.Struct):
    """What the program says of one, in ns a vector."""

    vectors: int
    isa: str
    layout: str
    name: str
    ns: list[float]
    max_ulp: float | None = None


def measured(vectors: int, seed: int) -> list[Normalise]:
    """ms to normalise so many vectors of three floats, error in ulp, and how many times as fast as scalar
    code that is. Raises StudyError."""
    words = ["normalise", "--vectors", vectors, "--rounds", ROUNDS, "--seed", seed]
    said = function_bench.bench(*map(str, words), cpu=run.FASTEST)
    rows = msgspec.json.decode(said, type=dict[str, list[Kernel]])["rows"]
    largest = [row for row in rows if row.vectors == max(one.vectors for one in rows)]
    scalar = next(row.ns for row in largest if (row.isa, row.layout) == SCALAR[:2])
    found = []
    for row in largest:
        timed = launches.timed([ns * row.vectors * 1e-6 for ns in row.ns])
        about = {key: getattr(row, key) for key in ("vectors", "isa", "layout", "name", "max_ulp")}
        ms = {key: getattr(timed, key) for key in ("ms", "ms_low", "ms_high")}
        found.append(Normalise(**about, **ms, **asdict(launches.gain(scalar, row.ns))))
    return found


def claims(result: Packets) -> list[Claim]:
    """Scalar code, SSE by the approximate root and one Newton step, and the one over the other."""
    rows = {(row.isa, row.layout, row.name): row for row in result.normalise if row.vectors == VECTORS}
    if SCALAR not in rows or SSE not in rows:
        return []
    said, made = result.article, []
    for kernel, theirs in ((SCALAR, said.scalar_ms), (SSE, said.sse_ms)):
        row = rows[kernel]
        times, error = theirs / row.ms, f"≤ {show.number(row.max_ulp, 2)} ulp"
        what = f"normalising {VECTORS:,} vectors, {row.isa}, ms"
        ours, ratio = hit_tables.ms(row), f"{show.number(times)}×"
        made.append(Claim("packet rays (P2)", what, f"{theirs:g}", ours, ratio, error, times))
    ratio = f"{show.number((row.gain or 0) / said.speed_up)}×"
    ours = hit_tables.gain(row)
    made.append(
        Claim("packet rays (P2)", "normalising, SSE over scalar", f"{said.speed_up}×", ours, ratio, error)
    )
    return made
