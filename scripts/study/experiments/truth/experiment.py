"""The exact pictures that phases are judged by."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study
from study.experiments.shards import Sharded
from study.experiments.truth import command
from study.experiments.truth.schema import FILE, SCHEMAS


def calls(study: Study) -> list[Call]:
    """The study's scenes, at the height of docs/method.md's examples."""
    return [Call("truth", ["--scene", *study.scenes, "-n", "360", "--run", str(study.run)])]


EXPERIMENT = Experiment(
    name="truth",
    what="the exact pictures",
    turn=301,
    schemas=SCHEMAS,
    calls=calls,
    depth=None,
    cut="Every experiment that needs an exact picture makes it.",
    sharded=Sharded(FILE, ("rows",), command.units),
    command=command,
)
