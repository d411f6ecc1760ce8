"""CPU-RTRM's scene. Its tables stand in the chapter of systems."""

from __future__ import annotations

from study.experiments.experiment import Experiment
from study.experiments.lattice import command, tables
from study.experiments.lattice.schema import SCHEMAS

EXPERIMENT = Experiment(
    name="lattice",
    what="CPU-RTRM's scene",
    turn=173,
    schemas=SCHEMAS,
    system=tables.system,
    depth=None,
    cut="A quick study has no systems: builds of every program of them take minutes.",
    command=command,
)
