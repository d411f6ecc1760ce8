"""CPU-RTRM's scene by every phase of the ladder: time, error to truth, beside that program's own figures."""

from __future__ import annotations

import argparse
import secrets
import time
from pathlib import Path

from study.core import cli, machine, registry, run, store, temporary
from study.core.cli import StudyError
from study.experiments.lattice import measure as lattice
from study.experiments.lattice import tables as lattice_page

DESCRIPTION = """\
Every phase of the ladder on the scene `lattice` at 1000×562 and 1280×720, on one thread and on all CPUs, in
interleaved launches; the error of each to truth; what the light takes of the time; beside the figures of
CPU-RTRM's own program, which were measured on another machine."""


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "a picture has samples that are not finite"})
    add = parser.add_argument
    add("--phase", nargs="+", metavar="PHASE", help="default: the ladder")
    add(
        "-n",
        type=cli.at_least(9),
        nargs="+",
        metavar="HEIGHT",
        help="heights, 16:9; default: 1000×562 and 1280×720",
    )
    add(
        "--error-n",
        type=cli.at_least(9),
        default=180,
        metavar="HEIGHT",
        help="height for errors; default: 180",
    )
    add("--launches", type=cli.at_least(1), default=6, help="process launches of each; default: 6")
    add("--threads", type=cli.at_least(1), nargs="+", help="default: 1, 2 and all CPUs")
    add("--seed", type=int, help="of order and padding; default: random")
    add("--cpu", type=int, default=run.FASTEST, help="first CPU to pin to; default: of a fast core")
    add("--run", type=Path, metavar="DIR", help="for lattice.json; default: build/systems")
    args = parser.parse_args()
    args.threads = args.threads or sorted({1, min(2, len(run.USABLE)), len(run.USABLE)})
    args.seed = secrets.randbelow(2**32) if args.seed is None else args.seed
    return args


def main() -> int:
    args = arguments()
    folder = store.writable(args.run or registry.ROOT / "build" / "systems")
    run.cpu_set(args.cpu, 1)
    if max(args.threads) > len(run.USABLE):
        raise StudyError(f"--threads {max(args.threads)}: there are {len(run.USABLE)} CPUs")
    names = lattice.able([registry.find_phase(name).name for name in args.phase] if args.phase else None)
    if not names:
        raise StudyError("no phase of these can run on this CPU", cli.CANNOT_RUN)
    scene = registry.find_scene(lattice.SCENE)
    sizes = [scene.size(n) for n in args.n] if args.n else list(lattice.SIZES)
    begun = time.monotonic()
    settings = {key: getattr(args, key) for key in ("launches", "threads", "seed", "cpu")}
    how = (args.threads, args.launches, args.seed, args.cpu, args.error_n)
    with temporary.folder() as scratch:
        found = lattice.study(names, sizes, *how, scratch)
    about = {"took_s": time.monotonic() - begun, "context": machine.context()}
    result = cli.plain({"schema": 1, **settings, **about, **found})
    store.write_json(folder / lattice.FILE, result)
    if args.json:
        cli.emit(result, folder)
    else:
        print("\n".join([*map(lattice_page.sentence, result["rows"]), lattice_page.note(result)]))
    bad = {row["phase"] for row in result["rows"] if row["non_finite"]}
    for name in sorted(bad):
        cli.say(f"FAIL {name} on {lattice.SCENE}: samples that are not finite")
    return cli.FAILED if bad else cli.OK
