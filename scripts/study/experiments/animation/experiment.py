"""The frames of an animated scene."""

from __future__ import annotations

from study.experiments.animation import command
from study.experiments.animation.schema import FILE, SCHEMAS
from study.experiments.experiment import Experiment
from study.experiments.shards import Sharded

EXPERIMENT = Experiment(
    name="animation",
    what="the frames of an animated scene",
    turn=302,
    schemas=SCHEMAS,
    depth=None,
    cut="It measures nothing.",
    sharded=Sharded(FILE, ("rows",), command.units, command.films),
    command=command,
)
