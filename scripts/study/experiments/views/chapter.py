"""The chapter of further views."""

from __future__ import annotations

from pathlib import Path

from study.experiments.section import Section, part, reading
from study.experiments.views import figures as views_page
from study.experiments.views import measure as views_measure
from study.experiments.views import tables as views_tables


def elsewhere(path: Path) -> Section:
    """Each phase against its parent on further views: where constants were tuned, and everywhere else."""
    file = path / views_measure.FILE
    parts, answer, drawn = [], "", {}
    with reading(file, f"scripts/stepwise views --run {path}"):
        result = views_measure.read(file)
        if result["rows"]:
            for name, caption, rows, columns in views_tables.tables(result):
                parts += part(name, caption, rows, columns)
            answer = views_page.answer(result)
            drawn = views_page.drawings(result, path)
    about = {"file": file, "script": "scripts/stepwise views", "drawn": drawn}
    return Section("views", "Views it was not tuned on", "make views", parts, answer=answer, **about)
