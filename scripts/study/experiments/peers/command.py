"""Our phases beside what one would use instead: time and error to ground truth, in one interleaved run."""

from __future__ import annotations

import argparse
from pathlib import Path

from study.core import cli, registry, run
from study.core.build import build
from study.core.cli import StudyError
from study.core.registry import Scene, Spec
from study.experiments import running
from study.experiments.original.measure import COMMITS
from study.experiments.peers import measure as peers
from study.experiments.peers import paper, peer, tables
from study.experiments.peers.peer import Peer

DESCRIPTION = """\
Draws scenes without shadows and mirrors by our phases and by other programs: POV-Ray, Mandelbulber, llvmpipe,
PoCL, Taichi, Dr.Jit, Embree and others. A program that is not there is left out by name. --install puts those
from PyPI and crates.io into build/peers; Debian's packages are named. --paper DIR times the paper's own
program from a checkout as well: all of its steps, on its own scene files, each beside our phase of that
step."""


def arguments() -> argparse.Namespace:
    parser = cli.parser(
        DESCRIPTION,
        {cli.FAILED: "a picture is wrong", cli.CANNOT_RUN: "none of the other programs can run here"},
    )
    add, every = parser.add_argument, list(peer.find_all())
    scenes = sorted({scene for one in peer.find_all().values() for scene in one.least_db})
    add("--peer", nargs="+", choices=every, metavar="PEER", help=f"default: all, {', '.join(every)}")
    add("--phase", nargs="+", metavar="PHASE", help=f"of ours; default: {', '.join(peers.PHASES)}")
    add("--scene", nargs="+", metavar="SCENE", help=f"default: {', '.join(scenes)}, and all of the paper's")
    running.height(parser, 360)
    running.height(parser, 180, "height of the pictures that are judged", "--error-n")
    add("--threads", type=cli.at_least(1), nargs="+", help="default: 1 and all CPUs")
    add("--cpu", type=int, default=run.FASTEST, help="first CPU to pin to; default: of a fast core")
    add(
        "--install", action="store_true", help="put what comes from PyPI and crates.io into build/peers first"
    )
    add("--paper", type=Path, metavar="DIR", help="a git checkout of the paper's program")
    running.options(parser, peers.FILE, "peers")
    args = parser.parse_args()
    args.threads = args.threads or [1, len(run.USABLE)]
    return args


def others(args: argparse.Namespace) -> tuple[dict[str, Peer], list[dict]]:
    """The peers that can run here, and those that cannot, with the reason."""
    wanted = {name: one for name, one in peer.find_all().items() if name in (args.peer or peer.find_all())}
    failed = {}
    for one in wanted.values() if args.install else ():
        try:
            one.install()
        except StudyError as error:
            failed[one.title] = str(error)
    able, out = peers.able(wanted)
    return able, [row | {"reason": failed.get(row["phase"], row["reason"])} for row in out]


def scenes_of(args: argparse.Namespace, able: dict[str, Peer]) -> dict[str, Scene]:
    """What is drawn, by name. Raises StudyError for a scene that no program draws."""
    folder = peer.HOME / "scenes"
    found = paper.fetched(args.paper) if args.paper else {}
    able |= paper.steps(list(found)) if found else {}
    for name in sorted({scene for one in peer.find_all().values() for scene in one.least_db}):
        found[name] = peers.plain(name, folder)
    if args.scene:
        for name in args.scene:
            if name not in found:
                raise StudyError(f"no other program draws {name!r}; there are {', '.join(found)}")
        found = {name: found[name] for name in dict.fromkeys(args.scene)}
    return found


def specs_of(args: argparse.Namespace, scene: str) -> list[Spec]:
    """Our phases on that scene: those asked for, or the default, that this CPU can run."""
    names = args.phase or (COMMITS if scene.startswith(paper.PREFIX) else peers.PHASES)
    return [spec for spec in map(Spec.parse, dict.fromkeys(names)) if registry.cpu_supports(spec)]


def measured(args: argparse.Namespace, able: dict[str, Peer], scenes: dict[str, Scene]) -> dict:
    work = peers.Measuring(able, scenes, args.n, args.cpu)
    points = [
        point
        for scene in scenes
        for point in peers.points(specs_of(args, scene), able, [scene], args.threads)
    ]
    if not points:
        raise StudyError("no other program draws these scenes here", cli.CANNOT_RUN)
    for program in dict.fromkeys(point.program for point in points if point.program not in able):
        build(program)
    told, out = peers.judged(work, points, args.error_n)
    points = [point for point in points if (point.program, point.scene) in told]
    times = run.interleaved(points, args.launches, args.seed, args.cpu, work.once)
    drew = {point.program for point in points}
    return {
        "programs": [
            {
                **{"program": one.title, "version": work.versions[name], "timed": one.timed},
                **{"differs": one.differs, "least_db": one.least_db},
            }
            for name, one in able.items()
            if name in drew
        ],
        "rows": peers.rows(times, told, able, lambda name: getattr(able.get(name), "phase", None)),
        "left_out": out,
    }


def main() -> int:
    args = arguments()
    folder = running.folder(args)
    run.cpu_set(args.cpu, 1)
    if max(args.threads) > len(run.USABLE):
        raise StudyError(f"--threads {max(args.threads)}: there are {len(run.USABLE)} CPUs")
    able, out = others(args)
    for row in out:
        cli.say(f"left out: {row['phase']}: {row['reason']}")
    if not able and not args.paper:
        raise StudyError("none of the other programs is here; --install gets what it can", cli.CANNOT_RUN)
    found = measured(args, able, scenes_of(args, able))
    found["left_out"] = out + found["left_out"]
    settings = {key: getattr(args, key) for key in ("n", "error_n", "launches", "seed", "cpu")}
    result = running.write(folder / peers.FILE, settings, found)
    lines = []
    for one in tables.parts(result):
        lines += [one.markdown]
    return running.end(args, result, lines, tables.wrong(result))
