"""The chapter of how cost grows."""

from __future__ import annotations

from pathlib import Path

from study.experiments.scaling import figures as scaling_page
from study.experiments.scaling import measure as scaling
from study.experiments.scaling import tables as scaling_tables
from study.experiments.section import Section, part, reading


def growth(path: Path) -> Section:
    """How cost grows: exponents beside the paper's law, the two goals, the generated scenes."""
    file = path / scaling.FILE
    parts, remarks, images = [], [], {}
    with reading(file, f"scripts/stepwise scaling --run {path}"):
        result = scaling.read(file)
        if result["rows"]:
            for name, caption, rows, columns, folded in scaling_tables.tables(result):
                parts += part(name, caption, rows, columns, folded=folded)
            remarks = [text for text in (scaling_page.without(result), scaling_page.note(result)) if text]
            captions = {
                "scaling-time": "Time of a frame against what it depends on, with fitted power laws",
                "scaling-evals": "Evaluations of a camera ray's march against the same",
                "scaling-error": "Error against the same",
                "scaling-scenes": "The generated scenes: the same share of the picture covered by any number",
            }
            images = {path / "figures" / f"{name}.png": text for name, text in captions.items()}
    return Section("scaling", "How cost grows", "make scaling", parts, remarks, images=images)
