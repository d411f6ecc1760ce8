"""The report of a run: one HTML page that needs no other file, and its tables and figures beside it."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from study.commands import tables
from study.core import cli, html, registry, show, store, table_files
from study.experiments import experiment
from study.experiments.section import Section
from study.numbers import analysis, ladder, stats
from study.numbers.analysis import Data
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
        "ladders": machines.script(data, rows),
        "figures": drawn,
        "images": images,
        "absent": {one.id: figures.absent(one) for one in found},
        "machine": facts.machine(data),
        "remarks": analysis.noise(data)["remarks"],
        "commands": facts.commands(data),
        "skipped": facts.skipped(data),
        "phases": chapters.described(data),
        "methods": {"median": stats.MEDIAN.text(), "ratio": stats.RATIO.text()},
        "left_out": "",
    }
    template = environment.get_template("index.html.j2")
    text = template.render(told)
    excess = len(text.encode()) - figures.MOST
    if excess > 0:
        room = 1_000  # for the sentence
        told["left_out"] = figures.fewer([drawn[one.id] + images[one.id] for one in found], excess + room)
        text = template.render(told)
    return text


def main() -> int:
    parser = cli.parser(__doc__)
    parser.add_argument(
        "run", nargs="?", type=Path, metavar="RUN", help="its folder; default: the newest run"
    )
    parser.add_argument(
        "-o", "--out", type=Path, default=OUT, metavar="PATH", help="default: report/out/index.html"
    )
    parser.add_argument(
        "-n", type=int, metavar="HEIGHT", help="of the ladder's pictures; default: the best measured"
    )
    about = "what a study still measures: the page says so"
    parser.add_argument("--running", nargs="+", default=[], metavar="TEXT", help=about)
    args = parser.parse_args()
    data = analysis.load(args.run, strict=False)
    html = page(data, args.out, args.n, args.running)
    store.write_text(args.out, html)
    for note in data.notes:
        cli.say(note)
    if args.json:
        cli.emit({"report": args.out, "bytes": len(html.encode()), "missing": data.notes}, data.path)
    else:
        print(args.out)
    return cli.OK
