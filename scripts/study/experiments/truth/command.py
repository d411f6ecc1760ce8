"""The exact pictures that phases are judged by: made once, kept in build/truth/cache; how sure each is."""

from __future__ import annotations

import argparse
import dataclasses
import os
import shutil
from pathlib import Path
from typing import Any

from study.core import cli, registry, store
from study.core.registry import Scene
from study.experiments import running, shards
from study.pictures import images
from study.truth import truth

DESCRIPTION = """\
Draws scenes with phase truth, and decides by exact algebra what its intervals leave open. Counts are of
pixels by their camera ray. A copy of each picture goes to RUN/truth: put into build/truth/cache of another
checkout with the same compiler, it is not made again there."""
FILE = "truth.json"


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "a ray of a scene without a fractal stayed undecided"})
    add = parser.add_argument
    add("--scene", nargs="+", metavar="SCENE", help="default: all")
    running.height(parser, 720, least=1)
    add("-w", type=cli.at_least(1), metavar="WIDTH", help="width; default: 16:9, two_spheres square")
    add("--run", type=Path, metavar="DIR", help="for truth.json and truth/; default: build/truth")
    cores = len(os.sched_getaffinity(0))
    add("--jobs", type=cli.at_least(1), default=cores, help="threads that draw a picture; default: CPUs")
    parser.set_defaults(home="truth")
    shards.option(parser, "scenes")
    return parser.parse_args()


def units(args: argparse.Namespace) -> list[Scene]:
    """The scenes. Raises StudyError for one that there is not."""
    return [registry.find_scene(name) for name in dict.fromkeys(args.scene or registry.scenes())]


def kept(scene: Scene, size: truth.Size, jobs: int, folder: Path) -> tuple[dict[str, Any], float]:
    """A row, and the seconds that the picture took when it was made. Its copy is in folder/truth."""
    found = dataclasses.asdict(truth.summary(scene, size, jobs))
    cached = registry.ROOT / found.pop("path")
    del found["cached"]
    seconds = found.pop("seconds")
    copy = store.writable(folder / "truth") / cached.name
    shutil.copyfile(cached, copy)
    digest = images.sha256(images.read(copy))
    return {**found, "sha256": digest, "picture": f"truth/{copy.name}"}, seconds


def table(rows: list[dict[str, Any]], seconds: list[float]) -> str:
    """One line a scene."""
    lines = [["scene", "size", "proved", "exactly", "undecided", "converged only", "widest", "seconds"]]
    for row, took in zip(rows, seconds, strict=True):
        counts = [row[name] for name in ("proved", "decided_exactly", "undecided", "converged_only")]
        size = f"{row['width']}x{row['height']}"
        lines.append([row["scene"], size, *map(str, counts), f"{row['widest']:.1e}", f"{took:.1f}"])
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join("  ".join(f"{x:>{w}}" for x, w in zip(line, widths, strict=True)) for line in lines)


def main() -> int:
    args = arguments()
    scenes = shards.part(units(args), args.shard)
    folder = running.folder(args)
    rows, seconds = [], []
    for scene in scenes:
        cli.say(f"{scene.name} ...")
        row, took = kept(scene, scene.size(args.n, args.w), args.jobs, folder)
        rows.append(row)
        seconds.append(took)
    result = {"schema": 1, "rows": rows}
    store.write_json(folder / shards.file_name(FILE, args.shard), shards.marked(result, args.shard))
    smooth = {scene.name for scene in scenes if not scene.fractal}
    failed = [
        f"{row['scene']}: {row['undecided']} rays stayed undecided"
        for row in rows
        if row["undecided"] and row["scene"] in smooth
    ]
    about = "Pixels by their camera ray; widest: enclosure of t in scene units; seconds: when it was made."
    return running.end(args, result, [table(rows, seconds), about], failed)
