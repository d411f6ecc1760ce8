"""When a kernel made for a scene has paid."""

from __future__ import annotations

from study.experiments.breakeven import command, tables
from study.experiments.breakeven.schema import SCHEMAS, Breakeven
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.section import chapters


def calls(study: Study) -> list[Call]:
    few = ["--scene", "scene0", "-n", "360", "--budget", "10"] if study.quick else []
    return [Call("breakeven", [*few, "--run", str(study.run)], may_lack=True)]


section = chapters("breakeven", "Code generated for a scene", command.FILE, Breakeven, tables.found)
EXPERIMENT = Experiment(
    name="breakeven",
    what="when code generated for a scene has paid",
    turn=120,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="Scene0 alone, at height 360 instead of 720.",
    sections=[(150, section)],
    command=command,
)
