"""The report of a run: one HTML page that needs no other file, and its tables and figures beside it."""

from __future__ import annotations

import base64
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2
import markdown_it
import matplotlib
import pandas as pd

from study.bounds import roof
from study.commands import tables
from study.core import cli, registry, show, store, table_files
from study.core.cli import StudyError
from study.experiments import experiment
from study.experiments.roofline import figures as roofline_figures
from study.experiments.section import Section, reading
from study.experiments.sweep import columns as sweep_columns
from study.experiments.sweep import figures as sweep_figures
from study.experiments.sweep import ladder
from study.experiments.verify import columns as verify_columns
from study.numbers import analysis, paper, stats
from study.numbers.analysis import Data
from study.pictures import draw
from study.report import facts, lessons

TEMPLATES = registry.ROOT / "report" / "templates"
OUT = registry.ROOT / "report" / "out" / "index.html"
MIME = {".png": "image/png", ".svg": "image/svg+xml"}
PICTURES = {  # of stepwise pictures
    "contact-sheet.png": "Every scene by every phase, with its error against baseline",
    "evaluations.png": "Distance evaluations of each camera ray of baseline: where the time goes",
}
FIGURES = {
    "speedup-ladder": "Speed-up over baseline, the paper's own values as marks, the error beside each bar",
    "runtime": "Runtime of a frame against picture height n, one line per phase (the paper's Fig. 7 in form)",
    "cycles-per-pixel": "Core cycles per pixel against picture height n",
    "ns-per-pixel": "Nanoseconds per pixel against picture height n",
    "speed-against-error": "Nanoseconds per pixel against PSNR to baseline",
}


def data_uri(path: Path) -> str:
    """The file inside the page. Raises StudyError if it cannot be read."""
    try:
        return f"data:{MIME[path.suffix]};base64,{base64.b64encode(path.read_bytes()).decode()}"
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror}") from None


def notes_html(text: str) -> str:
    """A phase's NOTES.md as HTML below the page's own headings; neither HTML nor pictures pass through, and
    a link to a file of the project is its words alone."""
    text = re.sub(r"^!\[[^\]]*\]\([^)]*\)$", "", text, flags=re.MULTILINE)
    text = re.sub(r"\[([^\]]*)\]\((?![a-z]+://)[^)]*\)", r"\1", text)
    markdown = markdown_it.MarkdownIt("commonmark", {"html": False}).enable("table").disable("image")
    tokens = markdown.parse(text)
    for token in tokens:
        if token.type in ("heading_open", "heading_close"):
            token.tag = f"h{min(int(token.tag[1]) + 3, 6)}"
    return markdown.renderer.render(tokens, markdown.options, {})


def phases(data: Data) -> list[dict[str, Any]]:
    """What each phase of the run is, as recorded with it, with its NOTES.md and their figure as they are now.
    Of one that is built for several numbers of lanes, what ran: lanes, instruction sets, flags.
    """
    about = analysis.described(data.plan)
    if not about:
        measured = {cell.spec.partition("@")[0] for cell in data.cells}
        about = {name: vars(phase) for name, phase in registry.phases().items() if name in measured}
    ran = {cell.spec: cell.facts for cell in data.cells}
    made = []
    for name, phase in about.items():
        if phase.get("variants") and name in ran:
            own = ran[name]
            phase = {
                **phase,
                "lanes": int(own["lanes"]),
                "isa": own["isa"].split("+"),
                "cflags": own["flags"],
            }
        file = registry.ROOT / "phases" / name / "NOTES.md"
        notes = notes_html(file.read_text(encoding="utf-8")) if file.is_file() else None
        figure = file.with_name(lessons.NAME)
        lesson = data_uri(figure) if notes and figure.is_file() else None
        made.append({**phase, "notes": notes, "lesson": lesson})
    return made


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
                "truth": show.number(best.get("truth_psnr_db")),
                "truth_ideal": show.number(best.get("truth_psnr_ideal_db")),
                "truth_wrong": show.number(best.get("truth_wrong_ppm")),
                "psnr": show.psnr(best, "psnr_db"),
                "over": show.percent(best.get("fraction_over_1_255")),
                "gate": show.gate(best),
                "mark": show.gate_mark(best),
                "fps": show.number(best["frames_per_s"]),
            }
        )
    return found


def figures(data: Data, rows: pd.DataFrame, folder: Path) -> list[dict[str, str]]:
    """Draws the plots into `folder`; name, caption and data URI of each."""
    if rows.empty:
        return []
    made = sweep_figures.draw(data, rows, folder)
    return [
        {"name": name, "caption": FIGURES[name], "uri": data_uri(paths[0])} for name, paths in made.items()
    ]


