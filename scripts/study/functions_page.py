"""Tables of function approximations, made from functions.json alone."""

from __future__ import annotations

from typing import Any

from study import functions, show
from study.show import Column

Row = dict[str, Any]
TITLES = {"rsqrt": "1/√x", "sqrt": "√x", "pow": "xʸ", "exp": "eˣ", "log": "ln x", "atan2": "atan2(y, x)"}
TITLES |= {name: f"{name} x" for name in ("sin", "cos", "acos")}


def judged(result: Row, function: str, precision: str) -> list[Row]:
    """Entries with a time and a finite error, fastest first."""
    rows = [
        r
        for r in result["entries"]
        if (r["function"], r["precision"]) == (function, precision)
        and r.get("max_ulp") is not None
        and "stream_ns" in r
    ]
    return sorted(rows, key=lambda r: r["stream_ns"]["value"])


def fronts(result: Row) -> list[Row]:
    """The front of every function and precision, and libm beside it."""
    return [
        row
        for precision in ("float", "double")
        for function in functions.FUNCTIONS
        for row in judged(result, function, precision)
        if row["front"] or row["family"] == "libm"
    ]


def _figure(name: str, digits: int = 3):
    """Text of a median with its interval."""

    def text(row: Row) -> str:
        found = row.get(name)
        if not found:
            return show.NOTHING
        return show.interval(
            {"v": found["value"], "v_low": found["low"], "v_high": found["high"]}, "v", digits
        )

    return text


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
    Column("", "SHA-256 of its 2²⁴ results in [1, 4)", lambda r: r.get("sha256") or r["missing"]),
    Column("", "largest relative error", lambda r: show.number(r.get("max_relative_error"), 6)),
]


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


def edges(result: Row, function: str, precision: str) -> show.Table:
    """A row per implementation whose values agree (its instruction sets named), a column per edge argument.

    ✓ where the value is what C asks, else the value and what it should be.
    """
    groups: dict[tuple, list[Row]] = {}
    for row in result["entries"]:
        if (row["function"], row["precision"]) == (function, precision) and row.get("edges"):
            key = (row["name"], tuple((e["value"], e["right"]) for e in row["edges"]))
            groups.setdefault(key, []).append(row)
    rows = [
        {"name": name, "isa": ", ".join(r["isa"] for r in same), "edges": same[0]["edges"]}
        for (name, _), same in groups.items()
    ]
    columns = [Column("", "implementation", lambda r: r["name"]), Column("", "ISA", lambda r: r["isa"])]
    for i, case in enumerate(rows[0]["edges"] if rows else []):
        columns.append(
            Column(
                "f of",
                case["argument"],
                lambda r, i=i: _edge(r["edges"][i]),
                lambda r, i=i: "" if r["edges"][i]["right"] else "bad",
            )
        )
    return show.table(rows, columns)


def _edge(edge: Row) -> str:
    return f"✓ {edge['value']}" if edge["right"] else f"{edge['value']}, not {edge['exact']}"
