"""CPU-RTRM's scene. Its tables stand in the chapter of systems."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study
from study.experiments.lattice import goals
from study.experiments.lattice.schema import SCHEMAS


def calls(study: Study) -> list[Call]:
    return [Call("lattice", ["--run", str(study.run)], may_lack=True)]


EXPERIMENT = Experiment(
    name="lattice",
    what="CPU-RTRM's scene",
    turn=173,
    schemas=SCHEMAS,
    calls=calls,
    depth=None,
    goals=goals.reached,
)
