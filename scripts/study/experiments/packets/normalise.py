"""The article's own benchmark, normalising vectors: by the program of stepwise functions."""

from __future__ import annotations

from study.core import run, show
from study.experiments.packets.schema import Article, Normalise, Packets
from study.experiments.section import Claim
from study.measuring import function_bench, hit_tables

ARTICLE = Article(scalar_ms=3156, sse_ms=172, speed_up=18.35, cpu="Core 2 Duo, 1.6 GHz")
VECTORS = function_bench.VECTORS  # the article's
ROUNDS = 6  # the fewest that have an interval
SCALAR, SSE = ("scalar", "AoS", "1/sqrt"), ("SSE", "SoA", "rsqrtps + 1")  # one Newton step


def measured(vectors: int, seed: int) -> list[Normalise]:
    """ms to normalise so many vectors of three floats, error in ulp, and how many times as fast as scalar
    code that is. Raises StudyError."""
    rows = function_bench.normalise(vectors, ROUNDS, seed, run.FASTEST)
    largest = max(row.vectors for row in rows)
    return [_of(row) for row in rows if row.vectors == largest]


def _of(row: function_bench.Normalise) -> Normalise:
    """A row of the function study, its ns a vector as ms of all."""
    about = {key: getattr(row, key) for key in ("vectors", "isa", "layout", "name", "max_ulp")}
    for end, key in (("", "value"), ("_low", "low"), ("_high", "high")):
        ns = getattr(row.ns, key)
        about[f"ms{end}"] = ns and ns * row.vectors * 1e-6
        about[f"gain{end}"] = getattr(row.speedup, key)
    return Normalise(**about)


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
