"""Errors to ground truth."""

from __future__ import annotations

from study.experiments.accuracy import chapter, command
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.shards import Sharded
from study.numbers.accuracy import FILE, SCHEMAS

HEIGHT, QUICK_HEIGHT = "180", "90"  # scene0's truth at 180: half a minute on two cores


def calls(study: Study) -> list[Call]:
    """All scenes where it was asked for; else three."""
    scenes = [] if study.whole else ["--scene", *dict.fromkeys([*study.scenes, "trio"])]
    size = ["-n", "720" if study.depth == "full" else QUICK_HEIGHT if study.quick else HEIGHT]
    return [Call("accuracy", [*scenes, *size, "--run", str(study.run)])]


EXPERIMENT = Experiment(
    name="accuracy",
    what="every phase against ground truth",
    turn=60,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="Three scenes at height 90.",
    sections=[(520, lambda data: chapter.errors(data.path))],
    sharded=Sharded(FILE, ("rows", "skipped"), command.units),
    command=command,
)
