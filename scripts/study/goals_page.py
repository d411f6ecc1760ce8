"""The goals as one table: a chapter of a run, and of several runs beside one another (README)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from study import goals, machine, show
from study.analysis import Data
from study.goals import Goal
from study.sections import Section, part
from study.show import Column

NOTE = (
    "Asked before it was built. A goal is met where the whole 95 % interval reaches it, missed where none of "
    "it does; else it cannot be told apart. The speed-ups over baseline are for a CPU with AVX-512; without, "
    "half of each is asked (in the cell). Best: the fastest phase. Errors: to truth, of the tables of "
    "accuracy, at the size that they name."
)
LACKING = "make sweep N=720"
Row = dict[str, Any]


def cell(goal: Goal) -> str:
    """`opt9_convex 104× [95, 115] of 65: met; 61.0 dB (4×4)`."""
    row = {"x": goal.found.value, "x_low": goal.found.low, "x_high": goal.found.high}
    exact = goal.found.low == goal.found.high
    text = f"{show.number(goal.found.value)}{goal.unit}" if exact else show.interval(row, "x", 3, goal.unit)
    half = f" of {show.number(goal.asked / 2)}{goal.unit}" if goal.narrow else ""
    beside = f" ({goal.beside})" if goal.beside else ""
    return f"{goal.what} {text}{beside}{half}: **{goal.verdict}**".strip()


def asked(goal: Goal) -> str:
    """`≥ 150×`."""
    return f"{'≤' if goal.at_most else '≥'} {show.number(goal.asked)}{goal.unit}"


def name(data: Data) -> str:
    """Of the run's machine, short."""
    found = data.context.get("cpu") or {}
    return found.get("microarchitecture") or machine.name(data.context)


def rows(runs: Sequence[Data]) -> tuple[list[Row], dict[str, str]]:
    """A row per goal, a cell per machine: of its newest run that has a figure. And machine → its runs."""
    made: dict[str, Row] = {}
    places: dict[str, int] = {}
    for data in sorted(runs, key=lambda data: data.context.get("time") or ""):
        here = name(data)
        for place, goal in goals.of_run(data):
            places.setdefault(goal.name, place)
            row = made.setdefault(goal.name, {"goal": goal.name, "from": {}})
            row |= {"asked": asked(goal), here: cell(goal)}
            row["from"][here] = data.path.name
    found = sorted(made.values(), key=lambda row: places[row["goal"]])
    used: dict[str, dict[str, None]] = {}
    for row in found:
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
    parts = part("goals", "What was asked, and what this run has of it", found, columns([name(data)]))
    return Section("goals", "Goals", LACKING, parts, [NOTE] if parts else [])
