"""Times of every phase: what a run begins with."""

from study.core.run_schema import SCHEMAS
from study.experiments.experiment import Experiment
from study.experiments.sweep import chapter, command

EXPERIMENT = Experiment(
    name="sweep",
    command=command,
    what="times of every phase",
    turn=0,
    schemas=SCHEMAS,
    calls=lambda study: [],  # the run is its own: stepwise study makes it first
    depth="quick",
    cut="Six launches instead of ten, three of frames over a second; height 360, less on a slow machine.",
    sections=[(110, chapter.speeds), (130, chapter.sizes), (240, chapter.worked)],
)
