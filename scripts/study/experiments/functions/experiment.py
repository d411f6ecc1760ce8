"""Approximations of functions: speed against ulp."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study
from study.experiments.functions import chapter, command
from study.experiments.functions.schema import SCHEMAS


def calls(study: Study) -> list[Call]:
    return [Call("functions", [*([] if study.whole else ["--quick"]), "--run", str(study.run)])]


EXPERIMENT = Experiment(
    name="functions",
    what="functions: speed against ulp",
    turn=90,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    command=command,
    sections=[(620, lambda data: chapter.approximations(data.path))],
)
