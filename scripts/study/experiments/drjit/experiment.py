"""Dr.Jit beside our phases."""

from __future__ import annotations

from study.experiments.drjit import chapter
from study.experiments.experiment import Call, Experiment, Study


def calls(study: Study) -> list[Call]:
    return [Call("drjit", ["--run", str(study.run)], may_lack=True)]


EXPERIMENT = Experiment(
    name="drjit",
    what="our phases beside Dr.Jit",
    turn=140,
    files=("drjit.json",),
    calls=calls,
    depth="full",
    cut="Dr.Jit is not among what `make study` installs.",
    sections=[(160, lambda data: chapter.rival(data.path))],
)
