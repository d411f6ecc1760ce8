"""The paper's own program beside our phases."""

from __future__ import annotations

from study.experiments.experiment import Experiment
from study.numbers.original import SCHEMAS

EXPERIMENT = Experiment(
    name="original",
    what="the paper's own program",
    turn=160,
    schemas=SCHEMAS,
    depth=None,
    cut="The authors' program has to be downloaded.",
)
