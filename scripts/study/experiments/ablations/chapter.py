"""The chapter of single steps, put in or taken out, and of the ideas of each phase."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from study.core import show
from study.core.show import Column, Row
from study.experiments.ablations import ideas
from study.experiments.ablations import measure as ablations
from study.experiments.section import Part, Section, part, reading


def _gain(row: Row) -> str:
    gain = row["gain"]
    ends = {f"gain_{end}": gain[end] for end in ("low", "high")}
    return show.interval({"gain": gain["value"], **ends}, "gain", 3, "×")


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
    "n = {n}, {launches} launches of one frame on one thread, interleaved with what each is compared with. A "
    "step is a patch kept with its phase (phases/NAME/ablations). The gain is the step's, whichever side has "
    "it."
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
    "Ideas: n = {n}, {launches} launches of one frame on one thread, interleaved. Each idea is taken out of "
    "its phase by a patch. The gains of a phase's ideas do not multiply to the phase's own, for they share "
    "work. Lines: of the code that holds the idea, or of the patch where the idea is a constant or a "
    "condition. A phase that is held to ground truth alone is the reference of its own ablations."
)


def _ideas(path: Path) -> tuple[list[Part], list[str]]:
    """Of a run's ideas.json: the table and how to read it."""
    file = path / ideas.FILE
    parts, remarks = [], []
    with reading(file, f"scripts/stepwise ablations --ideas --run {path}"):
        result = ablations.read(file)
        rows = result["rows"]
        if rows:
            left_out = [*result["skipped"], *result["failures"]]
            remarks = [IDEAS_ABOUT.format(**result)]
            remarks += [f"not measured: {one['ablation']}: {one['reason']}" for one in left_out]
        parts = part("ideas", "Each idea alone, against its phase without it", rows, IDEAS)
    return parts, remarks


def steps(path: Path) -> Section:
    """The ablations: single steps put in or taken out."""
    file = path / "ablations.json"
    remarks, parts = [], []
    with reading(file, f"scripts/stepwise ablations --run {path}"):
        result = ablations.read(file)
        rows = result["rows"]
        if rows:
            left_out = [*result["skipped"], *result["failures"]]
            remarks = [STEPS_ABOUT.format(**result)]
            remarks += [f"not measured: {one['ablation']}: {one['reason']}" for one in left_out]
        parts = part("ablations", "Each step alone, against the code without it", rows, STEPS)
    more, about = _ideas(path)
    return Section(
        "ablations", "What single steps are worth", "make hotspots", [*parts, *more], [*remarks, *about]
    )
