"""The chapter of the hard cases."""

from __future__ import annotations

from pathlib import Path

from study.experiments.section import Section, reading
from study.experiments.stability import tables as hard_page


def hard(path: Path) -> Section:
    """The table phase × case, and each case behind its title."""
    file = path / "stability.json"
    html = ""
    with reading(file, f"scripts/stepwise stability --run {path}"):
        if file.exists():
            html = hard_page.section(hard_page.read(file), path / "figures")
    return Section("stability", "Hard cases", "make stability", [], html=html)
