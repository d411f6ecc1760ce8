"""Rod marching against per-pixel marching. Its tables stand in the chapter of systems."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study


def calls(study: Study) -> list[Call]:
    return [Call("rods", ["--run", str(study.run)], may_lack=True)]


EXPERIMENT = Experiment(
    name="rods",
    what="rod marching",
    turn=171,
    files=("rods.json",),
    calls=calls,
    depth=None,
    cut="A quick study has no systems: builds of every program of them take minutes.",
)
