"""The goals as one table: a chapter of a run, and of several runs beside one another (README)."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from study import goals, machine, registry, show, verdicts
from study.analysis import Data
from study.goals import Goal
from study.sections import Section, part
from study.show import Column
from study.stats import Interval

NOTE = (
    "Asked before it was built. A goal is met where the whole 95 % interval reaches it, missed where none of "
    "it does; else it cannot be told apart. The speed-ups over baseline are for a CPU with AVX-512; without, "
    "half of each is asked (in the cell), and so it is of one held to AVX2 (AVX2 alone: "
    "STEPWISE_ISA_LIMIT=avx2). Best: the last rung, unless another is better by intervals that do not "
    "overlap; 5,000× on scene0 and 250× on mandelbulb were hoped for beyond what was asked of it. "
    "The ratios were set by a baseline of 15.7 s and 16.7 s, in milliseconds 104, 49, 30 and 5.2 on scene0, "
    "619, 418, 209 and 128 on mandelbulb: where baseline takes longer, more suffice. "
    "Each cell names what its dB are to; those to truth are of "
    "the tables of accuracy, at the size that they name. Before: what older runs of the machine found. Of "
    "scattered shapes one scene of each size was timed, of older programs; now every launch is of another."
)
BRIEF_NOTE = (
    "✓ met: the whole 95\u00a0% interval reaches it; ✗ missed: none of it does; ~ cannot be told apart. "
    "Without AVX-512 half of a speed-up over baseline is asked (“of …”). A phase that is not named is the "
    "last rung. Behind a speed stands the error of its picture at n = 180, to truth or to opt3's, where the "
    "run has it; with a hit distance of half a pixel the picture is another one, and its dB are to the "
    "scene's own (secondary rays three of it off left most of the Mandelbulb's floor white). "
    "Measures of accuracy one by one, runs, earlier figures and the rules: "
    "[results/reference/goals.md](results/reference/goals.md)."
)
MARKS = {"met": "✓", "missed": "✗"}
INSTRUCTIONS = 275_700  # baseline's a pixel of scene0, on every machine: results/reference/machines.md
LACKING = "make sweep N=720"
Row = dict[str, Any]
KEPT = ("brief", "from", "last", "before")  # of a row, by machine


def cell(goal: Goal) -> str:
    """`opt9_convex 104× [95, 115] of 65: met; 61.0 dB (4×4)`."""
    exact = goal.found.low == goal.found.high
    text = f"{show.number(goal.found.value)}{goal.unit}" if exact else goals.spread(goal.found, goal.unit)
    if goal.ours and not exact:
        text = text.replace(" [", " (ours alone [", 1) + ")"
    half = f" of {show.number(goal.asked / 2)}{goal.unit}" if goal.narrow else ""
    beside = f" ({goal.beside})" if goal.beside else ""
    verdict = f": **{goal.verdict}**" if goal.verdict else ""
    return f"{goal.what} {text}{beside}{half}{verdict}".strip()


def brief(goal: Goal) -> str:
    """`opt9_convex 104× [95, 115], 61.0 dB ✓`; the phase where it is neither the goal's nor the last rung."""
    exact = goal.found.low == goal.found.high
    text = f"{show.number(goal.found.value)}{goal.unit}" if exact else goals.spread(goal.found, goal.unit)
    error = re.match(r"[\d.]+ dB", goal.beside)
    half = f" of {show.number(goal.asked / 2)}{goal.unit}" if goal.narrow else ""
    who = "" if goal.what in (goal.name.split(" ")[0], list(registry.ladder())[-1]) else goal.what
    return f"{who} {text}{f', {error[0]}' if error else ''}{half} {_mark(goal)}".strip()


def _mark(goal: Goal) -> str:
    marks = [mark for word, mark in MARKS.items() if goal.verdict.startswith(word)]
    return marks[0] if marks else "~" if goal.verdict else ""


def briefly(found: Sequence[Row]) -> list[Row]:
    """The rows for `brief_columns`: what was asked, all measures of accuracy as one."""
    accuracy = [row for row in found if row["of_phase"]]
    kept = [row for row in found if not row["of_phase"] and row["asked"] != show.NOTHING]
    if not accuracy:
        return kept
    marks: dict[str, list[str]] = {}
    for row in accuracy:
        for here, text in row["brief"].items():
            marks.setdefault(here, []).append(text[-1])
    goal = "accuracy: no rung beyond opt4 behind baseline (scene0) and opt4 (mandelbulb), by so many measures"
    told = {here: _all_met(each) for here, each in marks.items()}
    first = next(i for i, row in enumerate([*kept, accuracy[0]]) if row is accuracy[0] or _after_speed(row))
    return [*kept[:first], {"goal": goal, "asked": "all", "brief": told}, *kept[first:]]


def _after_speed(row: Row) -> bool:
    return " over baseline" not in row["goal"] and "two threads" not in row["goal"]


