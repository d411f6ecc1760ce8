"""Makes PNGs of `render`'s EXR pictures, as the window shows them (gamma, 8 bits)."""

import argparse
from pathlib import Path

from study.core.cli import Outcome, StudyError
from study.pictures import images

DESCRIPTION = """\
Writes NAME.png beside each NAME.exr: c^0.4545 of the colours, which are linear, cut off at 0 and 1.
`render -o NAME.png` writes the same at once. Programs that know EXR (OpenImageIO's iv and oiiotool, tev,
Blender) also show the depth, shapes and normals of --aov."""


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("pictures", nargs="+", type=Path, metavar="FILE.exr", help="linear colours, channels R, G and B")
    add("-o", "--out", type=Path, metavar="PATH", help="of one picture; default: FILE.png, beside it")


def run(args: argparse.Namespace) -> Outcome:
    if args.out and len(args.pictures) > 1:
        raise StudyError(f"-o {args.out}: is of one picture, and here are {len(args.pictures)}")
    made = []
    for path in args.pictures:
        picture = images.read(path)
        if not {*"RGB"} <= {*picture}:
            raise StudyError(f"{path}: has no colours: R, G and B are required, not {', '.join(picture)}")
        made.append(args.out or path.with_suffix(".png"))
        images.write_png(made[-1], images.to_display(images.rgb(picture)))
    return Outcome({"files": made}, made)
