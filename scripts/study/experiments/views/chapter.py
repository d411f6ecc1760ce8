"""The chapter of further views."""

from __future__ import annotations

from pathlib import Path

from study.experiments.section import Section, part, reading
from study.experiments.views import figures as views_page
from study.experiments.views import measure as views_measure
from study.experiments.views import tables as views_tables


def elsewhere(path: Path) -> Section:
    """Each rung against its parent on further views: where constants were tuned, and everywhere else."""
    file = path / views_measure.FILE
    parts, remarks, images = [], [], {}
    with reading(file, f"scripts/stepwise views --run {path}"):
        result = views_measure.read(file)
        if result["rows"]:
            for name, caption, rows, columns, folded in views_tables.tables(result):
                parts += part(name, caption, rows, columns, folded=folded)
            remarks = [views_page.note(result)]
            captions = {
                views_page.RATIOS: "Gain of each rung over its parent on every view",
                views_page.SHEET: "The views: each scene's own and three further ones",
            }
            images = {path / "figures" / f"{name}.png": text for name, text in captions.items()}
    return Section("views", "Views it was not tuned on", "make views", parts, remarks, images=images)
