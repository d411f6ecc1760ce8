"""What was counted for a run, as tables for its page and its folder: FLOPs, roofline, hotspots, single
steps. A file that is broken ends in a StudyError that names it and its script, never in a traceback.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from study.bounds import roof
from study.core import show
from study.core.cli import StudyError
from study.core.show import Column, Row, Table
from study.counting import flops, libm
from study.experiments.ablations import ideas
from study.experiments.ablations import measure as ablations
from study.experiments.flops import table1
from study.experiments.hotspots import bounds_tables as bounds_page
from study.experiments.hotspots import tables as hotspots
from study.experiments.roofline import tables as roof_tables
from study.numbers.analysis import BROKEN, Data
from study.pictures.draw import Drawing
from study.report import columns


@dataclass(frozen=True)
class Part:
    """A table. `name` is its file's; `folded`: behind a summary on the page; `foot`: what stands under it,
    on the page and in its Markdown file."""

    name: str
    caption: str
    rows: list[Row]
    table: Table
    folded: bool = False
    foot: str = ""

    @property
    def frame(self) -> pd.DataFrame:
        return pd.DataFrame(self.rows)

    @property
    def markdown(self) -> str:
        return show.markdown(self.table) + (f"\n{self.foot}\n" if self.foot else "")


@dataclass(frozen=True)
class Section:
    """A chapter of the page. `lacking`: the command that would fill it, where there is nothing; `remarks`:
    how to read the tables, and what was left out; `details`: more of that, behind a summary; `figures`: names
    of the plots that belong above them; `drawn`: file names and figures made from `file` by `script`.
    """

    id: str
    title: str
    lacking: str
    parts: list[Part]
    remarks: list[str] = field(default_factory=list)
    details: list[str] = field(default_factory=list)
    figures: Sequence[str] = ()
    file: Path | None = None
    script: str = ""
    drawn: dict[str, Drawing] = field(default_factory=dict)
    images: dict[Path, str] = field(default_factory=dict)  # pictures, which no figure replaces; captions
    html: str = ""  # a fragment of its own, in place of tables


@contextlib.contextmanager
def reading(file: Path | str, script: str) -> Iterator[None]:
    """Whatever the content of `file` makes fail becomes a StudyError: the file, why, and who writes it."""
    try:
        yield
    except StudyError as error:
        if "scripts/" in str(error):
            raise
        raise StudyError(f"{error}; remove it and make it again with {script}", error.exit_status) from None
    except BROKEN as error:
        name = script.partition(" ")[0]
        raise StudyError(
            f"{file}: not what {name} writes ({error!r}); remove it and make it again with {script}"
        ) from error


def part(
    name: str,
    caption: str,
    rows: Sequence[Row],
    shown: Sequence[Column],
    folded: bool = False,
    foot: str = "",
) -> list[Part]:
    rows = list(rows)
    if not rows:
        return []
    made = Part(name, caption, rows, show.table(rows, shown), folded, foot)
    _ = made.markdown  # here, where a cell that is no text is still known to be the file's
    return [made]


CONVENTIONS = (
    "Two conventions. The paper's: one FLOP for each addition, multiplication, division, root, and for each "
    "call of math.h. The machine's, which hardware and emulators count: the same without the calls (an FMA "
    "is two, a minimum or maximum one), libm's inside apart. Comparisons are FLOPs in neither. All lanes are "
    "counted; the useful share is that of lanes whose ray is still under way."
)
RULE = (
    "Table 1 is judged by the paper's rule: calls of each function times the FLOPs of that function, by the "
    "paper's convention. A call of the Mandelbulb's distance then has all of its iterations; “as entered” "
    "counts those that were entered. The rule says nothing of a phase that evaluates a Mandelbulb in pieces."
)
VALIDATION = (
    "Declared: costs.def, derived by hand from the source and committed before it was first compared, times "
    "the calls that the counting build makes. Measured: by {backends}. “The compiler's doing, known”: "
    "phases/NAME/residues.def, where the compiled code does otherwise than the source says; what is left is "
    "judged. Functions under 0.1 % of the picture are not shown. This is the machine's convention; the calls "
    "of math.h that the paper's adds are held against the calls into libm. fabs and floor are instructions "
    "there: they, and the comparisons, are as the source has them and not measured."
)
GENERAL = (
    "{phases}: counted is the general code, with no kernel generated for the scene (STEPWISE_CC=none). A "
    "kernel does the same operations but for products with 0 and 1, and for highlights, where it has no "
    "logarithm."
)
# How each back end comes by its figure, beside its name.
MEANS = {
    "blocks": "every basic block that was executed, decoded",
    "qemu": "every block that the emulator executed, decoded",
    "sde": "Intel's emulator, by instruction",
    "pmu": "the CPU's own counters",
}
HEIGHT = 720  # of the paper's pictures


def _pictures(stated: Iterable[Row]) -> list[Row]:
    """Per scene and phase the picture of the paper's height, else the largest. Flags change no FLOP."""
    best: dict[tuple, Row] = {}
    for one in stated:
        which = one["scene"], one["phase"]
        if one["flags_from"] != one["phase"]:
            continue
        rank = [(row["height"] == HEIGHT, row["height"]) for row in (one, best.get(which, one))]
        if which not in best or rank[0] > rank[1]:
            best[which] = one
    return list(best.values())


