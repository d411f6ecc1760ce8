"""The roofline: every timed program against what the machine can do."""

from __future__ import annotations

from study.counting import flops
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.flops import experiment as counting
from study.experiments.roofline import chapter


def calls(study: Study) -> list[Call]:
    """Ceilings where it was asked for alone, and counts where there are none."""
    made = [Call("ceilings", ["--run", str(study.run)], judges=False)] if study.asked else []
    counted = flops.read(study.run / "counts.json")[1]
    return made if counted else [*made, counting.measured(study)]


EXPERIMENT = Experiment(
    name="roofline",
    what="what is counted under the roofs",
    turn=31,
    schemas={},
    calls=calls,
    depth="quick",
    sections=[(210, chapter.roofline)],
)
