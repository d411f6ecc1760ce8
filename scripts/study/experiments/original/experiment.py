"""The paper's own program beside our phases."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study
from study.experiments.original.schema import SCHEMAS


def calls(study: Study) -> list[Call]:
    return [Call("original", ["--run", str(study.run)], may_lack=True)]


EXPERIMENT = Experiment(
    name="original",
    what="the paper's own program",
    turn=160,
    schemas=SCHEMAS,
    calls=calls,
    depth=None,
    sections=[],
)
