"""The frames of an animated scene by one phase, as pictures: all, or a share on each of many machines."""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from study.core import cli, progress, registry, run, store, temporary
from study.core.cli import StudyError
from study.core.registry import Scene, Spec
from study.experiments import running, shards
from study.pictures import images

DESCRIPTION = """\
Frame k shows a scene of common/scenes/animated at k/60 s. Every frame is a process of its own, so nothing is
timed: `scripts/stepwise frames` does that. ffmpeg makes a film of the pictures; the command says how."""
FILE = "animation.json"
RATE = 60  # frames a second of render --frames
Unit = tuple[Scene, int]


def arguments() -> argparse.Namespace:
    parser = cli.parser(
        DESCRIPTION,
        {1: "a frame has samples that are not finite", 3: "the CPU lacks the phase's instructions"},
    )
    add = parser.add_argument
    names = list(registry.animated())
    add("--scene", nargs="+", default=names, metavar="SCENE", help=f"of {', '.join(names)}; default: all")
    add("--phase", default="opt10_scene", metavar="PHASE", help="default: %(default)s")
    add("--frames", type=cli.at_least(1), default=RATE, metavar="N", help="of each; default: 60, a second")
    add("--first-frame", type=cli.at_least(0), default=0, metavar="K", help="default: 0")
    running.height(parser, 360, least=1)
    add("-w", type=cli.at_least(1), metavar="WIDTH", help="width; default: 16:9")
    add("--run", type=Path, metavar="DIR", help="for animation.json and animation/; default: build/animation")
    cores = len(os.sched_getaffinity(0))
    add("--jobs", type=cli.at_least(1), default=cores, help="frames rendered at a time; default: CPUs")
    parser.set_defaults(home="animation")
    shards.option(parser, "frames")
    return parser.parse_args()


def units(args: argparse.Namespace) -> list[Unit]:
    """Scenes and numbers of frames. Raises StudyError for a scene or a phase that there is not."""
    registry.find_phase(Spec.parse(args.phase).phase)
    scenes = registry.animated()
    if unknown := [name for name in args.scene if name not in scenes]:
        there = f"common/scenes/animated has {', '.join(scenes)}"
        raise StudyError(f"{unknown[0]}: is no animated scene; {there}")
    numbers = range(args.first_frame, args.first_frame + args.frames)
    return [(scenes[name], number) for name in dict.fromkeys(args.scene) for number in numbers]


def drawn(unit: Unit, spec: Spec, n: int, width: int | None, folder: Path) -> tuple[dict[str, Any], int]:
    """A frame's row, and how many of its samples are not finite. Its picture is in folder/animation."""
    scene, number = unit
    size = scene.size(n, width)
    name = f"animation/{scene.name}-{spec}-{size[0]}x{size[1]}-{number:05}.png"
    with temporary.folder() as scratch:
        out = scratch / "frame.exr"
        run.render(
            spec, scene.path, size[1], size[0], out=out, animation=number + 1, first_frame=number, timed=False
        )
        picture = images.read(out)
    images.write_png(folder / name, images.to_display(images.rgb(picture)))
    about = {"scene": scene.name, "phase": str(spec), "frame": number, "seconds": number / RATE}
    made = {"width": size[0], "height": size[1], "sha256": images.sha256(picture), "picture": name}
    return about | made, images.non_finite(picture)


def clear(folder: Path, chosen: list[Unit], spec: Spec, args: argparse.Namespace) -> None:
    """Removes the frames of an earlier call that would stand among these."""
    for scene in {scene.name: scene for scene, _ in chosen}.values():
        width, n = scene.size(args.n, args.w)
        for old in (folder / "animation").glob(f"{scene.name}-{spec}-{width}x{n}-[0-9]*.png"):
            old.unlink()


def film(row: dict[str, Any], folder: Path) -> str:
    """The command that makes a film of the pictures that begin with a row's."""
    pattern = f"{row['picture'].rpartition('-')[0]}-%05d.png"
    first = f"-start_number {row['frame']} " if row["frame"] else ""
    return f"ffmpeg -framerate {RATE} {first}-i {folder / pattern} -pix_fmt yuv420p {row['scene']}.mp4"


def films(result: dict[str, Any], folder: Path) -> list[str]:
    """Where the pictures are, and how to make a film of each scene's."""
    first = {row["scene"]: row for row in reversed(result["rows"])}
    lines = [film(row, folder) for row in first.values()]
    return [f"{len(result['rows'])} frames: {folder / 'animation'}", *lines]


def main() -> int:
    args = arguments()
    chosen = shards.part(units(args), args.shard)
    spec = Spec.parse(args.phase)
    if lacking := registry.missing_isa(spec):
        raise StudyError(f"{spec} needs {' '.join(lacking)}, which this CPU lacks", cli.CANNOT_RUN)
    folder = running.folder(args)
    store.writable(folder / "animation")

    def one(unit: Unit) -> tuple[dict[str, Any], int]:
        return drawn(unit, spec, args.n, args.w, folder)

    if not args.shard:
        clear(folder, chosen, spec, args)
    with ThreadPoolExecutor(args.jobs) as pool:
        made = list(progress.each(pool.map(one, chosen), "frames", len(chosen)))
    rows = [row for row, _ in made]
    failed = [
        f"{row['scene']}, frame {row['frame']}: {bad} samples are not finite" for row, bad in made if bad
    ]
    result = {"schema": 1, "rows": rows}
    path = folder / shards.file_name(FILE, args.shard)
    store.write_json(path, shards.marked(result, args.shard))
    return running.end(args, result, [*([] if args.shard else films(result, folder)), path], failed)
