"""The chapter of each phase's work, lanes and roof (study.bounds.work)."""

import math
from collections.abc import Sequence

from matplotlib.figure import Figure

from study.bounds import roof, work
from study.bounds.work import COLUMNS, NOTE, Row
from study.core import registry, show
from study.counting import flops
from study.experiments.section import Part, Section, part, reading
from study.numbers import ladder
from study.numbers.analysis import Data
from study.pictures import dots
from study.pictures.draw import Drawing


def section(data: Data) -> Section:
    """From counts.json, ceilings.json and the frames."""
    parts: list[Part] = []
    drawn, answer = {}, ""
    path = data.path
    with reading(f"{path / 'counts.json'} or ceilings.json", f"scripts/stepwise flops --run {path}"):
        declared = flops.read(path / "counts.json").declared
        if declared:
            found, limits, _ = roof.read(path, strict=False)
            points = roof.points(data, found, limits)
            made = work.rows(ladder.rows(data), declared, points, registry.ladder())
            parts = part("work", "Time, work, lanes, roof and error, a line a phase", made, COLUMNS, NOTE)
            answer = _answer(made)
            if any(row.evals_per_pixel > 0 for row in made):
                caption = "Evaluations per pixel of each phase, and its lane efficiency"
                drawn = {"work": Drawing(caption, NOTE.partition("\n")[0], lambda: _draw(made))}
    about = {"file": path / "counts.json", "script": "scripts/stepwise flops", "drawn": drawn}
    return Section("work", "Work and lanes of each phase", "make flops", parts, answer=answer, **about)


def _draw(made: Sequence[Row]) -> Figure:
    rows = []
    for row in made:
        lanes = row.lane_efficiency
        text = "" if math.isnan(lanes) else f"{100 * lanes:.0f} % of lanes used"
        rows.append(dots.Dot(row.scene, row.phase, row.evals_per_pixel, text=text))
    return dots.draw(rows, "Work of each phase: left is less", "evaluations of a solid per pixel")


def _answer(made: Sequence[Row]) -> str:
    """The first and the last phase of each scene: evaluations per pixel and the lanes that they are in."""
    said = []
    for scene in dict.fromkeys(row.scene for row in made):
        mine = [row for row in made if row.scene == scene and row.evals_per_pixel > 0]
        if len(mine) > 1:
            few = min(mine, key=lambda row: row.evals_per_pixel)
            first, last = (show.number(row.evals_per_pixel) for row in (mine[0], few))
            used = f", {show.percent(few.lane_efficiency)} of whose lanes' work is used"
            said.append(f"on {scene} from {first} of {mine[0].phase} to {last} of {few.phase}{used}")
    return f"Evaluations of a solid per pixel fall {'; '.join(said)}." if said else ""
