"""The chapter of errors to ground truth."""

from __future__ import annotations

import math
from pathlib import Path

from study.core import show
from study.experiments.accuracy import tables
from study.experiments.section import Section, part
from study.numbers.accuracy import FILE, Accuracy, Row


def _again(result: Accuracy) -> str:
    """The command that renders the pictures of these rows again."""
    scenes = " ".join(dict.fromkeys(row.scene for row in result.rows))
    sizes = " ".join(dict.fromkeys(str(row.height) for row in result.rows))
    return f"scripts/stepwise accuracy --scene {scenes} -n {sizes}"


def _answer(rows: list[Row]) -> str:
    """The nearest and the furthest phase of each scene, and which phases break their promise."""
    said = []
    for scene in dict.fromkeys(row.scene for row in rows):
        finite = [row for row in rows if row.scene == scene and row.non_finite == 0]
        mine = [(level, row.phase) for row in finite if not math.isnan(level := row.colours.psnr_db)]
        if mine:
            (low, worst), (high, best) = min(mine), max(mine)
            said.append(f"on {scene} from {show.number(low)} dB ({worst}) to {show.number(high)} dB ({best})")
    gated = [row for row in rows if row.gated]
    near = sum(not row.failed for row in gated)
    judged = f"; {near} of {len(gated)} pictures of gated phases are no further than baseline's"
    return f"PSNR to ground truth goes {'; '.join(said)}{judged * bool(gated)}." if said else ""


def errors(path: Path) -> Section:
    """Every phase against ground truth, and where its bad pixels lie."""
    about: dict = {"script": "scripts/stepwise accuracy"}
    parts = []
    result = Accuracy.load_if_there(path / FILE)
    if result and result.rows:
        for name, caption, rows, columns in tables.tables(result):
            parts += part(name, caption, rows, columns, tables.FEET.get(name, ""))
        about = {
            "answer": _answer(result.rows),
            "drawn": tables.drawings(result),
            "script": _again(result),
            "images": {
                path / row.picture: f"{row.scene} by {row.phase}: where it is wrong"
                for row in result.rows
                if row.picture and row.phase in ("baseline", "opt4")
            },
        }
    return Section("accuracy", "Error to ground truth", "make accuracy", parts, file=path / FILE, **about)
