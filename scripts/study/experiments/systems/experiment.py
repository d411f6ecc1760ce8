"""Systems of other articles: what each experiment with a `system` has in a run, in one chapter."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study
from study.experiments.systems import pictures, tables

COMMANDS = ("rods", "flight --still", "lattice", "fixed", "packets")  # each writes its own file


def calls(study: Study) -> list[Call]:
    run = ["--run", str(study.run)]
    made = [Call(name, [*words, *run], may_lack=True) for name, *words in map(str.split, COMMANDS)]
    return [*made, Call("redraw", [str(study.run), "--only", pictures.PICTURES], may_lack=True)]


EXPERIMENT = Experiment(
    name="systems",
    what="systems of other articles",
    turn=170,
    schemas={},
    calls=calls,
    depth="full",
    cut="Builds and animations of six programs take minutes.",
    sections=[(640, lambda data: tables.section(data.path))],
    sheets={pictures.PICTURES: pictures.write_pictures},
)
