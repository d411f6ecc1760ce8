"""What a run was held against truth with, as chapters of its page: speed against error, accuracy, hard cases,
functions, compilers. Each is made from its one file; a broken file ends in a StudyError that names it.
"""

from __future__ import annotations

from pathlib import Path

from study import (
    accuracy,
    accuracy_page,
    functions,
    functions_figures,
    functions_page,
    hard_page,
    pareto,
    pareto_page,
    show,
    toolchains,
)
from study.pareto import Row
from study.sections import Section, part, reading
from study.show import Column


def headline(path: Path) -> Section:
    """Speed against error to truth: the figure, the sentences, the fastest at each level."""
    file = path / pareto.FILE
    parts, remarks, images = [], [], {}
    with reading(file, f"scripts/pareto.py --run {path}"):
        result = pareto.read(file)
        if result["rows"]:
            winners, rows = result["winners"], result["rows"]
            caption = "The fastest at a stated nearness to truth; “or”: not told apart from it"
            parts += part("pareto", caption, pareto_page.by_level(winners), pareto_page.LEVELS)
            own = [row for row in rows if row["own_parameters"]]
            caption = "With each scene's own parameters: evaluations per camera ray × ns per each of them"
            parts += part("pareto-own", caption, own, pareto_page.POINTS)
            caption = "The fastest, with its parameters and what it is not told apart from"
            parts += part("pareto-winners", caption, winners, pareto_page.WINNERS, folded=True)
            caption = "Every point of the grid"
            parts += part("pareto-points", caption, rows, pareto_page.POINTS, folded=True)
            remarks = [*pareto.summary(winners, rows), pareto_page.note(result), pareto_page.ABOUT["dt_p99"]]
            captions = {
                "psnr_db": "Speed against error to truth; the front is the line",
                "psnr_ideal_db": "Speed against error to truth with the ideal shadow",
                "false_ppm": "Speed against false hits and misses",
                "dt_p99": "Speed against |Δt|",
            }
            images = {
                path / "figures" / f"{name}.png": captions[measure]
                for measure, name in pareto_page.FIGURES.items()
            }
    return Section("pareto", "Speed against error", "make pareto", parts, remarks, images=images)


def errors(path: Path) -> Section:
    """Every phase against truth, where its bad pixels lie, the Mandelbulb's convergence."""
    file = path / accuracy.FILE
    parts, remarks, images = [], [], {}
    with reading(file, f"scripts/accuracy.py --run {path}"):
        result = accuracy.read(path)
        for name, caption, rows, columns in accuracy_page.tables(result):
            parts += part(name, caption, rows, columns, folded=name in ("accuracy-averaged",))
        if parts:
            remarks = accuracy_page.remarks(result)
            captions = {
                "accuracy-where": "Pixels that are wrong, and where they lie",
                "accuracy-convergence": "The Mandelbulb: precision against hit distance",
            }
            images = {path / "figures" / f"{name}.png": text for name, text in captions.items()}
            images |= {
                path / row["picture"]: f"{row['scene']} by {row['phase']}: where it is wrong"
                for row in result["rows"]
                if row.get("picture") and row["phase"] in ("baseline", "opt4")
            }
    return Section("accuracy", "Error to truth", "make accuracy", parts, remarks, images=images)


def hard(path: Path) -> Section:
    """The table phase × case, and each case behind its title."""
    file = path / "stability.json"
    html = ""
    with reading(file, f"scripts/stability.py --run {path}"):
        if file.exists():
            html = hard_page.section(hard_page.read(file), path / "figures")
    return Section("stability", "Hard cases", "make stability", [], html=html)


def approximations(path: Path) -> Section:
    """Functions: ns against ulp, the normalisation of 20 million vectors, the reciprocal root's tables."""
    file = path / functions.FILE
    parts, remarks, images = [], [], {}
    with reading(file, f"scripts/functions.py --run {path}"):
        if file.exists():
            result = functions.read(path)
            caption = "The front of each function: nothing is faster and nearer"
            parts += part("functions", caption, functions_page.fronts(result), functions_page.ENTRIES)
            vectors = result["normalise"]
            parts += part("normalise", "Vectors normalised", vectors, functions_page.NORMALISE)
            caption = "Approximate reciprocal roots of this CPU: IEEE does not say what they are"
            parts += part("rsqrt", caption, result["rsqrt_tables"], functions_page.TABLES, folded=True)
            caption = "Every implementation"
            parts += part("functions-all", caption, result["entries"], functions_page.ENTRIES, folded=True)
            remarks = [functions_figures.note(result), functions_figures.normalise_note(result)]
            captions = {
                "functions-float": "Floats: ns per element against the largest error",
                "functions-double": "Doubles: ns per element against the largest error",
                "normalise": "Normalising vectors, from the first cache to memory",
            }
            images = {path / "figures" / f"{name}.png": text for name, text in captions.items()}
    return Section(
        "functions", "Functions: speed against ulp", "make functions", parts, remarks, images=images
    )


def _number(name: str):
    return lambda row: show.NOTHING if row.get(name) is None else show.number(row[name])


def _interval(name: str, unit: str = ""):
    def text(row: Row) -> str:
        found = row[name]
        return show.interval(
            {"v": found["value"], "v_low": found["low"], "v_high": found["high"]}, "v", 3, unit
        )

    return text


def _psnr(row: Row) -> str:
    if row["psnr_to_shipped_db"] is not None:
        return show.number(row["psnr_to_shipped_db"])
    return "identical" if row["rmse_to_shipped"] == 0 else "not finite"  # JSON's null is either


CHAINS = [
    Column("", "scene", lambda r: r["scene"]),
    Column("", "phase", lambda r: r["phase"]),
    Column("", "compiler", lambda r: r["compiler"]),
    Column("", "flags", lambda r: r["flags"]),
    Column("", "ms [95 %]", _interval("ms")),
    Column("", "speed over gcc as shipped [95 %]", _interval("speedup", "×")),
    Column("what changes", "pixels with any bit changed", lambda r: show.percent(r["changed_fraction"])),
    Column("what changes", "PSNR to shipped, dB", _psnr),
    Column("error to truth", "PSNR, dB", _number("truth_psnr_db")),
    Column("error to truth", "false hits, ppm", _number("truth_false_hits_ppm")),
    Column("error to truth", "false misses, ppm", _number("truth_false_misses_ppm")),
]
CHAINS_ABOUT = (
    "n = {n}, {launches} interleaved launches, every phase on one thread. Flags come behind the phase's own "
    "(-O3, its -m flags, -ffp-contract=off): “the CPU's -m flags” is -march=native, here {native}; “and "
    "contraction” lets a·b + c round once; “and fast-math” is -ffast-math on top."
)


def compilers(path: Path) -> Section:
    """Compilers and flags: time, pixels that change, error to truth."""
    file = path / "toolchains.json"
    parts, remarks = [], []
    with reading(file, f"scripts/toolchains.py --run {path}"):
        if file.exists():
            result = toolchains.read(file)
            parts = part("toolchains", "Each phase by each compiler and set of flags", result["rows"], CHAINS)
            native = "; ".join(f"{name}: {flags or 'not told'}" for name, flags in result["native"].items())
            remarks = [CHAINS_ABOUT.format(**result | {"native": native})]
            remarks += [
                f"skipped {one.get('compiler') or one['phase']}: {one['reason']}" for one in result["skipped"]
            ]
    return Section("toolchains", "Compilers and flags", "make toolchains", parts, remarks)
