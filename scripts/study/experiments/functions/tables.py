"""Tables of function approximations, made from functions.json alone."""

from __future__ import annotations

from typing import Any

from study.core import show
from study.core.show import Column
from study.experiments.functions import measure as functions

Row = dict[str, Any]
TITLES = {"rsqrt": "1/√x", "sqrt": "√x", "pow": "xʸ", "exp": "eˣ", "log": "ln x", "atan2": "atan2(y, x)"}
TITLES |= {name: f"{name} x" for name in ("sin", "cos", "acos")}


def judged(result: Row, function: str, precision: str, time: str = "stream_ns") -> list[Row]:
    """Entries with a time and a finite error, fastest first.

    A latency that the noise of the chain's own cost leaves at nothing is none.
    """
    rows = [
        r
        for r in result["entries"]
        if (r["function"], r["precision"]) == (function, precision)
        and r.get("max_ulp") is not None
        and time in r
        and r[time]["value"] > 0
    ]
    return sorted(rows, key=lambda r: r[time]["value"])


NEAR = 4  # ulp
FRONTS = {"stream_ns": "throughput", "latency_ns": "latency"}


def fronts(result: Row) -> list[Row]:
    """The fronts of every function and precision, and libm beside them; `fronts`: those it is on."""
    made = []
    for precision in ("float", "double"):
        for function in functions.FUNCTIONS:
            rows = {time: judged(result, function, precision, time) for time in FRONTS}
            for row in rows["stream_ns"]:
                on = [
                    word
                    for time, word in FRONTS.items()
                    if row in rows[time] and functions.on_front(row, rows[time], time)
                ]
                if on or row["family"] == "libm":
                    made.append({**row, "fronts": on})
    return made


def _figure(name: str, digits: int = 3):
    """Text of a median with its interval."""
    return show.spread_of(name, digits=digits)


def _worst(row: Row) -> str:
    values = [row.get("worst_a"), row.get("worst_b")][: row.get("arguments", 1)]
    return show.NOTHING if values[0] is None else ", ".join(f"{v:.9g}" for v in values)


def _value(name: str, digits: int = 3):
    return lambda row: show.number((row.get(name) or {}).get("value"), digits)


ENTRIES = [
    Column("", "function", lambda r: TITLES[r["function"]]),
    Column("", "precision", lambda r: r["precision"]),
    Column("", "implementation", lambda r: r["name"]),
    Column("", "ISA", lambda r: r["isa"]),
    Column("throughput", "ns per element [95 %]", _figure("stream_ns")),
    Column("throughput", "core cycles", _value("stream_cycles")),
    Column("latency", "ns per call [95 %]", _figure("latency_ns")),
    Column("latency", "core cycles", _value("latency_cycles")),
    Column("error", "largest, ulp", lambda r: show.number(r.get("max_ulp"), 4)),
    Column("error", "RMS, ulp", lambda r: show.number(r.get("rms_ulp"))),
    Column("error", "largest at", _worst),
    Column("error", "arguments tried", lambda r: f"{r['count']:,}" if r.get("count") else show.NOTHING),
]


def _on(front: str) -> Column:
    return Column(front, "front", lambda r: "✓" if front in r["fronts"] else show.NOTHING)


ON_FRONTS = [column for column in ENTRIES if column.name not in ("largest at", "arguments tried")]
ON_FRONTS.insert(4, _on("throughput"))
ON_FRONTS.insert(7, _on("latency"))
NORMALISE = [
    Column("", "vectors", lambda r: f"{r['vectors']:,}"),
    Column("", "kernel", lambda r: r["name"]),
    Column("", "layout", lambda r: r["layout"]),
    Column("", "ISA", lambda r: r["isa"]),
    Column("", "ns per vector [95 %]", _figure("ns")),
    Column("", "× scalar AoS [95 %]", _figure("speedup")),
    Column("", "GB/s in and out", lambda r: show.number(r["gb_per_s"])),
    Column("", "time of loads and stores alone", lambda r: show.percent(r["share_of_memory"])),
    Column("error", "largest, ulp", lambda r: show.number(r["max_ulp"])),
]
TABLES = [
    Column("", "instruction", lambda r: r["instruction"]),
    Column("", "CPU", lambda r: r["cpu"]),
    Column(
        "", "SHA-256 of its results for the 2²⁴ floats in [1, 4)", lambda r: r.get("sha256") or r["missing"]
    ),
    Column("", "largest relative error", lambda r: show.number(r.get("max_relative_error"), 6)),
]


def tables(result: Row) -> list[Row]:
    """The approximate reciprocal roots, each with the CPU whose they are: maker, family, model, stepping."""
    cpu = (result.get("context") or {}).get("cpu") or {}
    signature = [cpu.get(key) for key in ("vendor", "family", "model_number", "stepping")]
    about = [cpu.get("model") or "unknown CPU", cpu.get("microarchitecture")]
    if None not in signature:
        about.append("{}, family {}, model {}, stepping {}".format(*signature))
    name = "; ".join(part for part in about if part)
    return [{**row, "cpu": name} for row in result["rsqrt_tables"]]


def _span(span: Row | None) -> str:
    if not span:
        return show.NOTHING
    return f"{'±' if span['both_signs'] else ''}[{span['low']:.4g}, {span['high']:.4g}]"


def _segments(row: Row) -> str:
    """Float arguments: segments and how many of them; where there are two, the spans of the samples."""
    if not row["float_segments"]:
        return f"samples of {_span(row['float_a'])} and {_span(row['float_b'])}"
    parts = []
    for segment in row["float_segments"]:
        share = "every float" if segment["stride"] == 1 else f"1 in {segment['stride']}"
        parts.append(f"{share} of [{segment['first']:.4g}, {segment['last']:.4g}]")
    return "; ".join(parts)


def _both(name: str):
    return lambda r: _span(r[f"{name}_a"]) + (f" and {_span(r[f'{name}_b'])}" if f"{name}_b" in r else "")


TARGETS = [
    Column("", "function", lambda r: TITLES[r["function"]]),
    Column("errors", "float (a quick run: one in 12,289 of them)", _segments),
    Column("errors", "double, samples of", _both("double")),
    Column("", "timed on", _both("timed")),
]


def answer(result: Row) -> str:
    """1/√x in float: the fastest that is off by NEAR ulp at most, and libm's, each with its largest error."""
    rows = judged(result, "rsqrt", "float")
    if not rows:
        return f"{len(result['entries'])} implementations were timed." if result["entries"] else ""
    near = [row for row in rows if row["max_ulp"] <= NEAR] or rows
    libm = [row for row in rows if row["family"] == "libm"]
    said = [
        f"{row['name']} ({row['isa']}) takes {_figure('stream_ns')(row)} ns, off by at most "
        f"{show.number(row['max_ulp'], 4)} ulp"
        for row in (near[0], *libm[:1])
    ]
    return f"Of 1/√x in float, {'; '.join(dict.fromkeys(said))}."
