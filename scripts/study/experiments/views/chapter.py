"""The chapter of further views."""

from __future__ import annotations

from pathlib import Path

from study.experiments.section import Found, Section, chapter, part
from study.experiments.views import figures as views_page
from study.experiments.views import measure as views_measure
from study.experiments.views import tables as views_tables


def elsewhere(path: Path) -> Section:
    """Each phase against its parent on further views: where constants were tuned, and everywhere else."""

    def found(result: dict) -> Found:
        parts = [one for table in views_tables.tables(result) for one in part(*table)]
        return Found(parts, views_page.answer(result), views_page.drawings(result, path))

    file = path / views_measure.FILE
    return chapter("views", "Views it was not tuned on", file, views_measure.read, found)
