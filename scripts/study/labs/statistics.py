"""Lab 13: made-up benchmark reports with their samples. In most of them one thing is wrong.

A student's number draws which, in what order, and every sample. Each key is calculated from the samples as
the student gets them, by the rule that docs/labs/13-statistics.md states.
"""

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from scipy import stats

from study.labs.answers import Question

REPORTS = 5
LAUNCHES = 12
NO_RATIO = ("not_independent", "best_of_many")  # of all others what a ratio says beyond 1 is judged
Rows = list[tuple[Any, ...]]


@dataclass(frozen=True)
class Report:
    """`text`: what it claims and how it was measured; `rows`: the samples in the order in which they were
    taken; `number`: the key."""

    text: str
    columns: Sequence[str]
    rows: Rows
    number: float


def _times(rng: Generator, middle: float, spread: float, count: int) -> list[float]:
    """Milliseconds, lognormal about `middle`, to four digits behind the point."""
    return [round(float(one), 4) for one in middle * np.exp(spread * rng.standard_normal(count))]


def _of(rows: Rows, program: str) -> np.ndarray:
    """The last column of a program's rows."""
    return np.array([row[-1] for row in rows if row[0] == program])


def _in_turns(rng: Generator, times: dict[str, list[float]]) -> Rows:
    """One launch of each a round, in random order, with the number of the launch."""
    rows: Rows = []
    for each in range(LAUNCHES):
        for program in rng.permutation(list(times)):
            rows.append((str(program), len(rows) + 1, times[str(program)][each]))
    return rows


def _ratio(rows: Rows) -> float:
    return float(np.median(_of(rows, "old")) / np.median(_of(rows, "new")))


def _pair(rng: Generator, gain: float) -> dict[str, list[float]]:
    old = rng.uniform(8, 40)
    return {name: _times(rng, old / by, 0.012, LAUNCHES) for name, by in (("old", 1), ("new", gain))}


TURNS = "Each round launches both programs once, in random order, pinned to one CPU."


def sound(rng: Generator) -> Report:
    return _drawn(_pair(rng, rng.uniform(1.1, 1.5)), {"old": 720, "new": 720}, rng)


def mean_of_ratios(rng: Generator) -> Report:
    while True:
        old = rng.permutation(np.geomspace(2, 300, 6)) * rng.uniform(0.8, 1.25, 6)
        new = old / rng.permutation([0.8, 0.9, 1.1, 1.6, 2.4, rng.uniform(3, 5)])
        rows: Rows = [
            (f"scene-{i}", round(a, 3), round(b, 3)) for i, (a, b) in enumerate(zip(old, new, strict=True), 1)
        ]
        before, after = (np.array([row[column] for row in rows]) for column in (1, 2))
        claim, key = float(np.mean(before / after)), float(before.sum() / after.sum())
        if abs(claim / key - 1) > 0.15:
            break
    text = (
        f"new draws the six scenes {claim:.2f}× as fast as old: the mean of the six ratios. Each time is the"
    )
    text += f" median of {LAUNCHES} launches, taken in turns. The product draws all six, one after another."
    return Report(text, ("scene", "old ms", "new ms"), rows, key)


def drift(rng: Generator) -> Report:
    gain, slope = rng.uniform(1.03, 1.08), rng.uniform(0.006, 0.012)
    old, both = rng.uniform(8, 40), ["old"] * LAUNCHES + ["new"] * LAUNCHES
    slow = np.exp(slope * np.arange(len(both)) + 0.002 * rng.standard_normal(len(both)))
    rows: Rows = [
        (name, i + 1, round(float(old / (gain if name == "new" else 1) * slow[i]), 4))
        for i, name in enumerate(both)
    ]
    is_new = np.array([name == "new" for name in both], float)
    terms = np.column_stack([np.ones(len(both)), is_new, np.arange(len(both))])
    fit = np.linalg.lstsq(terms, np.log([row[-1] for row in rows]), rcond=None)[0]
    text = (
        f"new is {_ratio(rows):.3f}× as fast as old: the ratio of the medians of {LAUNCHES} launches of each,"
    )
    text += " pinned to one CPU. The first frame of each launch is not counted."
    return Report(text, ("program", "launch", "ms"), rows, float(np.exp(-fit[1])))


def warm_up(rng: Generator) -> Report:
    gain, old, rows = rng.uniform(1.02, 1.2), rng.uniform(8, 40), []
    cold = rng.uniform(2, 3)
    for launch in range(1, LAUNCHES + 1):
        for name, by, frames in rng.permutation([("old", 1, 3), ("new", gain, 15)]).tolist():
            times = _times(rng, old / float(by), 0.01, int(frames))
            times[0] = round(times[0] * cold, 4)
            rows += [(name, launch, frame, ms) for frame, ms in enumerate(times, 1)]
    warm = [row for row in rows if row[2] > 1]
    claim = float(_of(rows, "old").mean() / _of(rows, "new").mean())
    text = f"new is {claim:.2f}× as fast as old: the ratio of the mean times of a frame, over all frames of"
    text += f" {LAUNCHES} launches. {TURNS}"
    return Report(text, ("program", "launch", "frame", "ms"), rows, _ratio(warm))


