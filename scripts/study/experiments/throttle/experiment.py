"""The throttle of rod marching. Its tables stand in the chapter of systems."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study


def calls(study: Study) -> list[Call]:
    return [Call("throttle", ["--run", str(study.run)], may_lack=True)]


EXPERIMENT = Experiment(
    name="throttle",
    what="rod marching's settings for a stated error",
    turn=172,
    files=("throttle.json",),
    calls=calls,
    depth=None,
    cut="A quick study has no systems: 360 settings a scene take minutes.",
)
