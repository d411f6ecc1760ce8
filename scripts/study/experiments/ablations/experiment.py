"""Single steps, put in or taken out."""

from study.experiments.ablations import chapter, command, ideas
from study.experiments.ablations.schema import SCHEMAS
from study.experiments.experiment import Call, Experiment, Study

QUICK = ("baseline", "opt1")  # built in seconds


# At the command's own size and launches: at n = 90 and six launches half of the steps could not be told.
def calls(study: Study) -> list[Call]:
    few = ["--phase", *QUICK, "--scene", "scene0", "-n", "60", "--launches", "6"] if study.quick else []
    return [Call("ablations", [*few, "--run", str(study.run)])]


EXPERIMENT = Experiment(
    name="ablations",
    what="single steps put in and taken out",
    turn=50,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="Steps of the first two phases on scene0 at height 60, six launches.",
    command=command,
    lesson=ideas.lesson,
    sections=[(410, lambda data: chapter.steps(data.path)), (420, lambda data: chapter.negative(data.path))],
)
