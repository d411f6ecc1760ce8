"""When a kernel made for a scene has paid."""

from __future__ import annotations

from study.experiments.breakeven import tables
from study.experiments.breakeven.schema import SCHEMAS
from study.experiments.experiment import Experiment

EXPERIMENT = Experiment(
    name="breakeven",
    what="when code generated for a scene has paid",
    turn=120,
    schemas=SCHEMAS,
    depth="standard",
    sections=[(150, lambda data: tables.section(data.path))],
)
