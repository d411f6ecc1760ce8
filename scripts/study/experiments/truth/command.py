"""Makes and keeps the exact pictures that phases are judged by."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from study.core import cli, registry, show, store
from study.core.cli import Outcome
from study.core.registry import Scene
from study.core.show import Column
from study.experiments import running, shards
from study.experiments.truth.schema import FILE, Row, Truth
from study.pictures import images
from study.truth import truth

DESCRIPTION = """\
Draws scenes with phase truth. Counts are of pixels by their camera ray; one that no interval decides judges
no phase. A copy of each picture goes to RUN/truth: put into build/truth/cache of another
checkout with the same compiler, it is not made again there."""
STATUSES = {1: "a ray of a scene without a fractal is undecided"}
COLUMNS = [
    Column("", "scene", lambda r: r.scene),
    Column("", "size", lambda r: f"{r.width}x{r.height}"),
    *(
        Column("pixels by their camera ray", name.replace("_", " "), show.whole(name))
        for name in ("proved", "undecided", "converged_only", "surface_proved")
    ),
    Column("", "widest enclosure of t", lambda r: f"{r.widest:.1e}"),
]


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--scene", nargs="+", metavar="SCENE", help="default: all")
    running.height(parser, 720, least=1)
    add("-w", type=cli.at_least(1), metavar="WIDTH", help="width; default: 16:9, two_spheres square")
    add("--run", type=Path, metavar="DIR", help="for truth.json and truth/; default: build/truth")
    cores = len(os.sched_getaffinity(0))
    add("--jobs", type=cli.at_least(1), default=cores, help="threads that draw a picture; default: CPUs")
    parser.set_defaults(home="truth")
    shards.option(parser, "scenes")


def units(args: argparse.Namespace) -> list[Scene]:
    """The scenes. Raises StudyError for one that there is not."""
    return [registry.find_scene(name) for name in dict.fromkeys(args.scene or registry.scenes())]


def kept(scene: Scene, size: truth.Size, jobs: int, folder: Path) -> Row:
    """The picture's row. Its copy is in folder/truth."""
    made = truth.make(scene, size, jobs)
    planes = images.read(made)
    status, proved = planes["status"], planes["status"] == truth.PROVED
    copy = folder / "truth" / made.name
    store.write_bytes(copy, made.read_bytes())
    return Row(
        scene=scene.name,
        width=size[0],
        height=size[1],
        proved=int(proved.sum()),
        undecided=int((status == truth.UNDECIDED).sum()),
        converged_only=int((status == truth.MARCHED).sum()),
        surface_proved=int((planes["surface.status"] == truth.PROVED).sum()),
        widest=float(planes["width"][proved].max(initial=0)),
        chain_proved=int((planes["status.all"] == truth.PROVED).sum()),
        sha256=images.sha256(planes),
        picture=f"truth/{copy.name}",
    )


def measure(args: argparse.Namespace) -> Outcome:
    scenes = shards.part(units(args), args.shard)
    folder = running.folder(args, FILE)
    rows = [kept(scene, scene.size(args.n, args.w), args.jobs, folder) for scene in scenes]
    result = Truth(schema=1, rows=rows)
    shards.write(folder, FILE, result, args.shard)
    smooth = {scene.name for scene in scenes if not scene.fractal}
    failed = [f"{r.scene}: {r.undecided} rays undecided" for r in rows if r.undecided and r.scene in smooth]
    return Outcome(result, [show.markdown(show.table(rows, COLUMNS))], folder, failed=failed)
