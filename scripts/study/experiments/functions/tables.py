"""Tables of function approximations, made from functions.json alone."""

import math
from collections.abc import Callable, Sequence

from study.core import show
from study.core.show import Column
from study.experiments.functions import measure
from study.experiments.functions.schema import Entry, Functions

TITLES = {"rsqrt": "1/√x", "sqrt": "√x", "pow": "xʸ", "exp": "eˣ", "log": "ln x", "atan2": "atan2(y, x)"}
TITLES |= {name: f"{name} x" for name in ("sin", "cos", "acos")}
NEAR = 4  # ulp
FRONTS = {"stream_ns": "throughput", "latency_ns": "latency"}


def judged(rows: Sequence[Entry], kind: tuple[str, str], time: str = "stream_ns") -> list[Entry]:
    """Entries of a function and precision with a time and a finite error, fastest first."""
    able = [r for r in rows if r.kind == kind and r.max_ulp is not None and not math.isnan(r.ns(time))]
    return sorted(able, key=lambda r: r.ns(time))


class OnFront(Entry, kw_only=True):
    """An entry with the fronts that it is on."""

    fronts: list[str]


def fronts(result: Functions) -> list[OnFront]:
    """The fronts of every function and precision, and libm beside them."""
    made = []
    for precision in ("float", "double"):
        for function in measure.FUNCTIONS:
            rows = {time: judged(result.entries, (function, precision), time) for time in FRONTS}
            for row in next(iter(rows.values())):
                on = [
                    word
                    for time, word in FRONTS.items()
                    if row in rows[time] and measure.on_front(row, rows[time], time)
                ]
                if on or row.family == "libm":
                    made.append(OnFront(**show.cells(row), fronts=on))
    return made


def _worst(row: Entry) -> str:
    values = [row.worst_a, row.worst_b][: row.arguments]
    return show.NOTHING if values[0] is None else ", ".join(f"{v or 0:.9g}" for v in values)


def _value(name: str) -> Callable[[Entry], str]:
    return lambda row: show.number(getattr(getattr(row, name), "value", None))


ENTRIES = [
    Column("", "function", lambda r: TITLES[r.function]),
    Column("", "precision", lambda r: r.precision),
    Column("", "implementation", lambda r: r.name),
    Column("", "ISA", lambda r: r.isa),
    Column("throughput", "ns per element [95 %]", show.spread_of("stream_ns")),
    Column("throughput", "core cycles", _value("stream_cycles")),
    Column("latency", "ns per call [95 %]", show.spread_of("latency_ns")),
    Column("latency", "core cycles", _value("latency_cycles")),
    Column("error", "largest, ulp", show.plain("max_ulp", 4)),
    Column("error", "RMS, ulp", show.plain("rms_ulp")),
    Column("error", "largest at", _worst),
    Column("error", "arguments tried", lambda r: f"{r.count:,}" if r.count else show.NOTHING),
]


def _on(front: str) -> Column:
    return Column(front, "front", lambda r: "✓" if front in r.fronts else show.NOTHING)


ON_FRONTS = [c for c in ENTRIES if c.name not in ("largest at", "arguments tried")]
ON_FRONTS.insert(4, _on("throughput"))
ON_FRONTS.insert(7, _on("latency"))
NORMALISE = [
    Column("", "vectors", lambda r: f"{r.vectors:,}"),
    Column("", "kernel", lambda r: r.name),
    Column("", "layout", lambda r: r.layout),
    Column("", "ISA", lambda r: r.isa),
    Column("", "ns per vector [95 %]", show.spread_of("ns")),
    Column("", "× scalar AoS [95 %]", show.spread_of("speedup")),
    Column("", "GB/s in and out", show.plain("gb_per_s")),
    Column("", "time of loads and stores alone", lambda r: show.percent(r.share_of_memory)),
    Column("error", "largest, ulp", show.plain("max_ulp")),
]


def answer(result: Functions) -> str:
    """1/√x in float: the fastest that is off by NEAR ulp at most, and libm's, each with its largest error."""
    rows = judged(result.entries, ("rsqrt", "float"))
    if not rows:
        return f"{len(result.entries)} implementations were timed."
    near = [row for row in rows if row.ulp <= NEAR] or rows
    libm = [row for row in rows if row.family == "libm"]
    said = [
        f"{row.name} ({row.isa}) takes {show.spread(row.stream_ns)} ns, off by at most "
        f"{show.number(row.ulp, 4)} ulp"
        for row in (near[0], *libm[:1])
    ]
    return f"Of 1/√x in float, {'; '.join(dict.fromkeys(said))}."
