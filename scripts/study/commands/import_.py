"""Converts a scene file of the paper's program into a scene of this project.

What its program has compiled in (fog, the march's limits, soft shadows) is as on its branch master. The
size of its picture is no part of a scene here: the last line says it as options of `render`.
"""

import argparse
from pathlib import Path

from study.core import store
from study.core.cli import Outcome, StudyError
from study.measuring import paper_scenes


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("file", type=Path, metavar="FILE", help="in the repository of the paper's program: scenes/*.json")
    add("-o", "--out", type=Path, metavar="PATH", help="default: FILE's name in the current folder")


def run(args: argparse.Namespace) -> Outcome:
    out = args.out or Path(args.file.name)
    if out.exists() and (not args.out or (args.file.exists() and out.samefile(args.file))):
        raise StudyError(f"{out}: is there already; -o names another file")
    theirs = paper_scenes.read(args.file)
    scene = paper_scenes.converted(theirs, args.file)
    store.write_json(out, scene)
    wide, high = theirs.camera.width, theirs.camera.height
    result = {"schema": 1, "scene": out, "width": wide, "height": high}
    return Outcome(result, [f"{out}: {len(scene['shapes'])} shapes; -n {high} -w {wide}"])
