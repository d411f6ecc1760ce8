"""Frames a second."""

from study.experiments import cuts
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.frames import command, tables
from study.experiments.frames.schema import FILE, SCHEMAS, Frames
from study.experiments.section import chapters

SECONDS, WHOLE_SECONDS, QUICK_SECONDS = "45", "600", "8"


def calls(study: Study) -> list[Call]:
    """The newest phases; all with threads where it was asked for; the last one where seconds must do."""
    seconds = WHOLE_SECONDS if study.whole else QUICK_SECONDS if study.quick else SECONDS
    few = ["--phase", cuts.three()[-1], "--scene", "scene0"] if study.quick else []
    return [Call("frames", [*few, "--budget", seconds, "--run", str(study.run)])]


section = chapters("frames", "Frame rates", FILE, Frames, tables.found)
EXPERIMENT = Experiment(
    name="frames",
    command=command,
    what="frames a second",
    turn=110,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="The last phase on scene0 alone, in eight seconds.",
    sections=[(140, section)],
)
