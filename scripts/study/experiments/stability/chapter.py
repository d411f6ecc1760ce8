"""The chapter of the hard cases."""

from __future__ import annotations

from pathlib import Path

from study.experiments.section import Section, reading
from study.experiments.stability import figures
from study.experiments.stability import tables as hard_page
from study.pictures.draw import Drawing

NOTE = (
    "Generated scenes whose answer is known; a parameter makes each harder. Where every phase fails alike, "
    "the method fails (a march that stops at a hit distance or after so many steps), not its arithmetic."
)


def hard(path: Path) -> Section:
    """How far each phase gets in each case; the table, and each case behind its title."""
    file = path / "stability.json"
    html, answer, drawn = "", "", {}
    with reading(file, f"scripts/stepwise stability --run {path}"):
        if file.exists():
            data = hard_page.read(file)
            html, answer = hard_page.section(data), figures.answer(data)
            drawn = {"hard-cases": Drawing(figures.CAPTION, NOTE, lambda: figures.draw(data))}
    about = {"file": file, "script": "scripts/stepwise stability", "drawn": drawn}
    return Section("stability", "Hard cases", "make stability", [], answer=answer, html=html, **about)
