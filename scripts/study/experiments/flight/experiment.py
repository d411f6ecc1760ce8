"""Frames a second along a camera's path."""

from __future__ import annotations

from study.experiments.experiment import Experiment
from study.experiments.flight import tables
from study.experiments.flight.schema import SCHEMAS

EXPERIMENT = Experiment(
    name="flight",
    what="a flight through a scene",
    turn=173,
    schemas=SCHEMAS,
    depth=None,
    cut="A quick study has no flights: ground truth of each place takes minutes.",
    sections=[(645, lambda data: tables.section(data.path))],
)
