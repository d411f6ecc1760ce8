"""What a run was held against truth with, as chapters of its page: speed against error, accuracy, hard cases,
functions, growth of cost, compilers. Each is made from its one file; a broken file ends in a StudyError that
names it.
"""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

from study.core import show
from study.core.show import Column
from study.experiments.accuracy import measure as accuracy
from study.experiments.accuracy import tables as accuracy_page
from study.experiments.drjit import measure as drjit_measure
from study.experiments.drjit import tables as drjit_page
from study.experiments.frames import measure as frames
from study.experiments.frames import tables as frames_page
from study.experiments.functions import edge_tables as functions_edges_page
from study.experiments.functions import figures as functions_figures
from study.experiments.functions import measure as functions
from study.experiments.functions import tables as functions_page
from study.experiments.pareto import fronts as pareto
from study.experiments.pareto import tables as pareto_page
from study.experiments.pareto.fronts import Row
from study.experiments.scaling import figures as scaling_page
from study.experiments.scaling import measure as scaling
from study.experiments.scaling import tables as scaling_tables
from study.experiments.stability import tables as hard_page
from study.experiments.toolchains import measure as toolchains
from study.experiments.views import figures as views_page
from study.experiments.views import measure as views_measure
from study.experiments.views import tables as views_tables
from study.pictures.draw import Drawing
from study.report.sections import Section, part, reading

SPEED = {  # captions
    "psnr_db": "Speed against error to truth; the front is the line",
    "psnr_ideal_db": "Speed against error to truth with the ideal shadow",
    "false_ppm": "Speed against false hits and misses",
    "dt_p99": "Speed against |Δt|",
}


def headline(path: Path) -> Section:
    """Speed against error to truth: the figure, the sentences, the fastest at each level."""
    file = path / pareto.FILE
    parts, remarks, drawn = [], [], {}
    with reading(file, f"scripts/pareto.py --run {path}"):
        result = pareto.read(file)
        if result["rows"]:
            winners, rows = result["winners"], result["rows"]
            caption = "The fastest at a stated nearness to truth; “or”: not told apart from it"
            parts += part("pareto", caption, pareto_page.by_level(winners), pareto_page.LEVELS)
            own = [row for row in rows if row["own_parameters"]]
            caption = "With each scene's own parameters: evaluations per pixel × ns per evaluation"
            parts += part("pareto-own", caption, own, pareto_page.POINTS)
            caption = "The fastest, with its parameters and what it is not told apart from"
            parts += part("pareto-winners", caption, winners, pareto_page.WINNERS, folded=True)
            caption = "Every point of the grid"
            parts += part("pareto-points", caption, rows, pareto_page.POINTS, folded=True)
            remarks = [*pareto.summary(winners, rows), pareto_page.note(result), pareto_page.ABOUT["dt_p99"]]
            for measure, name in pareto_page.FIGURES.items():
                able = [row for row in rows if not math.isnan(pareto.badness(row, measure))]
                if able:
                    draw = partial(pareto_page.figure, able, measure)
                    drawn[name] = Drawing(SPEED[measure], pareto_page.note(result, measure), draw)
    about = {"file": file, "script": "scripts/pareto.py", "drawn": drawn}
    return Section("pareto", "Speed against error", "make pareto", parts, remarks, **about)


def _again(result: Row) -> str:
    """The command that renders the pictures of these rows again."""
    scenes = " ".join(dict.fromkeys(row["scene"] for row in result["rows"]))
    more = " --convergence" if result.get("convergence") else ""
    sizes = " ".join(dict.fromkeys(str(row["height"]) for row in result["rows"]))
    return f"scripts/accuracy.py --scene {scenes} -n {sizes}{more}"


