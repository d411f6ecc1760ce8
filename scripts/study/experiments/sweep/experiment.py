"""Times of every phase: what a run begins with."""

from __future__ import annotations

from study.core import run_schema
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.sweep import chapter, goals, rungs


def calls(study: Study) -> list[Call]:
    return []  # the run is its own: stepwise study makes it first


EXPERIMENT = Experiment(
    name="sweep",
    what="times of every phase",
    turn=0,
    schemas={name: run_schema.SCHEMAS[name] for name in ("frames.jsonl", "plan.json", "context.json")},
    calls=calls,
    depth="quick",
    sections=[(110, chapter.speeds), (130, chapter.sizes), (240, rungs.section)],
    goals=goals.reached,
)