def _said(rows: Sequence[Row], calls: Sequence[Row], math: Sequence[Row] = ()) -> list[str]:
    """How to read the validation, by the back ends that were there: each has its own sums."""
    names = dict.fromkeys(row["backend"] for row in rows)
    told = "; ".join(f"{name} ({MEANS[name]})" if name in MEANS else name for name in names)
    said = [VALIDATION.format(backends=told)] if names else []
    for name in names:
        equal = [row["within"] for row in calls if row["backend"] == name]
        if equal:
            said.append(f"Calls by name, counting build against {name}: {sum(equal)} of {len(equal)} equal.")
        into = [row["within"] for row in math if row["backend"] == name]
        if into:
            said.append(
                f"Calls of math.h, declared against calls into libm by {name}, in all and by function: "
                f"{sum(into)} of {len(into)} within 1\u00a0%."
            )
    return said


def counted(path: Path) -> Section:
    """Table 1, what its difference from the paper's is made of, and the validation."""
    remarks, parts = [], []
    file = path / "counts.json"
    with reading(file, f"scripts/flops.py --run {path}"):
        first = _pictures(flops.read(file)[0])
        remarks += [CONVENTIONS, RULE] if first else []
        general = dict.fromkeys(one["phase"] for one in first if one.get("kernel"))
        remarks += [GENERAL.format(phases=", ".join(general))] if general else []
        parts += part("table1", "Table 1: FLOPs of a picture", table1.rows(first), columns.TABLE1)
        parts += part(
            "table1-readings",
            "Table 1 by the paper's rule, and by others: baseline's FLOPs. The paper's text states the rule; "
            "its sheet with the FLOPs of each function is not public",
            table1.readings(first),
            columns.READINGS,
        )
        parts += part("table1-terms", "Where the FLOPs are", table1.terms(first), columns.TERMS, folded=True)
    file = path / "validation.json"
    with reading(file, f"scripts/flops.py --validate --run {path}"):
        rows = flops.read_validation(file)
        judged = table1.by_scene(r for r in rows if r["judged"])
        calls = [r for r in judged if r["scope"].startswith("calls of")]
        math = [r for r in judged if r["scope"].startswith(libm.MATH)]
        judged = [r for r in judged if not r["scope"].startswith(("calls of", libm.MATH))]
        totals = [r for r in judged if r["scope"] == "total"]
        remarks += _said([r for r in rows if not r["scope"].startswith(libm.MATH)], calls, math)
        caption = "Declared against measured, whole pictures"
        parts += part("validation", caption, totals, columns.VALIDATION)
        caption = "Declared against measured, by function"
        parts += part("validation-functions", caption, judged, columns.VALIDATION, folded=True)
    return Section("flops", "FLOPs: declared, counted, measured", "make flops", parts, remarks)


