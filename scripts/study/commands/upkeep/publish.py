"""Makes a run's folder small enough to be published; then tries its report."""

import argparse
import gzip
import json
import os
import shutil
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio

from study.core import cli, machine, provenance, store, temporary
from study.core.cli import Outcome, StudyError
from study.core.run_schema import RUN_TOML, About, Context
from study.experiments import experiment
from study.numbers import analysis
from study.pictures import images
from study.report import compared

DESCRIPTION = """\
Copies to FOLDER what the report of a run is made from: every JSON file at the top of the run, frames.jsonl
and the pictures that chapters show. Large files are packed. Pictures are scaled down to 300 kB each, and
to 320 pixels across for the two scenes that the report compares. run.toml names the machine, the commit,
the commands and a caveat.

Then every chapter is read from the copies. It must have the parts, figures and pictures that it has in the
run. Only then is there a FOLDER. A run that is being measured is refused.
Of an interrupted run, a cut last line of frames.jsonl is dropped."""
PICTURE_BYTES = 300_000
# Megabytes; what reads them takes both forms (store.stored).
PACKED = ("counts.json", "validation.json", "hotspots.json")
SMALLER = 0.85  # each time a picture is still too large


def copy_files(run: Path, folder: Path) -> None:
    """The JSON files and the frames. Raises StudyError."""
    for file in sorted(run.glob("*.json")):
        if file.name in PACKED:
            text = json.dumps(store.read_json(file), separators=(",", ":"))
            (folder / f"{file.name}.gz").write_bytes(gzip.compress(text.encode(), mtime=0))
        else:
            shutil.copyfile(file, folder / file.name)
    for file in sorted((run / store.OWN_SCENES).glob("*.json")):
        store.write_bytes(folder / store.OWN_SCENES / file.name, file.read_bytes())
    for file in sorted(run.glob("*.json.gz")):
        if not file.with_suffix("").exists():
            shutil.copyfile(file, folder / file.name)
    packed, plain = (run / name for name in ("frames.jsonl.gz", "frames.jsonl"))
    if plain.exists():
        data = plain.read_bytes()
        whole = store.whole_lines(data)
        if whole < len(data):
            cli.say(f"{plain}: last line is cut off ({len(data) - whole} bytes dropped)")
        (folder / packed.name).write_bytes(gzip.compress(data[:whole], mtime=0))
    elif packed.exists():
        shutil.copyfile(packed, folder / packed.name)


def shrink(picture: Path, out: Path, most: int = PICTURE_BYTES) -> None:
    """Writes the PNG `out`: the picture, as large as fits `most` bytes. Raises StudyError."""
    out.parent.mkdir(parents=True, exist_ok=True)
    if picture.stat().st_size <= most:
        shutil.copyfile(picture, out)
        return
    whole = oiio.ImageBuf(str(picture))
    if whole.has_error or not whole.spec().width:
        raise StudyError(f"{picture}: not a picture: {whole.geterror().strip()}")
    whole = oiio.ImageBufAlgo.channels(whole, (0, 1, 2))
    width, height = whole.spec().width, whole.spec().height
    scale = 1.0
    while not out.exists() or out.stat().st_size > most:
        scale *= SMALLER
        size = [max(1, round(side * scale)) for side in (width, height)]
        made = oiio.ImageBufAlgo.resize(whole, roi=oiio.ROI(0, size[0], 0, size[1], 0, 1, 0, 3))
        images.write_png(out, np.asarray(made.get_pixels(oiio.UINT8)))


def sections(folder: Path) -> list[Any]:
    return experiment.sections(analysis.load(folder))


def copy_pictures(run: Path, folder: Path) -> list[str]:
    """Those that the chapters show, as large as fits, and the few that the report compares under a slider,
    small; their names below the run."""
    names = []
    for section in sections(run):
        for picture in section.images:
            if picture.is_file() and picture.is_relative_to(run):
                names.append(str(picture.relative_to(run)))
                shrink(picture, folder / names[-1])
    for path, pixels in compared.kept(analysis.load(run)).items():
        names.append(str(path.relative_to(run)))
        images.write_png(folder / names[-1], pixels)
    return names


def about(folder: Path, commands: list[str], caveat: str) -> str:
    """run.toml: what a reader must know of the run before its numbers."""
    context = Context.load_if_there(folder / "context.json") or Context()
    said: dict[str, Any] = {"machine": machine.name(context), "compiler": context.compiler or "unknown"}
    said |= {"time": context.time or "unknown", "commit": ", ".join(provenance.commits(folder))}
    said |= {"commands": commands, "caveat": caveat}
    return "".join(f"{key} = {json.dumps(value, ensure_ascii=False)}\n" for key, value in said.items())


def shown(folder: Path) -> dict[str, Any]:
    """What the report shows of each chapter: its tables' text, its figures, its pictures."""
    return {
        one.id: (
            [(part.name, part.markdown) for part in one.parts],
            sorted(one.drawn),
            sorted(path.name for path in one.images if path.is_file()),
        )
        for one in sections(folder)
    }


def publish(run: Path, folder: Path, commands: list[str], caveat: str) -> list[str]:
    """Makes `folder` whole or not at all: names of its pictures. Raises StudyError."""
    beside = store.writable(folder.parent)
    try:
        # The copy has the same name, in a folder of its own beside it: renaming is one step.
        with temporary.folder(beside, ".publish.") as apart:
            made = apart / folder.name
            made.mkdir()
            copy_files(run, made)
            names = copy_pictures(run, made)
            store.write_text(made / RUN_TOML, about(made, commands, caveat))
            About.of(tomllib.loads((made / RUN_TOML).read_text(encoding="utf-8")), str(made / RUN_TOML))
            here, there = shown(run), shown(made)
            if lost := sorted(name for name in here if here[name] != there.get(name)):
                raise StudyError(f"{folder}: not as in the run: {', '.join(lost)}")
            os.rename(made, folder)
    except OSError as error:
        if error.filename2 or not error.filename:  # a copy's target; a disk that is full
            raise StudyError(f"{folder}: cannot be written: {error.strerror or error}") from None
        raise StudyError(f"{error.filename}: {error.strerror or error}") from None
    return names


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("run", type=Path, metavar="RUN", help="its folder")
    add("folder", type=Path, metavar="FOLDER", help="new, e.g. results/reference/MACHINE-DATE")
    add("--command", nargs="+", default=[], metavar="TEXT", help="what made the run, for run.toml")
    add("--caveat", default="", metavar="TEXT", help="what limits its numbers, for run.toml")
    about = "take runs of sources with uncommitted changes, or of an unknown commit"
    add("--unclean", action="store_true", help=about)


def run(args: argparse.Namespace) -> Outcome:
    source = store.Run.open(args.run)
    provenance.need_clean(source.path, args.unclean)
    if args.folder.exists() and any(args.folder.iterdir()):
        raise StudyError(f"{args.folder}: is there already and not empty")
    folder = args.folder.absolute()
    with source.still():
        names = publish(source.path, folder, args.command, args.caveat)
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    commits = provenance.commits(folder)
    told = {"folder": args.folder, "bytes": size, "pictures": names, "commits": commits}
    line = f"{args.folder}: {size / 1e6:.2f} MB; pictures {', '.join(names) or 'none'}"
    each = [f"  of commit {commit}: {', '.join(files)}" for commit, files in commits.items()]
    return Outcome(told, [line, *each], source.path)
