#!/usr/bin/env python3
"""The figures of the phases' NOTES.md, from a published run: phases/NAME/lesson.svg. Nothing is measured."""

from __future__ import annotations

from study import cli  # first: it may start the script again with the venv's Python

# isort: split
from study import lessons, lessons_svg, registry
from study.cli import StudyError


def main() -> int:
    parser = cli.parser(__doc__ or "")
    parser.add_argument("--phase", nargs="+", metavar="NAME", help="default: all that the published run has")
    args = parser.parse_args()
    made = []
    for name in args.phase or registry.phases():
        found = lessons.figure(name)
        if found is None:
            if args.phase:
                raise StudyError(
                    f"{name}: no figure; scripts/study/lessons.py has {', '.join(lessons.PANELS)}"
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


if __name__ == "__main__":
    cli.main(main)
