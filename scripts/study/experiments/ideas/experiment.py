"""Each idea of a phase, taken out of it."""

from __future__ import annotations

from study.experiments.ablations import ideas
from study.experiments.ablations.schema import IDEAS
from study.experiments.experiment import Call, Experiment, Study


# At a size at which the fastest phase's frame takes milliseconds.
def calls(study: Study) -> list[Call]:
    return [Call("ideas", ["-n", "360", "--launches", "20", "--run", str(study.run)])]


EXPERIMENT = Experiment(
    name="ideas",
    what="each idea taken out of its phase",
    turn=55,
    schemas=IDEAS,
    calls=calls,
    depth=None,
    cut="Each idea is a build of a wide phase of its own, half a minute each; it has no chapter.",
    lesson=ideas.lesson,
)
