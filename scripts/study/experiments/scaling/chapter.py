"""The chapter of how cost grows."""

from __future__ import annotations

from pathlib import Path

from study.experiments.scaling import figures as scaling_page
from study.experiments.scaling import measure as scaling
from study.experiments.scaling import tables as scaling_tables
from study.experiments.section import Found, Section, chapter, part


def growth(path: Path) -> Section:
    """How cost grows: exponents beside the paper's law, many shapes, memory, the generated scenes."""

    def found(result: dict) -> Found:
        feet = {"scaling-left-out": scaling_page.without(result) or ""}
        tables = scaling_tables.tables(result)
        parts = [one for table in tables for one in part(*table, feet.get(table[0], ""))]
        return Found(parts, scaling_tables.answer(result), scaling_page.drawings(result, path))

    return chapter("scaling", "How cost grows", path / scaling.FILE, scaling.read, found)
