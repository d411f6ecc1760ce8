"""Hard cases with a known answer."""

from __future__ import annotations

from study.experiments import cuts
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.shards import Sharded
from study.experiments.stability import chapter, command
from study.experiments.stability.schema import FILE, SCHEMAS


def calls(study: Study) -> list[Call]:
    few = ["--strengths", "few", "--phase", *cuts.three()[::2]] if study.quick else []
    return [Call("stability", [*few, "--run", str(study.run)])]


EXPERIMENT = Experiment(
    name="stability",
    what="hard cases",
    turn=70,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="The first and the last phase, at the first, the middle and the last strength of each case.",
    sections=[(530, lambda data: chapter.hard(data.path))],
    sharded=Sharded(FILE, ("cases", "results"), command.units),
    command=command,
)
