"""Errors to ground truth."""

import math
from pathlib import Path

from study.core import show
from study.experiments.accuracy import command, tables
from study.experiments.experiment import Call, Experiment, Study
from study.experiments.section import Section, part
from study.experiments.shards import Sharded
from study.numbers.accuracy import FILE, SCHEMAS, Accuracy, Row

HEIGHT, QUICK_HEIGHT = "180", "90"  # scene0's truth at 180: half a minute on two cores


def calls(study: Study) -> list[Call]:
    """All scenes where it was asked for; else three, in a quick study the timed ones."""
    few = dict.fromkeys([*study.scenes, *([] if study.quick else ["trio"])])
    scenes = [] if study.whole else ["--scene", *few]
    size = ["-n", "720" if study.depth == "full" else QUICK_HEIGHT if study.quick else HEIGHT]
    return [Call("accuracy", [*scenes, *size, "--run", str(study.run)])]


def _again(result: Accuracy) -> str:
    """The command that renders the pictures of these rows again."""
    scenes = " ".join(dict.fromkeys(row.scene for row in result.rows))
    sizes = " ".join(dict.fromkeys(str(row.height) for row in result.rows))
    return f"scripts/stepwise accuracy --scene {scenes} -n {sizes}"


def _answer(rows: list[Row]) -> str:
    """The nearest and the furthest phase of each scene, by the shadow it draws; which break their promise."""
    said = []
    for scene in dict.fromkeys(row.scene for row in rows):
        finite = [row for row in rows if row.scene == scene and row.non_finite == 0]
        levels = [
            (row.shown.psnr_ideal_db if row.judged_by == "ideal" else row.shown.psnr_db, row)
            for row in finite
        ]
        mine = [
            (level, row.phase + ", ideal shadow" * (row.judged_by == "ideal"))
            for level, row in levels
            if not math.isnan(level)
        ]
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


EXPERIMENT = Experiment(
    name="accuracy",
    what="every phase against ground truth",
    turn=15,
    schemas=SCHEMAS,
    calls=calls,
    depth="quick",
    cut="The timed scenes at height 90.",
    sections=[(520, lambda data: errors(data.path))],
    sharded=Sharded(FILE, ("rows", "skipped"), command.units),
    command=command,
)
