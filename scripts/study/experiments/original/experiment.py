"""The paper's own program beside our phases."""

from __future__ import annotations

from study.experiments.experiment import Experiment
from study.experiments.original import command
from study.numbers.beside import ORIGINAL, Original

EXPERIMENT = Experiment(
    name="original",
    what="the paper's own program",
    turn=160,
    schemas={ORIGINAL: Original},
    depth=None,
    cut="The authors' program has to be downloaded.",
    command=command,
)