def not_independent(rng: Generator) -> Report:
    launches, frames, old, rows = 5, 40, rng.uniform(8, 40), []
    for launch in range(1, launches + 1):
        for name in rng.permutation(["old", "new"]).tolist():
            middle = old * (0.985 if name == "new" else 1) * np.exp(0.025 * rng.standard_normal())
            rows += [
                (name, launch, frame, ms) for frame, ms in enumerate(_times(rng, middle, 0.004, frames), 1)
            ]
    means = [np.mean([row[-1] for row in rows if row[:2] == ("new", one)]) for one in range(1, launches + 1)]
    key = stats.t.ppf(0.975, launches - 1) * np.std(means, ddof=1) / np.sqrt(launches)
    mine = _of(rows, "new")
    half = stats.t.ppf(0.975, len(mine) - 1) * mine.std(ddof=1) / np.sqrt(len(mine))
    text = (
        f"new takes {mine.mean():.3f} ± {half:.3f} ms a frame: the mean of its {len(mine)} frames and their"
    )
    text += " 95 % interval (Student's t), the first frame of each launch left out. old takes"
    text += f" {_of(rows, 'old').mean():.3f} ms. {TURNS}"
    return Report(text, ("program", "launch", "frame", "ms"), rows, float(key))


def best_of_many(rng: Generator) -> Report:
    count, least = int(rng.integers(18, 40)), round(float(rng.uniform(0.012, 0.045)), 4)
    chances = [round(float(one), 4) for one in rng.uniform(0.05, 1, count - 1)]
    chances.insert(int(rng.integers(count)), least)
    rows: Rows = [(f"-fswitch-{i}", p) for i, p in enumerate(chances, 1)]
    flag = rows[chances.index(least)][0]
    text = (
        f"{flag} makes the program faster (p = {least}, so the chance of such a result without any effect is"
    )
    text += (
        f" {100 * least:.1f} %). Each switch: {LAUNCHES} launches with it and without it, in turns, tested by"
    )
    text += " Mann and Whitney's U."
    return Report(text, ("switch", "p"), rows, 1 - (1 - least) ** count)


def best_against_typical(rng: Generator) -> Report:
    old, claim, rows = rng.uniform(8, 40), 0.0, list[Any]()
    while not rows or claim < 1.03 * _ratio(rows):
        times = {name: _times(rng, old / by, 0.035, LAUNCHES) for name, by in (("old", 1), ("new", 1.02))}
        rows = _in_turns(rng, times)
        claim = float(np.median(_of(rows, "old")) / _of(rows, "new").min())
    text = (
        f"new reaches {_of(rows, 'new').min():.3f} ms where old takes {np.median(_of(rows, 'old')):.3f} ms:"
    )
    text += f" {claim:.3f}× as fast. {TURNS} {LAUNCHES} launches of each; the first frame is not counted."
    return Report(text, ("program", "launch", "ms"), rows, _ratio(rows))


def other_work(rng: Generator) -> Report:
    high = {"old": 720, "new": int(rng.choice([600, 630, 648, 675]))}
    return _drawn(_pair(rng, rng.uniform(1.0, 1.1) * high["old"] / high["new"]), high, rng)


def _drawn(times: dict[str, list[float]], high: dict[str, int], rng: Generator) -> Report:
    """A report of frames as high as `high` says; the key is the ratio of the times of a pixel."""
    rows = [(name, launch, 1280, high[name], ms) for name, launch, ms in _in_turns(rng, times)]
    text = (
        f"new is {_ratio(rows):.3f}× as fast as old: the ratio of the medians of {LAUNCHES} launches. {TURNS}"
    )
    text += " Both draw scene0; the first frame of each launch is not counted."
    columns = ("program", "launch", "width", "height", "ms")
    return Report(text, columns, rows, _ratio(rows) * high["new"] / high["old"])


FAULTS: dict[str, Callable[[Generator], Report]] = {
    make.__name__: make
    for make in (
        sound,
        mean_of_ratios,
        drift,
        warm_up,
        not_independent,
        best_of_many,
        best_against_typical,
        other_work,
    )
}


def questions(student: int) -> list[Question]:
    rng = np.random.default_rng([13, student])
    made = []
    for i, word in enumerate(rng.permutation(list(FAULTS))[:REPORTS].tolist(), 1):
        report, table = FAULTS[word](rng), io.StringIO()
        csv.writer(table, lineterminator="\n").writerows([report.columns, *report.rows])
        files = {f"report-{i}.txt": f"{report.text}\n", f"report-{i}.csv": table.getvalue()}
        about = 0.0 if word in NO_RATIO else 1.0
        asked = Question(
            f"report-{i}", tuple(FAULTS), word, report.number, about=about, hint=word, files=files
        )
        made.append(asked)
    return made
