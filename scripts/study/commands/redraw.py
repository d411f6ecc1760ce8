"""A run's figures drawn again from its files, and sheets of pictures rendered again: nothing is measured."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from study.core import cli, registry, store
from study.core.cli import StudyError
from study.experiments import experiment
from study.experiments.fixed import pictures as fixed_pictures
from study.experiments.packets import pictures as packets_pictures
from study.experiments.rods import measure as rods
from study.experiments.rods import pictures as rods_pictures
from study.experiments.section import reading
from study.experiments.systems import pictures as systems_pictures
from study.measuring import rays as packets_rays
from study.numbers import analysis

PACKETS = 180  # height, as scripts/stepwise packets has


def packets(out: Path) -> list[Path]:
    made = store.writable(registry.ROOT / "build" / "systems" / "scenes")
    return packets_pictures.write_pictures(out, packets_rays.scenes(made), PACKETS)


# Of pictures: the phases that they show must be built.
SHEETS: dict[str, Callable[[Path], list[Path]]] = {
    "rods-pictures": lambda out: rods_pictures.write_pictures(out, rods.ARTICLE["size"]),
    "packets-pictures": packets,
    "systems-pictures": systems_pictures.write_pictures,
    "fixed-blocks": fixed_pictures.write_pictures,
}


def main() -> int:
    parser = cli.parser(__doc__ or "")
    parser.add_argument("run", type=Path, metavar="RUN", help="its folder")
    about = "where figures/ and images/ go; default: RUN"
    parser.add_argument("-o", "--out", type=Path, metavar="PATH", help=about)
    about = (
        f"chapters of the report (pareto, roofline …), or of {', '.join(SHEETS)}, whose phases must be "
        "built; default: all chapters"
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", help=about)
    args = parser.parse_args()
    data = analysis.load(args.run, strict=False)
    chapters = {one.id: one for one in experiment.sections(data)}
    out, made = store.writable(args.out or args.run), []
    for name in args.only or chapters:
        if name in SHEETS:
            made += SHEETS[name](out)
        elif name not in chapters:
            raise StudyError(f"no chapter or sheet '{name}'; there are {', '.join([*chapters, *SHEETS])}")
        else:
            section = chapters[name]
            if args.only and not section.drawn:
                cli.say(f"{name}: left out, the run has nothing to draw it from; {section.lacking}")
            for stem, drawing in section.drawn.items():
                with reading(section.file or section.id, f"{section.script} --run {args.run}"):
                    made += drawing.write(out / "figures" / stem)
    if args.json:
        cli.emit({"files": made}, args.run)
    else:
        print("\n".join(map(str, made)))
    return cli.OK
