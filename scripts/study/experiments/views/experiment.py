"""Every phase on views that nothing was tuned on."""

from study.experiments import cuts
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.section import chapters
from study.experiments.views import command, tables
from study.experiments.views.schema import SCHEMAS, Views


def calls(study: Study) -> list[Call]:
    few = ["--scene", "scene0", "--phase", *cuts.three()] if study.quick else []
    return [Call("views", [*few, *(["--full"] if study.whole else []), "--run", str(study.run)])]


section = chapters("views", "Views it was not tuned on", command.FILE, Views, tables.found)
EXPERIMENT = Experiment(
    name="views",
    what="views that nothing was tuned on",
    turn=100,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="Views of scene0 alone, three phases.",
    sections=[(430, section)],
    command=command,
)
