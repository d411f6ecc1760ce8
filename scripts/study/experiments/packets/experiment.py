"""Packets of rays. Its tables stand in the chapter of systems."""

from study.experiments.experiment import Experiment
from study.experiments.packets import command, tables
from study.experiments.packets.schema import SCHEMAS

EXPERIMENT = Experiment(
    name="packets",
    what="packets of rays beside Embree",
    turn=175,
    schemas=SCHEMAS,
    depth=None,
    cut="It needs Embree, which not every machine has.",
    command=command,
    system=tables.system,
)
