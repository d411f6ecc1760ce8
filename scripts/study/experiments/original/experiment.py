"""The paper's own program beside our phases."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study


def calls(study: Study) -> list[Call]:
    return [Call("original", ["--run", str(study.run)], may_lack=True)]


EXPERIMENT = Experiment(
    name="original",
    what="the paper's own program",
    turn=160,
    files=("original.json",),
    calls=calls,
    depth=None,
    cut="The authors' program has to be downloaded.",
    sections=[],
)
