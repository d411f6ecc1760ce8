"""The chapters of a run's page and the tables beside it, in their order."""

from __future__ import annotations

from study.experiments.ablations import chapter as ablations_chapter
from study.experiments.ablations import negative
from study.experiments.accuracy import chapter as accuracy_chapter
from study.experiments.breakeven import tables as breakeven_page
from study.experiments.drjit import chapter as drjit_chapter
from study.experiments.flops import chapter as flops_chapter
from study.experiments.frames import chapter as frames_chapter
from study.experiments.functions import chapter as functions_chapter
from study.experiments.hotspots import chapter as hotspots_chapter
from study.experiments.pareto import chapter as pareto_chapter
from study.experiments.roofline import chapter as roofline_chapter
from study.experiments.scaling import chapter as scaling_chapter
from study.experiments.section import Section
from study.experiments.stability import chapter as stability_chapter
from study.experiments.sweep import rungs
from study.experiments.systems import tables as systems
from study.experiments.toolchains import chapter as toolchains_chapter
from study.experiments.views import chapter as views_chapter
from study.numbers.analysis import Data
from study.report import goals_page


def all_of(data: Data) -> list[Section]:
    """Raises StudyError for a broken file."""
    name = (data.context.get("cpu") or {}).get("microarchitecture")
    path = data.path
    return [
        pareto_chapter.headline(path),
        accuracy_chapter.errors(path),
        stability_chapter.hard(path),
        flops_chapter.counted(path),
        roofline_chapter.roofline(data),
        rungs.section(data),
        goals_page.section(data),
        hotspots_chapter.hot(path, name),
        ablations_chapter.steps(path),
        negative.section(path),
        functions_chapter.approximations(path),
        views_chapter.elsewhere(path),
        frames_chapter.rates(path),
        breakeven_page.section(path),
        drjit_chapter.rival(path),
        scaling_chapter.growth(path),
        toolchains_chapter.compilers(path),
        systems.section(path),
    ]
