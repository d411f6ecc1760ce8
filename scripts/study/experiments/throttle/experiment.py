"""The throttle of rod marching. Its tables stand in the chapter of systems."""

from __future__ import annotations

from study.experiments.experiment import Experiment
from study.experiments.throttle.schema import SCHEMAS

EXPERIMENT = Experiment(
    name="throttle",
    what="rod marching's settings for a stated error",
    turn=172,
    schemas=SCHEMAS,
    depth=None,
    cut="A quick study has no systems: 360 settings a scene take minutes.",
)
