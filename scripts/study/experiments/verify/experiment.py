"""Pictures of every phase against baseline's."""

from __future__ import annotations

from study.experiments.experiment import Call, Experiment, Study
from study.experiments.verify import chapter
from study.numbers import analysis


def calls(study: Study) -> list[Call]:
    """On every scene. The averaged pictures of fractals are higher in a full study."""
    specs = dict.fromkeys(cell.spec for cell in analysis.load(study.run).cells if cell.spec != "baseline")
    averaged = "180" if study.depth == "full" else "90"
    size = ["-n", str(study.height), "--antialias-n", averaged]
    run = ["--run", str(study.run)]
    sheet = [] if study.asked else [Call("pictures", run)]
    return [Call("verify", ["--phase", *specs, *size, *run]), *sheet]


EXPERIMENT = Experiment(
    name="verify",
    what="every phase on all scenes against baseline",
    turn=10,
    files=("verify.json",),
    calls=calls,
    depth="quick",
    sections=[(510, chapter.verification)],
)
