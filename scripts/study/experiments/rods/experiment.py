"""Rod marching against per-pixel marching. Its tables stand in the chapter of systems."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study
from study.experiments.rods.schema import SCHEMAS


def calls(study: Study) -> list[Call]:
    return [Call("rods", ["--run", str(study.run)], may_lack=True)]


EXPERIMENT = Experiment(
    name="rods",
    what="rod marching",
    turn=171,
    schemas=SCHEMAS,
    calls=calls,
    depth=None,
)
