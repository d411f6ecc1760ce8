"""The roofline: every timed program against what the machine can do."""

from study.counting import flops
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.roofline import chapter, command
from study.numbers import analysis


def calls(study: Study) -> list[Call]:
    """Ceilings where it was asked for alone, and counts of what was timed where there are none."""
    made = [Call("ceilings", ["--run", str(study.run)], judges=False)] if study.asked else []
    if flops.read(study.run / "counts.json").measured:
        return made
    specs = dict.fromkeys(cell.spec for cell in analysis.load(study.run).cells if cell.scene in study.scenes)
    size = ["-n", str(study.height), "--measure", "--run", str(study.run)]
    words = ["--scene", *study.scenes, "--phase", *specs, *size]
    return [*made, Call("flops", words, judges=False)]


EXPERIMENT = Experiment(
    name="roofline",
    what="what is counted under the roofs",
    turn=31,
    schemas={},
    calls=calls,
    depth="quick",
    command=command,
    sections=[(210, chapter.roofline)],
)
