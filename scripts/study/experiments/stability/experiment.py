"""Hard cases with a known answer."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study
from study.experiments.stability import chapter
from study.experiments.stability.schema import SCHEMAS


def calls(study: Study) -> list[Call]:
    return [Call("stability", ["--run", str(study.run)])]


EXPERIMENT = Experiment(
    name="stability",
    what="hard cases",
    turn=70,
    schemas=SCHEMAS,
    calls=calls,
    depth="standard",
    sections=[(530, lambda data: chapter.hard(data.path))],
)
