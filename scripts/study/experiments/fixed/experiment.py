"""Rays in integers. Its tables stand in the chapter of systems."""

from __future__ import annotations

from study.experiments.experiment import Experiment
from study.experiments.fixed import command, tables
from study.experiments.fixed.schema import SCHEMAS

EXPERIMENT = Experiment(
    name="fixed",
    what="rays in integers",
    turn=174,
    schemas=SCHEMAS,
    depth=None,
    cut="A quick study has no systems: an animation of 900 frames takes minutes.",
    command=command,
    system=tables.system,
)
