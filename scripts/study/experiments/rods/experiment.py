"""Rod marching against per-pixel marching. Its tables stand in the chapter of systems."""

from __future__ import annotations

from study.experiments.experiment import Experiment
from study.experiments.rods import command, measure, pictures, tables
from study.experiments.rods.schema import SCHEMAS

EXPERIMENT = Experiment(
    name="rods",
    what="rod marching",
    turn=171,
    schemas=SCHEMAS,
    depth=None,
    cut="A quick study has no systems: builds of every program of them take minutes.",
    command=command,
    system=tables.system,
    sheets={pictures.PICTURES: lambda out: pictures.write_pictures(out, measure.ARTICLE.size)},
)
