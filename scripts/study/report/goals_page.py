"""The goals as one table: a chapter of a run, and of several runs beside one another."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from study.core import machine, registry, show
from study.core.show import Column
from study.experiments import experiment
from study.experiments.goal import Goal
from study.experiments.section import Section, part
from study.numbers.analysis import Data

NOTE = (
    "Each goal was set before the work. Met: the whole 95 % interval reaches the goal. Missed: none of it "
    "does. A CPU without AVX-512, and a run held to AVX2 (STEPWISE_ISA_LIMIT=avx2), needs half of a speed-up "
    "over baseline; the cell then names that half. Best: the last rung, unless another rung is better by "
    "intervals that do not overlap. Speed-ups over baseline are shown only where that baseline was timed "
    "beside the paper's own program (original.json) and is no slower. Errors to ground truth are of the "
    "run's table of accuracy, at the size that the cell names."
)
LACKING = "make sweep N=720"
Row = dict[str, Any]
WIDE = 16  # lanes of the newest CPUs
KEPT = ("from", "last")  # of a row, by machine


def cell(goal: Goal) -> str:
    """`opt9_convex 104× [95, 115] of 65: met; 61.0 dB (4×4)`."""
    exact = goal.found.low == goal.found.high
    text = f"{show.number(goal.found.value)}{goal.unit}" if exact else show.spread(goal.found, 3, goal.unit)
    if goal.ours and not exact:
        text = text.replace(" [", " (ours alone [", 1) + ")"
    half = f" of {show.number(goal.asked / 2)}{goal.unit}" if goal.narrow else ""
    beside = f" ({goal.beside})" if goal.beside else ""
    verdict = f": **{goal.verdict}**" if goal.verdict else ""
    return f"{goal.what} {text}{beside}{half}{verdict}".strip()


def asked(goal: Goal) -> str:
    """`≥ 150×`."""
    if math.isnan(goal.asked):
        return show.NOTHING
    if goal.of_phase:
        return f"{'≤' if goal.at_most else '≥'} {goal.of_phase}'s"
    return f"{'≤' if goal.at_most else '≥'} {show.number(goal.asked)}{goal.unit}"


def name(data: Data) -> str:
    """Of the run's machine, short; and of a run whose rungs had fewer lanes than that CPU has."""
    found = data.context.get("cpu") or {}
    short = found.get("microarchitecture") or machine.name(data.context)
    if not {"phase", "lanes"} <= set(data.frames):
        return short
    flags = set(found.get("flags") or ())
    wide = [
        phase
        for phase, known in registry.ladder().items()
        if any(one["lanes"] >= WIDE and flags.issuperset(one["isa"]) for one in known.variants)
    ]
    lanes = data.frames[data.frames["phase"].isin(wide)]["lanes"].max()
    return f"{short}, AVX2 alone" if lanes < WIDE else short


def rows(runs: Sequence[Data], checked: bool = False) -> tuple[list[Row], dict[str, str]]:
    """A row per goal, a cell per machine: of its newest run that has a figure (of drawn scenes, of the newest
    of those with the most). And machine → its runs. `checked`: speed-ups over baseline only of runs whose
    baseline was held beside the paper's program.
    """
    made: dict[str, Row] = {}
    told = [
        (data, experiment.goals(data))
        for data in sorted(runs, key=lambda data: data.context.get("time") or "")
    ]
    places: dict[str, tuple[int, int]] = {}  # within a source in the order of the run that has most of them
    for _, several in sorted(told, key=lambda pair: -len(pair[1])):
        for place, goal in several:
            places.setdefault(goal.name, (place, len(places)))
    for data, several in told:
        here = name(data)
        for _, goal in several:
            if checked and goal.unchecked:
                continue
            row = made.setdefault(goal.name, {"goal": goal.name} | {key: {} for key in KEPT})
            last = row["last"].get(here)
            if last and last.scenes > goal.scenes:  # a few of a study's own say less than a run's of its own
                continue
            row |= {"asked": asked(goal), here: cell(goal)}
            row["from"][here] = data.path.name
            row["last"][here] = goal
    found = sorted(made.values(), key=lambda row: places[row["goal"]])
    used: dict[str, dict[str, None]] = {}
    for row in found:
        row.pop("last")
        for here, run in row["from"].items():
            used.setdefault(here, {})[f"`{run}`"] = None
    return found, {here: ", ".join(names) for here, names in used.items()}


def _cell(here: str) -> Column:
    return Column("", f"{here} [95 %]", lambda row: row.get(here, show.NOTHING))


def columns(machines: Sequence[str]) -> list[Column]:
    return [
        Column("", "goal", lambda row: row["goal"]),
        Column("", "asked", lambda row: row["asked"]),
        *(_cell(here) for here in machines),
    ]


def section(data: Data) -> Section:
    """Of one run."""
    found, _ = rows([data])
    here = name(data)
    plain = [row | {here: row[here].replace("**", "")} for row in found]  # Markdown is no HTML
    parts = part("goals", "What was asked, and what this run has of it", plain, columns([here]))
    return Section("goals", "Goals", LACKING, parts, [NOTE] if parts else [])