def roofline(data: Data) -> Section:
    """Ceilings, Tables 5 and 6, the share of each roof."""
    parts: list[Part] = []
    both = f"{data.path / 'counts.json'} or ceilings.json"
    with reading(both, f"scripts/flops.py --run {data.path} or scripts/ceilings.py --run {data.path}"):
        found, limits, notes = roof.read(data.path, strict=False)
        table = roof.rows(data, found, limits)
        notes = [*roof.remarks(table), *roof_tables.of_roofs(roof.headline(table), limits), *notes]
        if not table.empty:
            for name, title in (
                ("table5", "Table 5: performance of baseline"),
                ("table6", "Table 6: of the optimised phases"),
            ):
                rows = table[table["section"] == name].to_dict("records")
                parts += part(name, title, rows, roof_tables.PERFORMANCE)
            if limits:
                caption = "Share of each roof, at the largest size that was timed and counted"
                parts += part(
                    "roofline", caption, roof.headline(table).to_dict("records"), roof_tables.POINTS
                )
        if limits:
            if table.empty and (other := roof.foreign(data, limits)):
                notes.append(other)
            caption = "What one core does at best: flop per core cycle, best sample and median"
            parts += part(
                "ceilings", caption, roof_tables.grid(limits, "precision"), roof_tables.COMPUTE, folded=True
            )
            caption = "Bandwidth as the core sees it: bytes per core cycle, best sample and median"
            parts += part(
                "bandwidth", caption, roof_tables.grid(limits, "level"), roof_tables.BANDWIDTH, folded=True
            )
    return Section(
        "roofline",
        "Roofline",
        "make roofline",
        parts,
        notes if parts else [],
        figures=("roofline", "performance"),
    )


HOTSPOTS = {
    "baseline": "Table 2a: where the time of baseline goes",
    "opt1": "Table 2b: where the time of opt1 goes",
    "opt2": "Table 4a: where the time of opt2 goes",
    "opt3": "Table 4b: where the time of opt3 goes",
}


def hot(path: Path, microarchitecture: str | None = None) -> Section:
    """Tables 2 and 4 (functions) and 3 (what bounds them). `microarchitecture`: of the run's CPU."""
    file = path / "hotspots.json"
    parts, remarks, details = [], [], []
    with reading(file, f"scripts/hotspots.py --run {path}"):
        record = hotspots.read(file)
        rows = hotspots.table_rows(record, widest=hotspots.core_width(microarchitecture))
        for phase in dict.fromkeys(row["phase"] for row in rows):
            mine = [row for row in rows if row["phase"] == phase]
            title = HOTSPOTS.get(phase, f"The same of {phase}")
            folded = phase not in ("baseline", "opt3")
            parts += part(f"hotspots-{phase}", title, mine, hotspots.COLUMNS, folded)
        split = bounds_page.rows(record) if record.get("bounds") else []
        caption = "Table 3: what the cycles went to, structs against arrays"
        parts += part("table3", caption, split, bounds_page.COLUMNS)
        caption = "The hot regions under the model"
        parts += part(
            "table3-regions", caption, bounds_page.region_rows(record), bounds_page.REGIONS, folded=True
        )
        if rows:
            remarks = [hotspots.ABOUT, *([bounds_page.ABOUT] if split else [])]
            details = hotspots.notes(record)
    return Section("hotspots", "Hotspots, and what bounds them", "make hotspots", parts, remarks, details)


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
    Column("", "scene", lambda r: r["scene"]),
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
    Column("", "scene", lambda r: r["scene"]),
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
    with reading(file, f"scripts/ablations.py --ideas --run {path}"):
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
    with reading(file, f"scripts/ablations.py --run {path}"):
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
