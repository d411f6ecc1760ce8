"""Systems of other articles."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study
from study.experiments.systems import tables

# What other articles built: each command writes its own file and judges it; the last draws a sheet of all.
COMMANDS = ("rods", "throttle", "lattice", "fixed", "packets", "systems")
ANIMATED = ("fixed", "packets")  # minutes: a study that was interrupted goes on behind their last frame


def calls(study: Study) -> list[Call]:
    run = ["--run", str(study.run)]
    return [Call(name, [*run, *["--resume"] * (name in ANIMATED)], may_lack=True) for name in COMMANDS]


EXPERIMENT = Experiment(
    name="systems",
    what="systems of other articles",
    turn=170,
    schemas={},
    calls=calls,
    depth="full",
    cut="Builds and animations of six programs take minutes.",
    sections=[(640, lambda data: tables.section(data.path))],
)
