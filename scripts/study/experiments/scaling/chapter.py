"""The chapter of how cost grows."""

from __future__ import annotations

from pathlib import Path

from study.experiments.scaling import figures as scaling_page
from study.experiments.scaling import measure as scaling
from study.experiments.scaling import tables as scaling_tables
from study.experiments.section import Section, part, reading


def growth(path: Path) -> Section:
    """How cost grows: exponents beside the paper's law, many shapes, memory, the generated scenes."""
    file = path / scaling.FILE
    parts, answer, drawn = [], "", {}
    with reading(file, f"scripts/stepwise scaling --run {path}"):
        result = scaling.read(file)
        if result["rows"]:
            for name, caption, rows, columns in scaling_tables.tables(result):
                foot = scaling_page.without(result) or "" if name == "scaling-left-out" else ""
                parts += part(name, caption, rows, columns, foot)
            answer, drawn = scaling_tables.answer(result), scaling_page.drawings(result, path)
    about = {"file": file, "script": "scripts/stepwise scaling", "drawn": drawn}
    return Section("scaling", "How cost grows", "make scaling", parts, answer=answer, **about)
