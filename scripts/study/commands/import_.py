"""Converts a scene file of the paper's program into a scene of this project.

What its program has compiled in (fog, the march's limits, soft shadows) is as on its branch master. The
size of its picture is no part of a scene here: the last line says it as options of `render`.
"""

from __future__ import annotations

from pathlib import Path

from study.core import cli, store
from study.core.cli import StudyError
from study.experiments.original import scenes


def main() -> int:
    parser = cli.parser(__doc__)
    add = parser.add_argument
    add("file", type=Path, metavar="FILE", help="in the repository of the paper's program: scenes/*.json")
    add("-o", "--out", type=Path, metavar="PATH", help="default: FILE's name in the current folder")
    args = parser.parse_args()
    out = args.out or Path(args.file.name)
    if out.exists() and (not args.out or (args.file.exists() and out.samefile(args.file))):
        raise StudyError(f"{out}: is there already; -o names another file")
    theirs, scene = scenes.read(args.file), scenes.converted(args.file)
    store.write_json(out, scene)
    if args.json:
        cli.emit({"schema": 1, "scene": out, "width": theirs.camera.width, "height": theirs.camera.height})
    else:
        print(f"{out}: {len(scene['shapes'])} shapes; -n {theirs.camera.height} -w {theirs.camera.width}")
    return cli.OK
