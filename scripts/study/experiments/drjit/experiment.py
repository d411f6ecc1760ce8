"""Dr.Jit beside our phases."""

from __future__ import annotations

from study.experiments.drjit import chapter
from study.experiments.drjit.schema import SCHEMAS
from study.experiments.experiment import Experiment

EXPERIMENT = Experiment(
    name="drjit",
    what="our phases beside Dr.Jit",
    turn=140,
    schemas=SCHEMAS,
    depth="full",
    cut="Dr.Jit is not among what `make study` installs.",
    sections=[(160, lambda data: chapter.rival(data.path))],
)
