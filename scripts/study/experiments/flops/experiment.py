"""FLOPs of a picture, declared, counted and measured."""

from study.counting.schema import SCHEMAS
from study.experiments import cuts
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.flops import chapter, command
from study.numbers import analysis

PAPER_HEIGHT, QUICK_HEIGHT, VALIDATION_HEIGHT = 720, 120, 90
MEASURED_HEIGHT = 96  # of a quick study: counts a pixel hardly change with the size


def _measured(study: Study) -> Call:
    """What every timed program executes for a picture of the headline's height, or of a smaller one."""
    specs = dict.fromkeys(cell.spec for cell in analysis.load(study.run).cells if cell.scene in study.scenes)
    height = min(study.height, MEASURED_HEIGHT) if study.quick else study.height
    size = ["-n", str(height), "--measure", "--run", str(study.run)]
    return Call("flops", ["--scene", *study.scenes, "--phase", *specs, *size], judges=False)


def calls(study: Study) -> list[Call]:
    """Table 1, at the paper's size unless it must be quick; what was executed at the headline's; the one
    against the other, small.
    """
    run = ["--run", str(study.run)]
    height = PAPER_HEIGHT if study.asked or study.at_least("standard") else QUICK_HEIGHT
    few = ["--phase", *cuts.counted()] if study.quick else []
    paper = Call("flops", ["--scene", *study.scenes, "-n", str(height), *few, *run], judges=False)
    few = ["--phase", *cuts.three()[:2], "--scene", *study.scenes] if study.quick else []
    held = [*few, "-n", str(VALIDATION_HEIGHT), "--validate", *run]
    return [paper, _measured(study), Call("flops", held, may_lack=True)]


EXPERIMENT = Experiment(
    name="flops",
    what="counting FLOPs, bytes and instructions",
    turn=20,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="Table 1 of the paper's steps at height 120 instead of 720; counts of the others at 96, scaled; "
    "declared against measured for two phases.",
    command=command,
    sections=[(220, lambda data: chapter.counted(data.path))],
)
