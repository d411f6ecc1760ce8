"""The ladders that a reader of the page can choose among: this run's, and those of other published machines.

A published run's times stand beside its own errors. Its ratios to baseline are given only where that baseline
was timed beside the paper's program (original.json).
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from study.core import provenance, show
from study.core.store import RESULTS, Run
from study.numbers import analysis, beside, columns, history, ladder
from study.numbers.analysis import Data
from study.pictures import ladder as figures
from study.pictures.draw import look, shape
from study.pictures.processes import in_processes
from study.report import facts

PUBLISHED = RESULTS / "reference"
UNCHECKED = "No ratio to its baseline is given, for that was not timed beside the paper's program."
Picture = tuple[str, int, int]  # scene, width and height in pixels
Found = dict[str, Any]


def _number(row: Mapping[str, Any], name: str, text: str) -> list[Any] | None:
    """A cell: its text, value, low and high (null without an interval). None where nothing was measured."""
    ends = [row[name], row[f"{name}_low"], row[f"{name}_high"]]
    if pd.isna(ends[0]):
        return None
    return [text, *(None if math.isnan(one) else float(f"{one:.6g}") for one in ends)]


def _cells(row: pd.Series, checked: bool) -> list[Any]:
    """ms, the ratio to each of columns.BASES (null where it is not to be stated), the error in words."""
    ratios = [
        _number(row, name, text(row)) if checked or name != "speedup" else None
        for name, text in columns.BASES.values()
    ]
    return [_number(row, "ms", show.interval(row, "ms")), ratios, figures.truth_text(row)]


def _of(data: Data, rows: pd.DataFrame, checked: bool) -> Found:
    """A ladder: name, what it is of, and scene → size, and phase with threads → cells."""
    scenes = {}
    for scene, group in ladder.ladders(rows).items():
        size = f"{group['width'].iloc[0]}×{group['height'].iloc[0]}"
        cells = {f"{row['phase']} {row['threads']}": _cells(row, checked) for _, row in group.iterrows()}
        scenes[scene] = {"size": size, "cells": cells}
    about = f"run {data.path.name}: {provenance.place(data.context)}."
    if not checked:
        about += f" {UNCHECKED}"
    return {"name": facts.short_name(data), "about": about, "scenes": scenes}


def _pictures(run: Run, wanted: Sequence[Picture]) -> dict[str, Picture]:
    """Scene → its picture in a run: of the wanted size, else its largest one; not of scenes that it lacks."""
    there = {one.group for one in run.plan.configurations if one.height}
    found = {}
    for picture in wanted:
        mine = [one for one in there if one[0] == picture[0]]
        if mine:
            found[picture[0]] = picture if picture in there else max(mine, key=lambda one: one[1] * one[2])
    return found


def _read(path: Path, pictures: Mapping[str, Picture]) -> Found:
    data = analysis.load(path, strict=False)
    cells = [cell for cell in data.cells if cell.picture == pictures.get(cell.scene)]
    data = dataclasses.replace(data, cells=cells, height=None, kept={})
    return _of(data, ladder.rows(data), beside.held_beside(path))


def _others(own: Path, wanted: Sequence[Picture]) -> list[Found]:
    """Of each published machine the run with most of the wanted pictures, then most phases, the newest."""
    candidates: dict[str, list[tuple[tuple[int, int], Path, dict[str, Picture]]]] = {}
    for plan in PUBLISHED.glob("*/plan.json"):
        run = Run(plan.parent)
        pictures = _pictures(run, wanted)
        if not pictures or run.path.resolve() == own.resolve():
            continue
        worth = sum(one in wanted for one in pictures.values()), sum(w * h for _, w, h in pictures.values())
        candidates.setdefault(history.machine(run), []).append((worth, run.path, pictures))
    chosen = []
    for several in candidates.values():
        best = max(worth for worth, *_ in several)
        chosen += [(path, pictures) for worth, path, pictures in several if worth == best]
    chosen.sort(key=lambda one: str(Run(one[0]).context.time))
    found: dict[str, Found] = {}
    for one in in_processes([partial(_read, *each) for each in chosen]):
        known = found.get(one["name"])
        if one["scenes"] and (known is None or _size(one) >= _size(known)):
            found[one["name"]] = one
    return [found[name] for name in sorted(found)]


def _size(found: Found) -> int:
    return sum(len(scene["cells"]) for scene in found["scenes"].values())


def ladders(data: Data, rows: pd.DataFrame) -> Found:
    """What report/templates/ladder.js draws from; empty without a timed frame."""
    shown = ladder.ladders(rows)
    if not shown:
        return {}
    looks = look(rows)
    scenes, wanted = [], []
    for scene, group in shown.items():
        first = group.iloc[0]
        wanted.append((scene, int(first["width"]), int(first["height"])))
        lines = [
            {"key": f"{phase} {threads}", **shape(looks[phase, threads])}
            for phase, threads in zip(group["phase"], group["threads"], strict=True)
        ]
        scenes.append({"scene": scene, "size": f"{first['width']}×{first['height']}", "rows": lines})
    own = _of(data, rows, True)
    others = [one for one in _others(data.path, wanted) if one["name"] != own["name"]]
    return {"bases": list(columns.BASES), "scenes": scenes, "machines": [own, *others]}


def script(data: Data, rows: pd.DataFrame) -> str:
    """The same as JSON for a <script>; "" without a timed frame."""
    found = ladders(data, rows)
    text = json.dumps(found, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c") if found else ""
