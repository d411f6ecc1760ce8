"""The ladders that a reader of the page can choose among: this run's, and those of other published machines.

A published run's times stand beside its own errors. Its ratios to baseline are given only where that baseline
was timed beside the paper's program (original.json).
"""

import dataclasses
import math
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pandas as pd

from study.core import show
from study.core.store import RESULTS, Run
from study.numbers import analysis, beside, columns, history, ladder
from study.numbers.analysis import Data
from study.pictures import charts
from study.pictures.charts import Ratio
from study.pictures.ladder import truth_text
from study.pictures.processes import in_processes
from study.report import facts

PUBLISHED = RESULTS / "reference"
TIMES = "nothing: ms a frame"
Picture = tuple[str, int, int]  # scene, width and height in pixels


def _ratios(machine: str, rows: pd.DataFrame, checked: bool) -> Iterator[Ratio]:
    """Ratios of each scene, phase and base; the base TIMES has milliseconds in their place."""
    for scene, group in ladder.ladders(rows).items():
        for row in group.to_dict("records"):
            phase = row["phase"] + (f" ×{row['threads']}" if row["threads"] > 1 else "")
            size, error = f"{row['width']}×{row['height']}", truth_text(row)
            bases = columns.BASES | {TIMES: ("ms", lambda row: f"{show.interval(row, 'ms')} ms")}
            for base, (name, text) in bases.items():
                if pd.isna(row[name]) or (name == "speedup" and not checked):
                    continue
                ends = [None if math.isnan(row[key]) else row[key] for key in (f"{name}_low", f"{name}_high")]
                unit = " ms" if base == TIMES else "×"
                label = f"{show.number(row[name])}{unit}{'' if error == show.NOTHING else f', {error}'}"
                yield Ratio(machine, scene, base, phase, row[name], *ends, f"{text(row)}, {size}", label)


def _pictures(run: Run, wanted: list[Picture]) -> dict[str, Picture]:
    """Scene → its picture in a run: of the wanted size, else its largest one; not of scenes that it lacks."""
    there = {one.group for one in run.plan.configurations if one.height}
    found = {}
    for picture in wanted:
        mine = [one for one in there if one[0] == picture[0]]
        if mine:
            found[picture[0]] = picture if picture in there else max(mine, key=lambda one: one[1] * one[2])
    return found


def _read(path: Path, pictures: dict[str, Picture]) -> list[Ratio]:
    data = analysis.load(path)
    cells = [cell for cell in data.cells if cell.picture == pictures.get(cell.scene)]
    data = dataclasses.replace(data, cells=cells, height=None, kept={})
    return list(_ratios(facts.short_name(data), ladder.rows(data), beside.held_beside(path)))


def _others(own: Path, wanted: list[Picture]) -> list[list[Ratio]]:
    """Each published machine's run with most of the wanted pictures, then the largest, most phases."""
    best: dict[str, tuple[tuple[int, int, int, str], Path, dict[str, Picture]]] = {}
    for plan in PUBLISHED.glob("*/plan.json"):
        run = Run(plan.parent)
        pictures = _pictures(run, wanted)
        if not pictures or run.path.resolve() == own.resolve():
            continue
        size = sum(width * height for _, width, height in pictures.values())
        about = len(run.plan.configurations), str(run.context.time)
        worth = sum(one in wanted for one in pictures.values()), size, *about
        machine = history.machine(run)
        if machine not in best or worth > best[machine][0]:
            best[machine] = worth, run.path, pictures
    return in_processes([partial(_read, path, pictures) for _, path, pictures in best.values()])


def chart(data: Data, rows: pd.DataFrame) -> str:
    """HTML of the chart; "" without a timed frame."""
    shown = ladder.ladders(rows)
    first = [group.iloc[0] for group in shown.values()]
    wanted = [(scene, int(row["width"]), int(row["height"])) for scene, row in zip(shown, first, strict=True)]
    here = facts.short_name(data)
    found = list(_ratios(f"{here} (this run)", rows, True))
    if not found:
        return ""
    others = {some[0].machine: some for some in _others(data.path, wanted) if some}
    others.pop(here, None)
    return charts.speedups([*found, *(one for name in sorted(others) for one in others[name])])
