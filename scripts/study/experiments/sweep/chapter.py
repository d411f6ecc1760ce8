"""The chapters of a sweep: speed and error, time against picture height, the work of each phase."""

import math
from collections.abc import Sequence

from matplotlib.figure import Figure

from study.bounds import roof, work
from study.core import registry, show
from study.core.show import Row
from study.counting import flops
from study.experiments.section import Found, Section, part, reading
from study.numbers import columns, ladder
from study.numbers.analysis import Data
from study.pictures import dots
from study.pictures.draw import Drawing
from study.pictures.ladder import drawings

CLOSED = (
    "{} plain sphere tracing: camera rays meet the shapes by closed forms and Newton's steps, but for "
    "Mandelbulbs. What is gained there is another algorithm's."
)
BASES = (
    "“opt2@opt3” is opt2's source built with opt3's flags: it tells the change in the code from the change "
    "of flags."
)


def to_truth(row: Row) -> str:
    """A row's error to ground truth in words, else that to baseline; "" where neither was measured. Of a
    phase that draws the ideal shadow, ground truth is the picture with that shadow."""
    found = row.get("truth_own_db")
    if found is not None and not math.isnan(found):
        means = " by 4×4 means" if show.yes(row.get("truth_converged_only")) else ""
        picture = "the ideal picture" if show.yes(row.get("truth_draws_ideal")) else "ground truth"
        return f"{show.number(found)} dB to {picture}{means}"
    psnr = show.psnr(row, "psnr_db")
    return "" if psnr in (show.NOTHING, "reference") else f"PSNR to baseline {psnr}"


def fastest(data: Data) -> dict[str, Row]:
    ladders = ladder.ladders(ladder.rows(data))
    return {scene: group.loc[group.ms.idxmin()] for scene, group in ladders.items()}


def _answer(best: dict[str, Row]) -> str:
    said = []
    for scene, row in best.items():
        text = f"on {scene} {row.phase} takes {show.interval(row, 'ms')} ms"
        if not math.isnan(row.speedup):
            text += f", {show.interval(row, 'speedup', 3, '×')} baseline's speed"
        said.append(f"{text}, {to_truth(row) or 'error not measured'}")
    if not said:
        return ""
    size = {f"{row.width}×{row.height}" for row in best.values()}
    at = f"At {size.pop()}, " if len(size) == 1 else ""
    text = f"{at}{'; '.join(said)}."
    return text[0].upper() + text[1:]


def _drawings(data: Data, names: tuple[str, ...]) -> dict[str, Drawing]:
    rows = ladder.rows(data)
    return {} if rows.empty else {k: v for k, v in drawings(data, rows).items() if k in names}


def speeds(data: Data) -> Section:
    """The ladder: its main table a scene, open; the others behind their captions."""
    made, file = Found(), data.path / "frames.jsonl"
    with reading(file, f"scripts/stepwise sweep --run {data.path}"):
        all_rows = ladder.rows(data)
        for group in ladder.ladders(all_rows).values():
            rows = group.to_dict("records")
            at = f"{show.picture(rows[0])}:"
            for shown, title in [(columns.MAIN, "speed and error"), *columns.PARTS]:
                main = shown is columns.MAIN
                made.parts += part("", f"{at} {title}", rows, columns.sized(shown, rows), open=main)
        made.answer = _answer(fastest(data))
        if not all_rows.empty:
            exact = [name for name in all_rows.phase.unique() if registry.is_exact(name)]
            verb = "leave" if len(exact) > 1 else "leaves"
            names = " and ".join(filter(None, (", ".join(exact[:-1]), *exact[-1:])))
            made.remarks += [CLOSED.format(f"{names} {verb}")] if exact else []
            made.remarks += [BASES] if all_rows.phase.str.contains("@").any() else []
        made.drawn = _drawings(data, ("speedup-ladder",))
    return made.section("ladder", "Speed and error", file, "sweep")


def sizes(data: Data) -> Section:
    made, file = Found(), data.path / "frames.jsonl"
    with reading(file, f"scripts/stepwise sweep --run {data.path}"):
        rows = ladder.rows(data)
        if not rows.empty:
            made.parts = part("runtime", "All measured sizes", rows.to_dict("records"), columns.RUNTIME)
            made.answer = _against_height(data)
        made.drawn = _drawings(data, ("runtime", "cycles-per-pixel", "ns-per-pixel"))
    return made.section("size", "Runtime against picture height", file, "sweep")


def _against_height(data: Data) -> str:
    """Time per pixel of the fastest phase of the first scene, at the least height and at the largest."""
    rows = ladder.rows(data)
    scene, best = next(iter(fastest(data).items()))
    mine = rows[(rows.scene == scene) & (rows.phase == best.phase) & (rows.threads == best.threads)]
    ends = list(mine.sort_values("height").iloc[[0, -1]].itertuples())
    said = [f"{show.interval(row, 'ns_per_pixel')} ns per pixel at n = {row.height}" for row in ends]
    if ends[0].height == ends[1].height:
        return f"{best.phase} takes {said[0]} on {scene}; no other height was timed."
    return f"{best.phase} takes {said[0]} and {said[1]} on {scene}."


def worked(data: Data) -> Section:
    """Work, lanes and roof of each phase, from counts.json, ceilings.json and the frames."""
    path, made = data.path, Found()
    with reading(f"{path / 'counts.json'} or ceilings.json", f"scripts/stepwise flops --run {path}"):
        declared = flops.read(path / "counts.json").declared
        if declared:
            found, limits, _ = roof.read(path, strict=False)
            points = roof.points(data, found, limits)
            rows = work.rows(ladder.rows(data), declared, points, registry.ladder())
            title = "Time, work, lanes, roof and error, a line a phase"
            made = Found(part("work", title, rows, work.COLUMNS, work.NOTE), _fewer(rows))
            if any(row.evals_per_pixel > 0 for row in rows):
                caption = "Evaluations per pixel of each phase, and its lane efficiency"
                made.drawn["work"] = Drawing(caption, work.NOTE.partition("\n")[0], lambda: _draw(rows))
    return made.section("work", "Work and lanes of each phase", path / "counts.json", "flops")


def _draw(made: Sequence[work.Row]) -> Figure:
    rows = []
    for row in made:
        lanes = row.lane_efficiency
        text = "" if math.isnan(lanes) else f"{100 * lanes:.0f} % of lanes used"
        rows.append(dots.Dot(row.scene, row.phase, row.evals_per_pixel, text=text))
    return dots.draw(rows, "Work of each phase: left is less", "evaluations of a solid per pixel")


def _fewer(made: Sequence[work.Row]) -> str:
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
