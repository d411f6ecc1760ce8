"""What one core can do at best."""

from __future__ import annotations

from study.bounds.ceilings import SCHEMAS
from study.experiments.ceilings import command
from study.experiments.experiment import Call, Experiment, Study


def calls(study: Study) -> list[Call]:
    return [Call("ceilings", ["--run", str(study.run)], judges=False)]


EXPERIMENT = Experiment(
    name="ceilings",
    what="ceilings of this machine",
    turn=30,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    command=command,
)
