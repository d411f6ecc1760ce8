"""The report of a run: one HTML page that needs no other file. Its tables and figures stand beside it."""

import argparse
import dataclasses
import re
from collections.abc import Sequence
from pathlib import Path

from study.commands import tables
from study.core import html, registry, show, store, table_files
from study.core.cli import Outcome
from study.experiments import cuts
from study.numbers import analysis, ladder, noise, stats
from study.numbers.analysis import Data
from study.pictures import charts
from study.report import chapters, facts, figures, machines

OUT = registry.ROOT / "report" / "out" / "index.html"


def page(data: Data, out: Path, height: int | None = None, running: Sequence[str] = ()) -> str:
    """The page's HTML; tables and figures go beside `out`. `running`: what a study still measures."""
    data = dataclasses.replace(data, height=height) if height else data
    rows = ladder.rows(data)
    questions = chapters.asked(data, rows)
    found = [section for some in questions.values() for section in some]
    table_files.write(tables.make(rows, found), out.parent / "tables")
    ladders = ladder.ladders(rows)
    environment = html.templates()
    environment.filters |= {"prose": html.prose, "code": lambda text: re.fullmatch(r"`([^`]+)`", text)}
    folder = out.parent / "figures"
    figures.draw(found, folder, reuse=bool(running))
    drawn = {one.id: figures.figures(one, folder) for one in found}
    images = {one.id: figures.copied(one.images, folder) for one in found}
    empty = [
        one for one in found if one.lacking and not (one.answer or one.parts or one.html or images[one.id])
    ]
    told = {
        "run": "/".join(data.path.resolve().parts[-2:]),
        "data": data,
        "running": list(running),
        "questions": {text: [one for one in some if one not in empty] for text, some in questions.items()},
        "empty": empty,
        "fastest": [group.loc[group.ms.idxmin()].to_dict() for group in ladders.values()],
        "base_ms": {s: of[of.phase == ladder.BASE].ms.to_list() for s, of in ladders.items()},
        "show": show,
        "chart": machines.chart(data, rows),
        "figures": drawn,
        "images": images,
        "absent": {one.id: figures.absent(one) for one in found},
        "machine": facts.machine(data),
        "remarks": noise.remarks(data.frames, data.cells),
        "commands": facts.commands(data),
        "skipped": facts.skipped(data),
        "cuts": [(one.title, one.cut) for one in found if one.cut and one.answer],
        "said": cuts.remarks(data.path),
        "phases": chapters.described(data),
        "methods": stats.methods(),
        "viewer": next((one.html for one in found if one.id == "pictures"), ""),
    }
    told["vega"] = charts.scripts() if told["chart"] or any(one.chart for one in found) else ""
    template = environment.get_template("index.html.j2")
    text = template.render(told)
    excess = len(text.encode()) - figures.MOST
    if excess > 0:
        figures.fewer([drawn[one.id] + images[one.id] for one in found], excess)
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
    data = analysis.load(args.run)
    text = page(data, args.out, args.n, args.running)
    store.write_text(args.out, text)
    told = {"report": args.out, "bytes": len(text.encode()), "missing": data.notes}
    return Outcome(told, [args.out], data.path, data.notes)
