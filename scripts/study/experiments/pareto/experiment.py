"""Speed against error."""

from study.experiments import cuts
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.pareto import command, tables
from study.experiments.pareto.schema import SCHEMAS

QUICK, HEIGHT = "64", "144"  # heights; on smaller pictures a frame's constant part decides
FEW = ["--hit-distance", "1e-2", "1e-4", "--max-steps", "64"]


def calls(study: Study) -> list[Call]:
    """Every scene and the whole grid where it was asked for; else a few points."""
    few = [] if study.whole else ["--scene", *study.scenes, "-n", HEIGHT, *FEW]
    if study.quick:
        few = ["--scene", study.scenes[0], "-n", QUICK, *FEW, "--phase", *cuts.three()]
    return [Call("pareto", [*few, "--run", str(study.run)])]


EXPERIMENT = Experiment(
    name="pareto",
    what="speed against error",
    turn=80,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="One scene and three phases at height 64, two hit distances, one step limit.",
    command=command,
    sections=[(120, tables.section)],
)
