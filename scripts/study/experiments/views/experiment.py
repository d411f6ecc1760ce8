"""Every rung on views that nothing was tuned on."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study
from study.experiments.views import chapter
from study.experiments.views.schema import SCHEMAS


def calls(study: Study) -> list[Call]:
    return [Call("views", [*(["--full"] if study.whole else []), "--run", str(study.run)])]


EXPERIMENT = Experiment(
    name="views",
    what="views that nothing was tuned on",
    turn=100,
    schemas=SCHEMAS,
    calls=calls,
    depth="standard",
    sections=[(430, lambda data: chapter.elsewhere(data.path))],
)
