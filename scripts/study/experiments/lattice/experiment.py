"""CPU-RTRM's scene. Its tables stand in the chapter of systems."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study


def calls(study: Study) -> list[Call]:
    return [Call("lattice", ["--run", str(study.run)], may_lack=True)]


EXPERIMENT = Experiment(
    name="lattice",
    what="CPU-RTRM's scene",
    turn=173,
    files=("lattice.json",),
    calls=calls,
    depth=None,
    cut="A quick study has no systems: builds of every program of them take minutes.",
)
