"""Frames a second along a camera's path, and the throttle of rod marching.

The tables of throttle.json stand in the chapter of systems.
"""

from study.experiments.experiment import Experiment
from study.experiments.flight import command, tables
from study.experiments.flight.schema import SCHEMAS

EXPERIMENT = Experiment(
    name="flight",
    what="a flight through a scene",
    turn=172,
    schemas=SCHEMAS,
    depth=None,
    cut="A quick study has no flights: ground truth of each place takes minutes.",
    sections=[(645, tables.section)],
    system=tables.system,
    command=command,
)
