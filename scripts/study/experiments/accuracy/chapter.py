"""The chapter of errors to ground truth."""

from __future__ import annotations

import math
from pathlib import Path

from study.core import show
from study.core.show import Row
from study.experiments.accuracy import tables as accuracy_page
from study.experiments.section import Section, inside, part, reading
from study.numbers import accuracy
from study.pictures.draw import Drawing


def _again(result: Row) -> str:
    """The command that renders the pictures of these rows again."""
    scenes = " ".join(dict.fromkeys(row["scene"] for row in result["rows"]))
    more = " --convergence" if result.get("convergence") else ""
    sizes = " ".join(dict.fromkeys(str(row["height"]) for row in result["rows"]))
    return f"scripts/stepwise accuracy --scene {scenes} -n {sizes}{more}"


def _answer(rows: list[Row]) -> str:
    """The nearest and the furthest phase of each scene, and which phases break their promise."""
    said = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        mine = [
            (_level(row), row["phase"]) for row in rows if row["scene"] == scene and row["non_finite"] == 0
        ]
        mine = [one for one in mine if not math.isnan(one[0])]
        if mine:
            (low, worst), (high, best) = min(mine), max(mine)
            said.append(f"on {scene} from {show.number(low)} dB ({worst}) to {show.number(high)} dB ({best})")
    gated = [row for row in rows if row["gated"]]
    failed = [f"{row['phase']} on {row['scene']}" for row in gated if row["failed"]]
    judged = (
        f"{len(gated) - len(failed)} of {len(gated)} pictures of gated phases are no further than baseline's"
    )
    text = f"PSNR to ground truth goes {'; '.join(said)}"
    text += f"; {judged}" if gated else ""
    return f"{text}." if said else ""


def _level(row: Row) -> float:
    """PSNR to ground truth; of a fractal that of 4×4 means."""
    found = (row["antialiased"] if row["converged_only"] else row).get("psnr_db")
    return math.nan if found is None else found


def errors(path: Path) -> Section:
    """Every phase against ground truth, where its bad pixels lie, the Mandelbulb's convergence."""
    file = path / accuracy.FILE
    parts, answer, images, drawn, script = [], "", {}, {}, "scripts/stepwise accuracy"
    with reading(file, f"scripts/stepwise accuracy --run {path}"):
        result = accuracy.read(path)
        for name, caption, rows, columns in accuracy_page.tables(result):
            parts += part(name, caption, rows, columns, accuracy_page.FEET.get(name, ""))
        if parts:
            answer = _answer(result["rows"])
            captions = {
                "accuracy-where": "Pixels that are wrong, and where they lie",
                "accuracy-convergence": "The Mandelbulb: precision against hit distance",
            }
            note = accuracy_page.note(result)
            drawn = {
                name: Drawing(captions[name], note, draw)
                for name, draw in accuracy_page.drawings(result).items()
            }
            script = _again(result)
            images = {
                inside(path, row["picture"]): f"{row['scene']} by {row['phase']}: where it is wrong"
                for row in result["rows"]
                if row.get("picture") and row["phase"] in ("baseline", "opt4")
            }
    about = {"file": file, "script": script, "drawn": drawn, "images": images}
    return Section("accuracy", "Error to ground truth", "make accuracy", parts, answer=answer, **about)