def _all_met(marks: Sequence[str]) -> str:
    met = marks.count(MARKS["met"])
    return f"{met} of {len(marks)} {MARKS['met'] if met == len(marks) else MARKS['missed']}"


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
        if any(one["lanes"] >= goals.WIDE and flags.issuperset(one["isa"]) for one in known.variants)
    ]
    lanes = data.frames[data.frames["phase"].isin(wide)]["lanes"].max()
    return f"{short}, AVX2 alone" if lanes < goals.WIDE else short


def rows(runs: Sequence[Data]) -> tuple[list[Row], dict[str, str]]:
    """A row per goal, a cell per machine: of its newest run that has a figure (of drawn scenes, of the newest
    of those with the most). And machine → its runs.
    """
    made: dict[str, Row] = {}
    told = [
        (data, goals.of_run(data)) for data in sorted(runs, key=lambda data: data.context.get("time") or "")
    ]
    places: dict[str, tuple[int, int]] = {}  # within a source in the order of the run that has most of them
    for _, several in sorted(told, key=lambda pair: -len(pair[1])):
        for place, goal in several:
            places.setdefault(goal.name, (place, len(places)))
    for data, several in told:
        here = name(data)
        for _, goal in several:
            row = made.setdefault(goal.name, {"goal": goal.name} | {key: {} for key in KEPT})
            before, last = row["before"].setdefault(here, []), row["last"].get(here)
            if last and last.scenes > goal.scenes:  # a few of a study's own say less than a run's of its own
                continue
            if last and not goal.of_phase:  # else another run's limit is another
                before.append(_short(last))
            now = _short(goal)
            told = [text for text in dict.fromkeys(before) if text != now]
            row |= {"asked": asked(goal), here: cell(goal) + (f"; before: {', '.join(told)}" if told else "")}
            row["brief"][here], row["of_phase"] = brief(goal), goal.of_phase
            row["from"][here] = data.path.name
            row["last"][here] = goal
    found = sorted(made.values(), key=lambda row: places[row["goal"]])
    used: dict[str, dict[str, None]] = {}
    for row in found:
        for here, run in row["from"].items():
            used.setdefault(here, {})[f"`{run}`"] = None
    for row in found:
        row["over_baseline"] = {
            here: g._asdict() | {"found": asdict(g.found)} for here, g in row.pop("last").items() if g.scene
        }
        row.pop("before")
    return found, {here: ", ".join(names) for here, names in used.items()}


def _short(goal: Goal) -> str:
    """`3.47×`, of a run before."""
    return f"{show.number(goal.found.value)}{goal.unit}"


def by_other_cycles(found: Sequence[Row]) -> str:
    """What each narrow machine's verdicts would be, had its baseline a wide one's core cycles, of each."""
    said = [row.get("over_baseline", {}) for row in found]
    narrow = dict.fromkeys(here for mine in said for here, goal in mine.items() if goal["narrow"])
    wide = dict.fromkeys(here for mine in said for here, goal in mine.items() if not goal["narrow"])
    others = ((there, here) for here in narrow for there in wide if not here.startswith(f"{there},"))
    return " ".join(filter(None, (_by_cycles_of(there, here, said) for there, here in others)))


def _by_cycles_of(wide: str, narrow: str, said: Sequence[Row]) -> str:
    cycles: dict[str, tuple[float, float]] = {}  # scene -> the narrow machine's, the wide one's
    turned: list[str] = []
    for mine in said:
        if narrow not in mine or wide not in mine:
            continue
        goal, there = mine[narrow], mine[wide]["cycles"]
        if not (goal["cycles"] > 0 and there > 0):
            continue
        cycles[goal["scene"]] = (goal["cycles"], there)
        times, ends = goal["cycles"] / there, Interval(**goal["found"])
        least = goal["asked"] / 2
        moved = Interval(
            *(x / times for x in (ends.value, ends.low, ends.high)), ends.launches, ends.sufficient
        )
        verdict = verdicts.goal(moved, least)
        if verdict != goal["verdict"]:
            name = goal["name"].split(" over ")[0]
            of = f"{show.number(moved.value)}× of {show.number(least)}×"
            turned.append(f"{name} ({of}: {verdict})")
    if not cycles:
        return ""
    times = " and ".join(f"{show.number(a / b)} ({scene})" for scene, (a, b) in cycles.items())
    a_cycle = ""
    if "scene0" in cycles:
        rates = " in place of ".join(f"{INSTRUCTIONS / each:.2f}" for each in cycles["scene0"])
        a_cycle = f"; scene0's {INSTRUCTIONS:,} instructions a pixel are the same, at {rates} a core cycle"
    turns = (
        f"by {wide}'s cycles these verdicts would turn: {', '.join(turned)}" if turned else "none would turn"
    )
    return (
        f"{narrow}'s baseline takes {times} times {wide}'s core cycles (time × clock){a_cycle}. "
        f"Its ratios are that much greater; {turns}."
    )


def _brief(here: str) -> Column:
    return Column("", here, lambda row: row["brief"].get(here, show.NOTHING))


def brief_columns(machines: Sequence[str]) -> list[Column]:
    """Of a page for those who want the verdicts."""
    return [*columns([]), *map(_brief, machines)]


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
