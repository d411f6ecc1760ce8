"""How cost grows."""

from study.core.registry import Spec, cpu_supports, ladder
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.scaling import command, tables
from study.experiments.scaling.schema import SCHEMAS, Scaling
from study.experiments.section import chapters

SECONDS, QUICK_SECONDS = "300", "20"


def calls(study: Study) -> list[Call]:
    """The growth of every program, or in five minutes that of the first and the last two phases."""
    names = [name for name in ladder() if cpu_supports(Spec.parse(name))]
    quick = ["--phase", *dict.fromkeys([names[0], *names[-2:]]), "--budget", SECONDS]
    if study.quick:
        quick = ["--phase", *dict.fromkeys([names[0], names[-1]]), "--budget", QUICK_SECONDS]
    depth = ("--full",) if study.depth == "full" else () if study.asked else quick
    return [Call("scaling", [*depth, "--run", str(study.run)])]


section = chapters("scaling", "How cost grows", command.FILE, Scaling, tables.found)
EXPERIMENT = Experiment(
    name="scaling",
    what="how cost grows",
    turn=130,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="The first and the last phase, and the points that twenty seconds allow.",
    sections=[(610, section)],
    command=command,
)
