"""The figures and tables of the phases' NOTES.md, from published runs. Nothing is measured.

phases/NAME/lesson.svg, and in NOTES.md the table of the phase's ideas, below its marker."""

from __future__ import annotations

from study.core import cli, registry
from study.core.cli import StudyError
from study.experiments import experiment
from study.report import lessons, lessons_svg


def main() -> int:
    parser = cli.parser(__doc__ or "")
    parser.add_argument("--phase", nargs="+", metavar="PHASE", help="default: all that the published run has")
    args = parser.parse_args()
    made = []
    for name in args.phase or registry.phases():
        found = lessons.figure(name)
        notes = registry.find_phase(name).path / "NOTES.md"
        for fill in (one.lesson for one in experiment.find_all().values() if one.lesson):
            if text := fill(name, notes.read_text(encoding="utf-8")):
                notes.write_text(text, encoding="utf-8")
                made.append(notes.relative_to(registry.ROOT))
        if found is None:
            if args.phase:
                raise StudyError(
                    f"{name}: no figure; scripts/study/report/lessons.py has {', '.join(lessons.PANELS)}"
                )
            continue
        path = registry.find_phase(name).path / lessons.NAME
        path.write_text(lessons_svg.svg(found), encoding="utf-8")
        made.append(path.relative_to(registry.ROOT))
    if args.json:
        cli.emit({"files": made})
    else:
        print("\n".join(map(str, made)))
    return cli.OK
