"""The chapter of function approximations."""

from __future__ import annotations

from pathlib import Path

from study.experiments.functions import edge_tables as functions_edges_page
from study.experiments.functions import figures as functions_figures
from study.experiments.functions import measure as functions
from study.experiments.functions import tables as functions_page
from study.experiments.section import Found, Section, chapter, part


def _found(result: dict) -> Found:
    caption = "The fronts of each function: nothing is nearer and faster, by throughput or by latency"
    fronts = functions_page.fronts(result)
    parts = part("functions", caption, fronts, functions_page.ON_FRONTS, functions_figures.note(result))
    edges = functions_edges_page.remark(result) or ""
    for name, of in functions_edges_page.TABLES.items():
        rows = functions_edges_page.rows(result, of)
        caption = functions_edges_page.caption(result, of)
        parts += part(name, caption, rows, functions_edges_page.columns(rows), edges)
    vectors = result["normalise"]
    foot = functions_figures.normalise_note(result) if vectors else ""
    parts += part("normalise", "Vectors normalised", vectors, functions_page.NORMALISE, foot)
    caption = "Approximate reciprocal roots, by CPU: IEEE does not say what they are"
    parts += part("rsqrt", caption, functions_page.tables(result), functions_page.TABLES)
    caption = "What each function is tried and timed on"
    parts += part("functions-targets", caption, result["targets"], functions_page.TARGETS)
    parts += part("functions-all", "Every implementation", result["entries"], functions_page.ENTRIES)
    return Found(parts, functions_page.answer(result), functions_figures.drawings(result))


def _read(file: Path) -> dict:
    return functions.read(file.parent) if file.exists() else {}


def approximations(path: Path) -> Section:
    """Functions: ns against ulp, the normalisation of 20 million vectors, the reciprocal root's tables."""
    title, file = "Functions: speed against ulp", path / functions.FILE
    return chapter("functions", title, file, _read, _found, rows="entries")
