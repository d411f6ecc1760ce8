"""The chapter of Dr.Jit beside our phases."""

from __future__ import annotations

from pathlib import Path

from study.experiments.drjit import measure as drjit_measure
from study.experiments.drjit import tables as drjit_page
from study.experiments.section import Section, part, reading
from study.pictures.draw import Drawing


def rival(path: Path) -> Section:
    """Our phases beside Dr.Jit on the same machine."""
    file = path / drjit_measure.FILE
    parts, answer, drawn = [], "", {}
    with reading(file, f"scripts/stepwise drjit --run {path}"):
        result = drjit_measure.read(file)
        if result["rows"]:
            caption = "Our phases and Dr.Jit on the same scenes"
            parts = part("drjit", caption, result["rows"], drjit_page.COLUMNS)
            answer = drjit_page.answer(result)
            caption = "How many times as fast as Dr.Jit each phase is, by the scene's own limits of the march"
            drawn = {"drjit": Drawing(caption, drjit_page.note(result), lambda: drjit_page.draw(result))}
    about = {"file": file, "script": "scripts/stepwise drjit", "drawn": drawn}
    return Section("drjit", "Beside Dr.Jit", "make drjit", parts, answer=answer, **about)
