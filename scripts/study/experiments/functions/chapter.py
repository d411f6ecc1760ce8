"""The chapter of function approximations."""

from __future__ import annotations

from pathlib import Path

from study.experiments.functions import edge_tables, figures, tables
from study.experiments.functions.schema import FILE, Functions
from study.experiments.section import Section, part


def approximations(path: Path) -> Section:
    """Functions: ns against ulp, the normalisation of 20 million vectors, the reciprocal root's tables."""
    about: dict = {}
    parts = []
    if result := Functions.load_if_there(path / FILE):
        caption = "The fronts of each function: nothing is nearer and faster, by throughput or by latency"
        parts = part("functions", caption, tables.fronts(result), tables.ON_FRONTS, figures.note(result))
        for name, of in edge_tables.TABLES.items():
            rows = edge_tables.rows(result, of)
            caption, foot = edge_tables.caption(result, of), edge_tables.remark(result)
            parts += part(name, caption, rows, edge_tables.columns(rows), foot)
        foot = figures.normalise_note(result) if result.normalise else ""
        parts += part("normalise", "Vectors normalised", result.normalise, tables.NORMALISE, foot)
        caption = "Approximate reciprocal roots, by CPU: IEEE does not say what they are"
        parts += part("rsqrt", caption, result.rsqrt_tables, tables.rsqrt_tables(result))
        caption = "What each function is tried and timed on"
        parts += part("functions-targets", caption, result.targets, tables.TARGETS)
        parts += part("functions-all", "Every implementation", result.entries, tables.ENTRIES)
        about = {"answer": tables.answer(result), "drawn": figures.drawings(result)}
    about |= {"file": path / FILE, "script": "scripts/stepwise functions"}
    return Section("functions", "Functions: speed against ulp", "make functions", parts, **about)
