"""Systems of other articles: what each experiment with a `system` has in a run, in one chapter."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study
from study.experiments.systems import command, pictures, tables

# Each command writes its own file and judges it; the last draws a sheet of all.
COMMANDS = ("rods", "flight --still", "lattice", "fixed", "packets", "systems")


def calls(study: Study) -> list[Call]:
    run = ["--run", str(study.run)]
    return [Call(name, [*words, *run], may_lack=True) for name, *words in map(str.split, COMMANDS)]


EXPERIMENT = Experiment(
    name="systems",
    what="systems of other articles",
    turn=170,
    schemas={},
    calls=calls,
    depth="full",
    cut="Builds and animations of six programs take minutes.",
    sections=[(640, lambda data: tables.section(data.path))],
    command=command,
    sheets={pictures.PICTURES: pictures.write_pictures},
)
