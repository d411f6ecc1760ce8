"""The chapter of the hard cases."""

from __future__ import annotations

from pathlib import Path

from study.experiments.section import Section
from study.experiments.stability import figures, tables
from study.experiments.stability.schema import FILE, Stability
from study.pictures.draw import Drawing

NOTE = (
    "Generated scenes whose answer is known; a parameter makes each harder. Where every phase fails alike, "
    "the method fails (a march that stops at a hit distance or after so many steps), not its arithmetic."
)


def hard(path: Path) -> Section:
    """How far each phase gets in each case; the table, and each case behind its title."""
    html, answer, drawn = "", "", {}
    if data := Stability.load_if_there(path / FILE):
        html, answer = tables.section(data), figures.answer(data)
        drawn = {"hard-cases": Drawing(figures.CAPTION, NOTE, lambda: figures.draw(data))}
    about = {"file": path / FILE, "script": "scripts/stepwise stability", "drawn": drawn}
    return Section("stability", "Hard cases", "make stability", [], answer=answer, html=html, **about)
