"""Frames a second."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study
from study.experiments.frames import chapter, goals
from study.experiments.frames.schema import SCHEMAS

SECONDS, WHOLE_SECONDS = "45", "600"


def calls(study: Study) -> list[Call]:
    """The newest phases; all with threads where it was asked for."""
    seconds = WHOLE_SECONDS if study.whole else SECONDS
    return [Call("frames", ["--budget", seconds, "--run", str(study.run)])]


EXPERIMENT = Experiment(
    name="frames",
    what="frames a second",
    turn=110,
    schemas=SCHEMAS,
    calls=calls,
    depth="standard",
    sections=[(140, lambda data: chapter.rates(data.path))],
    goals=goals.reached,
)