def errors(path: Path) -> Section:
    """Every phase against truth, where its bad pixels lie, the Mandelbulb's convergence."""
    file = path / accuracy.FILE
    parts, remarks, images, drawn, script = [], [], {}, {}, "scripts/accuracy.py"
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
            note = accuracy_page.note(result)
            drawn = {
                name: Drawing(captions[name], note, draw)
                for name, draw in accuracy_page.drawings(result).items()
            }
            script = _again(result)
            images = {
                path / row["picture"]: f"{row['scene']} by {row['phase']}: where it is wrong"
                for row in result["rows"]
                if row.get("picture") and row["phase"] in ("baseline", "opt4")
            }
    about = {"file": file, "script": script, "drawn": drawn, "images": images}
    return Section("accuracy", "Error to truth", "make accuracy", parts, remarks, **about)


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
    parts, remarks, drawn = [], [], {}
    with reading(file, f"scripts/functions.py --run {path}"):
        if file.exists():
            result = functions.read(path)
            caption = "The fronts of each function: nothing is nearer and faster, by throughput or by latency"
            parts += part("functions", caption, functions_page.fronts(result), functions_page.ON_FRONTS)
            for name, of in functions_edges_page.TABLES.items():
                rows = functions_edges_page.rows(result, of)
                caption = functions_edges_page.caption(result, of)
                parts += part(name, caption, rows, functions_edges_page.columns(rows))
            vectors = result["normalise"]
            parts += part("normalise", "Vectors normalised", vectors, functions_page.NORMALISE)
            caption = "Approximate reciprocal roots, by CPU: IEEE does not say what they are"
            parts += part("rsqrt", caption, functions_page.tables(result), functions_page.TABLES, folded=True)
            caption = "What each function is tried and timed on"
            parts += part(
                "functions-targets", caption, result["targets"], functions_page.TARGETS, folded=True
            )
            caption = "Every implementation"
            parts += part("functions-all", caption, result["entries"], functions_page.ENTRIES, folded=True)
            remarks = [functions_edges_page.remark(result), functions_figures.note(result)]
            remarks += [functions_figures.normalise_note(result)] if vectors else []
            drawn = functions_figures.drawings(result)
    about = {"file": file, "script": "scripts/functions.py", "drawn": drawn}
    remarks = [remark for remark in remarks if remark]
    return Section("functions", "Functions: speed against ulp", "make functions", parts, remarks, **about)


def growth(path: Path) -> Section:
    """How cost grows: exponents beside the paper's law, the two goals, the generated scenes."""
    file = path / scaling.FILE
    parts, remarks, images = [], [], {}
    with reading(file, f"scripts/scaling.py --run {path}"):
        result = scaling.read(file)
        if result["rows"]:
            for name, caption, rows, columns, folded in scaling_tables.tables(result):
                parts += part(name, caption, rows, columns, folded=folded)
            remarks = [text for text in (scaling_page.without(result), scaling_page.note(result)) if text]
            captions = {
                "scaling-time": "Time of a frame against what it depends on, with fitted power laws",
                "scaling-evals": "Evaluations of a camera ray's march against the same",
                "scaling-error": "Error against the same",
                "scaling-scenes": "The generated scenes: the same share of the picture covered by any number",
            }
            images = {path / "figures" / f"{name}.png": text for name, text in captions.items()}
    return Section("scaling", "How cost grows", "make scaling", parts, remarks, images=images)


def elsewhere(path: Path) -> Section:
    """Each rung against its parent on further views: where constants were tuned, and everywhere else."""
    file = path / views_measure.FILE
    parts, remarks, images = [], [], {}
    with reading(file, f"scripts/views.py --run {path}"):
        result = views_measure.read(file)
        if result["rows"]:
            for name, caption, rows, columns, folded in views_tables.tables(result):
                parts += part(name, caption, rows, columns, folded=folded)
            remarks = [views_page.note(result)]
            captions = {
                views_page.RATIOS: "Gain of each rung over its parent on every view",
                views_page.SHEET: "The views: each scene's own and three further ones",
            }
            images = {path / "figures" / f"{name}.png": text for name, text in captions.items()}
    return Section("views", "Views it was not tuned on", "make views", parts, remarks, images=images)


def rates(path: Path) -> Section:
    """Frames a second, presenting included, against the two goals."""
    file = path / frames.FILE
    parts, remarks, drawn = [], [], {}
    with reading(file, f"scripts/frames.py --run {path}"):
        result = frames.read(file)
        if result["rows"]:
            for name, caption, rows, columns, folded in frames_page.tables(result):
                parts += part(name, caption, rows, columns, folded=folded)
            remarks, drawn = [frames_page.note(result)], frames_page.drawings(result)
    about = {"file": file, "script": "scripts/frames.py", "drawn": drawn}
    return Section("frames", "Frame rates", "make frames", parts, remarks, **about)


def rival(path: Path) -> Section:
    """Our phases beside Dr.Jit on the same machine."""
    file = path / drjit_measure.FILE
    parts, remarks = [], []
    with reading(file, f"scripts/drjit.py --run {path}"):
        result = drjit_measure.read(file)
        if result["rows"]:
            caption = "Our phases and Dr.Jit on the same scenes"
            parts = part("drjit", caption, result["rows"], drjit_page.COLUMNS)
            remarks = [drjit_page.note(result)]
    return Section("drjit", "Beside Dr.Jit", "make drjit", parts, remarks)


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