def counted_figures(data: Data, folder: Path) -> dict[str, dict[str, str]]:
    """The roofline and the performance against n, as SVG for the page itself: only so can they show what is
    under the pointer.
    """
    found, limits, _ = roof.read(data.path, strict=False)
    table = roof.rows(data, found, limits)
    if table.empty:
        return {}
    return {
        name: {"caption": roofline_figures.CAPTIONS[name], "svg": roofline_figures.inline(paths[0])}
        for name, paths in roofline_figures.draw(data, table, limits, folder).items()
    }


def copied(wanted: dict[Path, str], folder: Path) -> list[dict[str, str]]:
    """Copies the pictures that exist to `folder`; name, caption and data URI of each."""
    made = []
    for path, text in wanted.items():
        if path.is_file():
            folder.mkdir(parents=True, exist_ok=True)
            if folder.resolve() != path.parent.resolve():  # of a page in the run's own folder
                shutil.copyfile(path, folder / path.name)
            made.append({"name": path.stem, "caption": text, "uri": data_uri(path)})
    return made


def drawn(section: Section, folder: Path) -> list[dict[str, str]]:
    """Draws a chapter's figures into `folder`, from its file alone; name, caption and data URI of each.

    Never those that the run's own figures/ may have: they can be of an older file.
    """
    made = []
    with matplotlib.rc_context(draw.STYLE):
        for name, drawing in section.drawn.items():
            with reading(section.file or section.id, f"{section.script} --run {folder}"):
                figure = drawing.make()
                paths = draw.save(figure, folder / name, drawing.note)
            made.append({"name": name, "caption": drawing.caption, "uri": data_uri(paths[0])})
    return made


def absent(section: Section) -> list[str]:
    """Captions of the chapter's pictures that are not with its files."""
    return [caption for path, caption in section.images.items() if not path.is_file()]


def pictures(data: Data) -> dict[Path, str]:
    """What stepwise pictures draws, and its captions."""
    return {data.path / "figures" / name: text for name, text in PICTURES.items()}


def heatmaps(data: Data) -> dict[Path, str]:
    """What stepwise verify draws of failing pairs, and its captions."""
    return {
        data.path / pair["heatmap"]: f"{pair['scene']}: {pair['phase']} is outside its tolerance"
        for pair in data.pairs
        if pair.get("within_tolerance") is False and pair.get("heatmap")
    }


def page(data: Data, out: Path, height: int | None = None, running: Sequence[str] = ()) -> str:
    """The page's HTML; tables and figures go beside `out`. `running`: what a study still measures."""
    rows = ladder.rows(data, height)
    made = tables.make(data, rows)
    table_files.write(made, out.parent / "tables")
    ladders = [
        {
            "scene": scene,
            "size": f"{group['width'].iloc[0]}×{group['height'].iloc[0]}",
            "parts": [
                (title, show.table(records, sweep_columns.sized(part, records)))
                for part, title in sweep_columns.PARTS
            ],
        }
        for scene, group in ladder.ladders(rows).items()
        for records in [group.to_dict("records")]
    ]
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found = experiment.sections(data)
    figures_folder = out.parent / "figures"
    return environment.get_template("index.html.j2").render(
        run="/".join(data.path.resolve().parts[-2:]),
        data=data,
        running=list(running),
        remarks=analysis.noise(data)["remarks"],
        machine=facts.machine(data),
        commands=facts.commands(data),
        skipped=facts.skipped(data),
        headlines=headlines(rows),
        ladders=ladders,
        closed=[] if rows.empty else [name for name in rows["phase"].unique() if registry.is_exact(name)],
        runtime=show.table(rows.to_dict("records"), sweep_columns.RUNTIME),
        figures={figure["name"]: figure for figure in figures(data, rows, figures_folder)},
        sections=found,
        images={one.id: drawn(one, figures_folder) + copied(one.images, figures_folder) for one in found},
        absent={one.id: absent(one) for one in found},
        inline=counted_figures(data, figures_folder),
        verification=show.table(data.pairs, verify_columns.VERIFICATION),
        failing=[pair for pair in data.pairs if pair.get("within_tolerance") is False],
        pictures=copied(pictures(data), figures_folder),
        heatmaps=copied(heatmaps(data), figures_folder),
        claims=made["claims"][0].astype(object).to_dict("records"),
        paper=show.table(paper.ladder().to_dict("records"), sweep_columns.PAPER),
        phases=phases(data),
        methods={"median": stats.MEDIAN.text(), "ratio": stats.RATIO.text()},
    )


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
