"""Compilers and flags."""

from study.experiments.experiment import Call, Experiment, Study
from study.experiments.toolchains import chapter, command
from study.experiments.toolchains.schema import SCHEMAS


def calls(study: Study) -> list[Call]:
    return [Call("toolchains", ["--run", str(study.run)])]


EXPERIMENT = Experiment(
    name="toolchains",
    what="compilers and flags",
    turn=150,
    schemas=SCHEMAS,
    calls=calls,
    depth="full",
    cut="Every phase is built by two compilers with four sets of flags, which takes minutes.",
    command=command,
    sections=[(630, chapter.section)],
)
