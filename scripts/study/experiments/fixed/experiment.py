"""Rays in integers. Its tables stand in the chapter of systems."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study


def calls(study: Study) -> list[Call]:
    return [Call("fixed", ["--run", str(study.run)], may_lack=True)]


EXPERIMENT = Experiment(
    name="fixed",
    what="rays in integers",
    turn=174,
    files=("fixed.json",),
    calls=calls,
    depth=None,
    cut="A quick study has no systems: an animation of 900 frames takes minutes.",
)
