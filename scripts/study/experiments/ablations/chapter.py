"""The chapter of single steps, put in or taken out, and of the ideas of each phase."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from matplotlib.figure import Figure

from study.core import show
from study.core.show import Column, Row
from study.experiments.ablations import ideas
from study.experiments.ablations import measure as ablations
from study.experiments.section import Part, Section, part, reading
from study.pictures import dots
from study.pictures.draw import Drawing

_gain = show.spread_of("gain", "×")


def _psnr(name: str) -> Callable[[Row], str]:
    """Of a step's picture: no number stands for an infinite one in JSON."""
    return lambda row: "identical" if row[name] is None else show.number(row[name])


STEPS = [
    Column("", "step", lambda r: r["ablation"]),
    Column("", "added or removed", lambda r: r["step"]),
    Column("", "against", lambda r: r["against"]),
    Column("", "scene", show.picture),
    Column("", "the step's gain [95\u00a0%]", _gain),
    Column("", "the paper", lambda r: r["paper"].partition(" (")[0]),
    Column("", "the paper's claim", ablations.said),
    Column("", "FLOPs with it over without", show.plain("flops_ratio", 3)),
    Column("error against baseline", "PSNR linear, dB", _psnr("psnr_db")),
    Column("error against baseline", "of what it is compared with", _psnr("against_psnr_db")),
    Column("error against baseline", "pixels off > 1/255", lambda r: show.percent(r["fraction_over_1_255"])),
    Column("", "tolerance", lambda r: r["verdict"], lambda r: "bad" if r["verdict"] == "OUTSIDE" else ""),
    Column("", "what", lambda r: r["what"]),
]


STEPS_ABOUT = (
    "n = {n}, {launches} launches of one frame on one thread, interleaved. A step is a patch of its phase "
    "(phases/NAME/ablations). The gain is the step's, whichever side has it."
)


IDEAS = [
    Column("", "idea", lambda r: r["idea"]),
    Column("", "taken out of", lambda r: r["against"]),
    Column("", "scene", show.picture),
    Column("", "gain of the idea [95\u00a0%]", _gain),
    Column("picture without the idea", "PSNR to the phase's own, dB", ideas.change),
    Column("picture without the idea", "largest difference", show.plain("change_max_abs", 2)),
    Column("error of the phase and without the idea", "against", lambda r: r["reference"]),
    Column("error of the phase and without the idea", "PSNR of the phase, dB", _psnr("against_psnr_db")),
    Column("error of the phase and without the idea", "without the idea", _psnr("psnr_db")),
    Column("", "lines", lambda r: str(r["lines"])),
    Column("", "tolerance", lambda r: r["verdict"], lambda r: "bad" if r["verdict"] == "OUTSIDE" else ""),
    Column("", "without the idea", lambda r: r["what"]),
]


IDEAS_ABOUT = (
    "n = {n}, {launches} launches of one frame on one thread, interleaved. A patch takes the idea out.\n"
    "The gains of a phase's ideas do not multiply to the phase's own, for they share work.\n"
    "Lines: of the code that holds the idea, or of the patch where it is a constant or a condition."
)


def _drawing(result: Row, name: str, title: str, about: str) -> Drawing:
    """A dot for each gain. `name`: the column that says what gains."""

    def make() -> Figure:
        rows = [
            dots.of(row["gain"], row["scene"], f"{row[name]} ({row['against']})", _changed(row), True)
            for row in result["rows"]
        ]
        return dots.draw(rows, title, "time without it over time with it", True)

    return Drawing(title, about.replace("\n", " "), make)


def _changed(row: Row) -> str:
    """PSNR to baseline before and after, where it changes."""
    before, after = _psnr("against_psnr_db")(row), _psnr("psnr_db")(row)
    return "" if before == after else f"{before} → {after} dB"


def _answer(rows: list[Row], name: str, kind: str) -> str:
    """The largest gain, and how many are gains by their whole interval."""
    able = [row for row in rows if row["gain"]["low"] is not None]
    if not able:
        return ""
    best = max(able, key=lambda row: row["gain"]["value"])
    some = sum(row["gain"]["low"] > 1 for row in able)
    return (
        f"The largest gain of a single {kind} is {_gain(best)}: “{best[name]}” against {best['against']} on "
        f"{best['scene']}; {some} of {len(able)} {kind}s and scenes gain by their whole interval."
    )


def _left_out(result: Row) -> str:
    return "\n".join(
        f"not measured: {one['ablation']}: {one['reason']}"
        for one in [*result["skipped"], *result["failures"]]
    )


TABLES = (  # file, command, column of what gains, what that is, caption, columns, how to read them
    (
        ideas.FILE,
        "ideas",
        *("idea", "idea", "Each idea alone, against its phase without it", IDEAS, IDEAS_ABOUT),
    ),
    (
        "ablations.json",
        "ablations",
        *("ablation", "step", "Each step alone, against the code without it", STEPS, STEPS_ABOUT),
    ),
)


def steps(path: Path) -> Section:
    """The ablations: single steps put in or taken out, then the ideas of each phase."""
    parts: list[Part] = []
    said: list[str] = []
    drawn: dict[str, Drawing] = {}
    for file, script, name, kind, caption, shown, about in TABLES:
        with reading(path / file, f"scripts/stepwise {script} --run {path}"):
            result = ablations.read(path / file)
            rows = result["rows"]
            if not rows:
                continue
            note = about.format(**result)
            stem = file.removesuffix(".json")
            parts += part(stem, caption, rows, shown, f"{note}\n{_left_out(result)}".strip())
            said.append(_answer(rows, name, kind))
            drawn[stem] = _drawing(
                result, name, f"What each {kind} gains, and the PSNR that it changes", note
            )
    about_it = {"file": path / "ablations.json", "script": "scripts/stepwise ablations", "drawn": drawn}
    title = "What single steps are worth"
    return Section("ablations", title, "make ablations", parts, answer=" ".join(said), **about_it)
