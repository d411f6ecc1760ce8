"""Single steps, put in or taken out."""

from __future__ import annotations

from study.experiments.ablations import chapter, negative
from study.experiments.ablations.schema import SCHEMAS
from study.experiments.experiment import Call, Experiment, Study


# At the command's own size and launches: at n = 90 and six launches half of the steps could not be told.
def calls(study: Study) -> list[Call]:
    return [Call("ablations", ["--run", str(study.run)])]


EXPERIMENT = Experiment(
    name="ablations",
    what="single steps put in and taken out",
    turn=50,
    schemas=SCHEMAS,
    calls=calls,
    depth="standard",
    sections=[
        (410, lambda data: chapter.steps(data.path)),
        (420, lambda data: negative.section(data.path)),
    ],
)
