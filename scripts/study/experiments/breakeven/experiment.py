"""When a kernel made for a scene has paid."""

from __future__ import annotations

from study.experiments.breakeven import tables
from study.experiments.breakeven.schema import SCHEMAS
from study.experiments.experiment import Call, Experiment, Study


def calls(study: Study) -> list[Call]:
    return [Call("breakeven", ["--run", str(study.run)], may_lack=True)]


EXPERIMENT = Experiment(
    name="breakeven",
    what="when code generated for a scene has paid",
    turn=120,
    schemas=SCHEMAS,
    calls=calls,
    depth="standard",
    sections=[(150, lambda data: tables.section(data.path))],
)
