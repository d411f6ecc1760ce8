"""A packet ray tracer beside Embree. Its tables stand in the chapter of systems."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study


def calls(study: Study) -> list[Call]:
    return [Call("packets", ["--run", str(study.run)], may_lack=True)]


EXPERIMENT = Experiment(
    name="packets",
    what="packets of rays beside Embree",
    turn=175,
    files=("packets.json",),
    calls=calls,
    depth=None,
    cut="It needs Embree, which not every machine has.",
)
