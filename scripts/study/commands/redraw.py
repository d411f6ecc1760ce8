"""A run's figures drawn again from its files, and sheets of pictures rendered again: nothing is measured."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib

from study.bounds import roof
from study.core import cli, registry, store
from study.core.cli import StudyError
from study.experiments.fixed import pictures as fixed_pictures
from study.experiments.packets import pictures as packets_pictures
from study.experiments.packets import rays as packets_rays
from study.experiments.pareto import command as pareto_script
from study.experiments.pareto import fronts as pareto
from study.experiments.rods import measure as rods
from study.experiments.rods import pictures as rods_pictures
from study.experiments.roofline import figures as roofline_figures
from study.experiments.scaling import figures as scaling_page
from study.experiments.scaling import measure as scaling
from study.experiments.sweep import figures as sweep_figures
from study.experiments.sweep import ladder
from study.experiments.systems import pictures as systems_pictures
from study.experiments.views import figures as views_page
from study.experiments.views import measure as views_measure
from study.numbers import analysis
from study.pictures.draw import STYLE, save

PACKETS = 180  # height, as scripts/stepwise packets has
THUMBNAILS = {scaling_page.SHEET, "views-sheet"}  # of pictures that a published run lacks: left as they are


def speeds(run: Path, out: Path) -> list[Path]:
    data = analysis.load(run)
    return [path for paths in sweep_figures.draw(data, ladder.rows(data), out).values() for path in paths]


def roofs(run: Path, out: Path) -> list[Path]:
    data = analysis.load(run)
    counted, limits, _ = roof.read(run)
    made = roofline_figures.draw(data, roof.rows(data, counted, limits), limits, out)
    return [path for paths in made.values() for path in paths]


def fronts(run: Path, out: Path) -> list[Path]:
    return pareto_script.figures(pareto.read(run / pareto.FILE), out)


def _from_file(name: str, page) -> Callable[[Path, Path], list[Path]]:
    """A chapter that has `figures` and `note`."""

    def make(run: Path, out: Path) -> list[Path]:
        result, made = store.read_json(run / name), []
        with matplotlib.rc_context(STYLE):
            for title, figure in page.figures(result, run).items():
                made += [] if title in THUMBNAILS else save(figure, out / title, page.note(result))
        return made

    return make


def packets(_: Path, out: Path) -> list[Path]:
    made = store.writable(registry.ROOT / "build" / "systems" / "scenes")
    return packets_pictures.write_pictures(out, packets_rays.scenes(made), PACKETS)


# Of pictures: the phases that they show must be built.
SHEETS: dict[str, Callable[[Path, Path], list[Path]]] = {
    "rods-pictures": lambda _, out: rods_pictures.write_pictures(out, rods.ARTICLE["size"]),
    "packets-pictures": packets,
    "systems-pictures": lambda _, out: systems_pictures.write_pictures(out),
    "fixed-blocks": lambda _, out: fixed_pictures.write_pictures(out),
}
KINDS: dict[str, tuple[str, Callable[[Path, Path], list[Path]]]] = {  # → the file that it is made from
    "speeds": ("", speeds),
    "roofline": (roof.COUNTS, roofs),
    "pareto": (pareto.FILE, fronts),
    "scaling": (scaling.FILE, _from_file(scaling.FILE, scaling_page)),
    "views": (views_measure.FILE, _from_file(views_measure.FILE, views_page)),
}


def main() -> int:
    parser = cli.parser(__doc__ or "")
    parser.add_argument("run", type=Path, metavar="RUN", help="its folder")
    about = "where figures/ and images/ go; default: RUN"
    parser.add_argument("-o", "--out", type=Path, metavar="PATH", help=about)
    kinds = [*KINDS, *SHEETS]
    about = f"of {', '.join(kinds)}; default: all figures that the run has. Sheets need their phases built"
    parser.add_argument("--only", nargs="+", choices=kinds, metavar="KIND", help=about)
    args = parser.parse_args()
    if not args.run.is_dir():
        raise StudyError(f"{args.run}: no such run")
    out, made = store.writable(args.out or args.run), []
    for kind in args.only or KINDS:
        if kind in SHEETS:
            made += SHEETS[kind](args.run, out)
            continue
        file, make = KINDS[kind]
        if store.stored(args.run / file).exists():  # published runs have packed ones
            made += make(args.run, out / "figures")
        else:
            cli.say(f"{kind}: left out, {args.run / file} is missing")
    if args.json:
        cli.emit({"files": made}, args.run)
    else:
        print("\n".join(map(str, made)))
    return cli.OK
