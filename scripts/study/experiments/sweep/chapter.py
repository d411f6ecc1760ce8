"""The chapters of a sweep: how fast each phase is and at what error, and its time against picture height."""

import math

from study.core import registry, show
from study.core.show import Row
from study.experiments.section import Part, Section, part, reading
from study.numbers import columns, ladder
from study.numbers.analysis import Data
from study.pictures import ladder as figures
from study.pictures.draw import Drawing

CLOSED = (
    "{} plain sphere tracing: camera rays meet the shapes by closed forms and Newton's steps, but for "
    "Mandelbulbs. What is gained there is another algorithm's."
)
BASES = (
    "“opt2@opt3” is opt2's source built with opt3's flags: it tells the change in the code from the change "
    "of flags."
)


def to_truth(row: Row) -> str:
    """A row's error to ground truth in words, else that to baseline; "" where neither was measured.

    Of a phase that draws the ideal shadow, ground truth is the picture with that shadow.
    """
    found = row.get("truth_own_db")
    if found is not None and not math.isnan(found):
        means = " by 4×4 means" if show.yes(row.get("truth_converged_only")) else ""
        picture = "the ideal picture" if show.yes(row.get("truth_draws_ideal")) else "ground truth"
        return f"{show.number(found)} dB to {picture}{means}"
    psnr = show.psnr(row, "psnr_db")
    return "" if psnr in (show.NOTHING, "reference") else f"PSNR to baseline {psnr}"


def fastest(data: Data) -> dict[str, Row]:
    """Scene → the fastest row of its ladder."""
    ladders = ladder.ladders(ladder.rows(data))
    return {scene: group.loc[group.ms.idxmin()].to_dict() for scene, group in ladders.items()}


def _answer(best: dict[str, Row]) -> str:
    """Of each scene the fastest phase, its gain, its error."""
    said = []
    for scene, row in best.items():
        gain = (
            ""
            if math.isnan(row["speedup"])
            else f", {show.interval(row, 'speedup', 3, '×')} baseline's speed"
        )
        error = to_truth(row)
        said.append(
            f"on {scene} {row['phase']} takes {show.interval(row, 'ms')} ms"
            + gain
            + (f", {error}" if error else ", error not measured")
        )
    if not said:
        return ""
    size = {f"{row['width']}×{row['height']}" for row in best.values()}
    at = f"At {size.pop()}, " if len(size) == 1 else ""
    text = f"{at}{'; '.join(said)}."
    return text[0].upper() + text[1:]


def _drawings(data: Data, names: tuple[str, ...]) -> dict[str, Drawing]:
    rows = ladder.rows(data)
    return {} if rows.empty else {k: v for k, v in figures.drawings(data, rows).items() if k in names}


def speeds(data: Data) -> Section:
    """The ladder: its main table a scene, open; the others behind their captions."""
    parts: list[Part] = []
    remarks: list[str] = []
    with reading(data.path / "frames.jsonl", f"scripts/stepwise sweep --run {data.path}"):
        for scene, group in ladder.ladders(ladder.rows(data)).items():
            rows = group.to_dict("records")
            at = f"{scene}, {rows[0]['width']}×{rows[0]['height']}"
            main = columns.sized(columns.MAIN, rows)
            parts += part("", f"{at}: speed and error", rows, main, open=True)
            for shown, title in columns.PARTS:
                parts += part("", f"{at}: {title}", rows, columns.sized(shown, rows))
        best = fastest(data)
        answer = _answer(best)
        rows = ladder.rows(data)
        if not rows.empty:
            exact = [name for name in rows.phase.unique() if registry.is_exact(name)]
            verb = "leave" if len(exact) > 1 else "leaves"
            names = " and ".join(filter(None, (", ".join(exact[:-1]), *exact[-1:])))
            remarks += [CLOSED.format(f"{names} {verb}")] if exact else []
            remarks += [BASES] if rows.phase.str.contains("@").any() else []
        drawn = _drawings(data, ("speedup-ladder",))
    about = {"file": data.path / "frames.jsonl", "script": "scripts/stepwise sweep", "drawn": drawn}
    return Section("ladder", "Speed and error", "make sweep", parts, remarks, answer=answer, **about)


def sizes(data: Data) -> Section:
    """Time of a frame against picture height."""
    parts: list[Part] = []
    answer = ""
    with reading(data.path / "frames.jsonl", f"scripts/stepwise sweep --run {data.path}"):
        rows = ladder.rows(data)
        if not rows.empty:
            parts = part("runtime", "All measured sizes", rows.to_dict("records"), columns.RUNTIME)
            answer = _against_height(data)
        drawn = _drawings(data, ("runtime", "cycles-per-pixel", "ns-per-pixel"))
    about = {"file": data.path / "frames.jsonl", "script": "scripts/stepwise sweep", "drawn": drawn}
    return Section("size", "Runtime against picture height", "make sweep", parts, answer=answer, **about)


def _against_height(data: Data) -> str:
    """Time per pixel of the fastest phase of the first scene, at the least height and at the largest."""
    rows = ladder.rows(data)
    scene, best = next(iter(fastest(data).items()))
    mine = rows[(rows.scene == scene) & (rows.phase == best["phase"]) & (rows.threads == best["threads"])]
    ends = mine.sort_values("height").iloc[[0, -1]].to_dict("records")
    said = [f"{show.interval(row, 'ns_per_pixel')} ns per pixel at n = {row['height']}" for row in ends]
    if ends[0]["height"] == ends[1]["height"]:
        return f"{best['phase']} takes {said[0]} on {scene}; no other height was timed."
    return f"{best['phase']} takes {said[0]} and {said[1]} on {scene}."
