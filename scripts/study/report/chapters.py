"""The chapters of a run's page and the tables beside it, in their order."""

from __future__ import annotations

from study.experiments.ablations import negative
from study.experiments.breakeven import tables as breakeven_page
from study.experiments.sweep import rungs
from study.experiments.systems import tables as systems
from study.numbers.analysis import Data
from study.report import goals_page, sections, truth_sections
from study.report.sections import Section


def all_of(data: Data) -> list[Section]:
    """Raises StudyError for a broken file."""
    name = (data.context.get("cpu") or {}).get("microarchitecture")
    path = data.path
    return [
        truth_sections.headline(path),
        truth_sections.errors(path),
        truth_sections.hard(path),
        sections.counted(path),
        sections.roofline(data),
        rungs.section(data),
        goals_page.section(data),
        sections.hot(path, name),
        sections.steps(path),
        negative.section(path),
        truth_sections.approximations(path),
        truth_sections.elsewhere(path),
        truth_sections.rates(path),
        breakeven_page.section(path),
        truth_sections.rival(path),
        truth_sections.growth(path),
        truth_sections.compilers(path),
        systems.section(path),
    ]
