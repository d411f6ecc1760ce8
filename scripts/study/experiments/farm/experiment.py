"""An experiment in shards on a cluster."""

import os

from study.experiments.experiment import Call, Experiment, Study
from study.experiments.farm import command
from study.experiments.farm.schema import SCHEMAS


def calls(study: Study) -> list[Call]:
    """The hard cases on a process for each CPU: the file that their own command writes."""
    cpus = str(len(os.sched_getaffinity(0)))
    return [Call("farm", ["stability", "--workers", cpus, "--run", str(study.run)], may_lack=True)]


EXPERIMENT = Experiment(
    name="farm",
    what="an experiment in shards on a cluster",
    turn=300,
    schemas=SCHEMAS,
    calls=calls,
    depth=None,
    cut="It measures nothing of its own.",
    command=command,
)
