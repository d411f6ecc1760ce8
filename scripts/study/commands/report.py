"""The report of a run: one HTML page that needs no other file, and its tables and figures beside it."""

from __future__ import annotations

import argparse
import dataclasses
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from study.commands import tables
from study.core import html, registry, show, store, table_files
from study.core.cli import Outcome
from study.experiments import experiment
from study.experiments.section import Section
from study.numbers import analysis, ladder, noise, stats
from study.numbers.analysis import Data
from study.pictures import charts
from study.report import chapters, facts, figures, history_chapter, machines

OUT = registry.ROOT / "report" / "out" / "index.html"
MORE = 6  # the question of a chapter whose place is of no other


def headlines(rows: pd.DataFrame) -> list[dict[str, Any]]:
    """Per scene the fastest phase, with its error."""
    found = []
    for scene, group in ladder.ladders(rows).items():
        best = group.loc[group["ms"].idxmin()].to_dict()
        base = group[group["phase"] == ladder.BASE]["ms"]
        found.append(
            {
                "scene": scene,
                "row": best,
                "ms": show.interval(best, "ms"),
                "base_ms": show.number(base.iloc[0], 4) if len(base) else None,
                "speedup": show.interval(best, "speedup", 3, "×") if len(base) else None,
                "truth": show.number(best.get("truth_own_db")),
                "truth_ideal": show.number(best.get("truth_psnr_ideal_db")),
                "truth_paper": show.number(best.get("truth_psnr_db")),
                "draws_ideal": show.yes(best.get("truth_draws_ideal")),
                "truth_wrong": show.number(best.get("truth_wrong_ppm")),
                "psnr": show.psnr(best, "psnr_db"),
                "over": show.percent(best.get("fraction_over_1_255")),
                "gate": show.gate(best),
                "mark": show.gate_mark(best),
                "fps": show.number(best["frames_per_s"]),
            }
        )
    return found


def asked(data: Data, rows: pd.DataFrame) -> dict[str, list[Section]]:
    """Question → its chapters, both in their order."""
    measured = experiment.placed(data)  # first: it names a broken file
    own = [
        (300, chapters.reproduced(data, rows)),
        (190, history_chapter.over_time(data, rows)),
        (650, chapters.pictures(data)),
        (660, chapters.phases(data)),
        (700, chapters.ran(data)),
        (710, chapters.units()),
    ]
    made: dict[str, list[Section]] = {text: [] for text in experiment.QUESTIONS.values()}
    for place, section in sorted([*measured, *own], key=lambda each: each[0]):
        if section.id == "ladder":
            section = dataclasses.replace(section, chart=machines.chart(data, rows))
        made[experiment.QUESTIONS.get(place // 100, experiment.QUESTIONS[MORE])].append(section)
    return made


def page(data: Data, out: Path, height: int | None = None, running: Sequence[str] = ()) -> str:
    """The page's HTML; tables and figures go beside `out`. `running`: what a study still measures."""
    data = dataclasses.replace(data, height=height) if height else data
    rows = ladder.rows(data)
    questions = asked(data, rows)
    found = [section for some in questions.values() for section in some]
    table_files.write(tables.make(data, rows, found), out.parent / "tables")
    environment = html.templates()
    environment.filters["prose"] = html.prose
    environment.filters["code"] = lambda text: re.fullmatch(r"`([^`]+)`", text)
    folder = out.parent / "figures"
    figures.draw(found, folder, reuse=bool(running))
    drawn = {one.id: figures.figures(one, folder) for one in found}
    images = {one.id: figures.copied(one.images, folder) for one in found}
    told = {
        "run": "/".join(data.path.resolve().parts[-2:]),
        "data": data,
        "running": list(running),
        "questions": questions,
        "headlines": headlines(rows),
        "figures": drawn,
        "images": images,
        "absent": {one.id: figures.absent(one) for one in found},
        "machine": facts.machine(data),
        "remarks": noise.remarks(data.frames, data.cells),
        "commands": facts.commands(data),
        "skipped": facts.skipped(data),
        "phases": chapters.described(data),
        "methods": stats.methods(),
        "left_out": "",
        "vega": charts.scripts() if any(one.chart for one in found) else "",
    }
    template = environment.get_template("index.html.j2")
    text = template.render(told)
    excess = len(text.encode()) - figures.MOST
    if excess > 0:
        room = 1_000  # for the sentence
        told["left_out"] = figures.fewer([drawn[one.id] + images[one.id] for one in found], excess + room)
        text = template.render(told)
    return text


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("run", nargs="?", type=Path, metavar="RUN", help="its folder; default: the newest run")
    add("-o", "--out", type=Path, default=OUT, metavar="PATH", help="default: report/out/index.html")
    add("-n", type=int, metavar="HEIGHT", help="of the ladder's pictures; default: the best measured")
    about = "what a study still measures: the page says so"
    add("--running", nargs="+", default=[], metavar="TEXT", help=about)


def run(args: argparse.Namespace) -> Outcome:
    data = analysis.load(args.run, strict=False)
    text = page(data, args.out, args.n, args.running)
    store.write_text(args.out, text)
    told = {"report": args.out, "bytes": len(text.encode()), "missing": data.notes}
    return Outcome(told, [args.out], data.path, data.notes)
