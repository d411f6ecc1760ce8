"""Pictures of every phase against baseline's."""

from __future__ import annotations

from study.core import registry
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.verify import chapter, command
from study.numbers import analysis
from study.numbers.schema import Verify

LEAST, QUICK = 180, 90  # pixels of height


def calls(study: Study) -> list[Call]:
    """Verifies every scene, and what it times by a path. But a quick study compiles no kernel for scenes that
    it does not time. Shares of pixels need pictures that are not too small.
    """
    specs = dict.fromkeys(cell.spec for cell in analysis.load(study.run).cells if cell.spec != "baseline")
    averaged = {"full": "180", "standard": "90"}.get(study.depth, "45")
    height = QUICK if study.quick else max(study.height, LEAST)
    size = ["-n", str(height), "--antialias-n", averaged]
    run = ["--run", str(study.run), *(["--left-scene", *study.scenes] if study.quick else [])]
    sheet = [] if study.asked else [Call("pictures", ["--run", str(study.run)])]
    scenes = dict.fromkeys([*registry.scenes(), *study.scenes])
    return [Call("verify", ["--phase", *specs, "--scene", *scenes, *size, *run]), *sheet]


EXPERIMENT = Experiment(
    name="verify",
    command=command,
    what="every phase on all scenes against baseline",
    turn=10,
    schemas={"verify.json": Verify},
    calls=calls,
    depth="quick",
    cut="Pictures of height 90; the Mandelbulb's 4×4 means at height 45. Phases that ground truth judges "
    "draw the timed scenes alone.",
    sections=[(510, chapter.verification)],
)
