"""Every rung on views that nothing was tuned on."""

from __future__ import annotations

from study.experiments import cuts
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.views import chapter
from study.experiments.views.schema import SCHEMAS


def calls(study: Study) -> list[Call]:
    few = ["--scene", "scene0", "--phase", *cuts.three()] if study.quick else []
    return [Call("views", [*few, *(["--full"] if study.whole else []), "--run", str(study.run)])]


EXPERIMENT = Experiment(
    name="views",
    what="views that nothing was tuned on",
    turn=100,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="Views of scene0 alone, three phases.",
    sections=[(430, lambda data: chapter.elsewhere(data.path))],
)
