"""Every phase on views that nothing was tuned on."""

from __future__ import annotations

from study.experiments import cuts
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.section import Section, chapter
from study.experiments.views import command, tables
from study.experiments.views.schema import SCHEMAS, Views
from study.numbers.analysis import Data


def calls(study: Study) -> list[Call]:
    few = ["--scene", "scene0", "--phase", *cuts.three()] if study.quick else []
    return [Call("views", [*few, *(["--full"] if study.whole else []), "--run", str(study.run)])]


def section(data: Data) -> Section:
    """Each phase against its parent on further views: where constants were tuned, and everywhere else."""
    file = data.path / command.FILE
    return chapter("views", "Views it was not tuned on", file, Views.load_if_there, tables.found)


EXPERIMENT = Experiment(
    name="views",
    what="views that nothing was tuned on",
    turn=100,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="Views of scene0 alone, three phases.",
    sections=[(430, section)],
    command=command,
)
