"""Random scenes and random bytes."""

from __future__ import annotations

from study.experiments.experiment import Experiment
from study.experiments.random import command
from study.experiments.random.schema import SCHEMAS
from study.experiments.shards import Sharded

EXPERIMENT = Experiment(
    name="random",
    command=command,
    what="random scenes and random bytes",
    turn=303,
    schemas=SCHEMAS,
    depth=None,
    cut="It looks for errors of the programs and measures nothing.",
    sharded=Sharded(command.FILE, ("rows",), command.units),
)
