"""The chapter of Dr.Jit beside our phases."""

from __future__ import annotations

from pathlib import Path

from study.experiments.drjit import measure as drjit_measure
from study.experiments.drjit import tables as drjit_page
from study.experiments.section import Found, Section, chapter, part
from study.pictures.draw import Drawing


def found(result: dict) -> Found:
    parts = part("drjit", "Our phases and Dr.Jit on the same scenes", result["rows"], drjit_page.COLUMNS)
    caption = "How many times as fast as Dr.Jit each phase is, by the scene's own limits of the march"
    drawn = Drawing(caption, drjit_page.note(result), lambda: drjit_page.draw(result))
    return Found(parts, drjit_page.answer(result), {"drjit": drawn})


def rival(path: Path) -> Section:
    """Our phases beside Dr.Jit on the same machine."""
    return chapter("drjit", "Beside Dr.Jit", path / drjit_measure.FILE, drjit_measure.read, found)
