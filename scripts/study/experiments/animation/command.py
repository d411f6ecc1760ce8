"""Renders an animated scene's frames, here or on many machines."""

from __future__ import annotations

import argparse
import itertools
import os
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from study.core import cli, progress, registry, run, store, temporary
from study.core.cli import Outcome, StudyError
from study.core.registry import Scene, Spec
from study.experiments import running, shards
from study.experiments.animation.schema import FILE, Row
from study.pictures import images

DESCRIPTION = """\
Frame k shows a scene of common/scenes/animated at k/60 s. Every frame is a process of its own, so nothing is
timed: `scripts/stepwise flight` times scenes whose camera has a path. ffmpeg makes a film of the pictures;
the command says how."""
STATUSES = {
    1: "a frame has samples that are not finite",
    3: "the CPU lacks the phase's instructions",
}
RATE = 60  # frames a second of render --frames
Unit = tuple[Scene, int]


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    names = list(registry.animated())
    add("--scene", nargs="+", default=names, metavar="SCENE", help=f"of {', '.join(names)}; default: all")
    add("--phase", default="opt10_scene", metavar="PHASE", help="default: %(default)s")
    add("--frames", type=cli.at_least(1), default=RATE, metavar="N", help="of each; default: 60, a second")
    add("--first-frame", type=cli.at_least(0), default=0, metavar="K", help="default: 0")
    running.height(parser, 360, least=1)
    add("-w", type=cli.at_least(1), metavar="WIDTH", help="width; default: 16:9")
    add("--run", type=Path, metavar="DIR", help=f"for {FILE} and animation/; default: build/animation")
    cores = len(os.sched_getaffinity(0))
    add("--jobs", type=cli.at_least(1), default=cores, help="frames rendered at a time; default: CPUs")
    parser.set_defaults(home="animation")
    shards.option(parser, "frames")


def units(args: argparse.Namespace) -> list[Unit]:
    """Scenes and numbers of frames. Raises StudyError for a scene or a phase that there is not."""
    registry.find_phase(Spec.parse(args.phase).phase)
    scenes = [registry.find_animated(name) for name in dict.fromkeys(args.scene)]
    return list(itertools.product(scenes, range(args.first_frame, args.first_frame + args.frames)))


def drawn(spec: Spec, n: int, width: int | None, folder: Path, unit: Unit) -> tuple[Row, int]:
    """A frame's row, and how many of its samples are not finite. Its picture is in folder/animation."""
    scene, number = unit
    size = scene.size(n, width)
    name = f"animation/{scene.name}-{spec}-{size[0]}x{size[1]}-{number:05}.png"
    with temporary.folder() as scratch:
        out = scratch / "frame.exr"
        frames = {"animation": number + 1, "first_frame": number}
        run.render(spec, scene.path, size[1], size[0], out=out, timed=False, **frames)
        picture = images.read(out)
    images.write_png(folder / name, images.to_display(images.rgb(picture)))
    row = Row(
        scene=scene.name,
        phase=str(spec),
        frame=number,
        seconds=number / RATE,
        width=size[0],
        height=size[1],
        sha256=images.sha256(picture),
        picture=name,
    )
    return row, images.non_finite(picture)


def clear(folder: Path, chosen: list[Unit], args: argparse.Namespace) -> None:
    """Removes the frames of an earlier call that would stand among these."""
    for scene in {scene.name: scene for scene, _ in chosen}.values():
        width, n = scene.size(args.n, args.w)
        for old in (folder / "animation").glob(f"{scene.name}-{args.phase}-{width}x{n}-[0-9]*.png"):
            old.unlink()


def films(whole: dict[str, Any], folder: Path) -> list[str]:
    """Where the pictures are, and how ffmpeg makes a film of each scene's."""
    lines = [f"{len(whole['rows'])} frames: {folder / 'animation'}"]
    for row in {row["scene"]: row for row in reversed(whole["rows"])}.values():
        pattern = f"{row['picture'].rpartition('-')[0]}-%05d.png"
        first = f"-start_number {row['frame']} " if row["frame"] else ""
        pictures = f"-framerate {RATE} {first}-i {folder / pattern}"
        lines.append(f"ffmpeg {pictures} -pix_fmt yuv420p {row['scene']}.mp4")
    return lines


def measure(args: argparse.Namespace) -> Outcome:
    chosen = shards.part(units(args), args.shard)
    spec = Spec.parse(args.phase)
    if lacking := registry.missing_isa(spec):
        raise StudyError(f"{spec} needs {' '.join(lacking)}, which this CPU lacks", cli.CANNOT_RUN)
    folder = running.folder(args, FILE)
    store.writable(folder / "animation")
    if not args.shard:
        clear(folder, chosen, args)
    with ThreadPoolExecutor(args.jobs) as pool:
        one = partial(drawn, spec, args.n, args.w, folder)
        made = list(progress.each(pool.map(one, chosen), "frames", len(chosen)))
    failed = [f"{row.scene}, frame {row.frame}: {bad} samples are not finite" for row, bad in made if bad]
    result = {"schema": 1, "rows": cli.plain([row for row, _ in made])}
    path = shards.write(folder, FILE, result, args.shard)
    lines = [*([] if args.shard else films(result, folder)), path]
    return Outcome(result, lines, folder, failed=failed)
