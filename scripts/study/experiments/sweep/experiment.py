"""Times of every phase: what a run begins with."""

from study.core.run_schema import SCHEMAS
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.sweep import chapter, command, work


def calls(study: Study) -> list[Call]:
    return []  # the run is its own: stepwise study makes it first


EXPERIMENT = Experiment(
    name="sweep",
    command=command,
    what="times of every phase",
    turn=0,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="Six launches instead of ten, and pictures as large as 75 seconds allow.",
    sections=[(110, chapter.speeds), (130, chapter.sizes), (240, work.section)],
)
