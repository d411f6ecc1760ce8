#!/usr/bin/env python3
"""Speed against error: each phase over hit distance × step cap × approximations, and the front."""

from __future__ import annotations

import argparse
import secrets
import tempfile
from pathlib import Path

from study import cli  # first: it may start the script again with the venv's Python

# isort: split
import matplotlib

from study import machine, pareto, pareto_page, registry, run, store
from study.cli import StudyError
from study.draw import STYLE, save
from study.registry import Spec

DESCRIPTION = """\
Every program is rendered for each hit distance and step cap, its picture held against truth's, and timed in
random order, one frame per process launch. The front: no other point is both faster and nearer to truth."""


def positive(kind: type) -> object:
    def check(text: str) -> float:
        value = kind(text)
        if not value > 0:
            raise argparse.ArgumentTypeError(f"'{text}': must be greater than 0")
        return value

    return check


def length(text: str) -> float:
    """What the loader takes as a hit distance, in scene units."""
    try:
        value = float(text)
    except ValueError:
        value = 0
    if not 1e-9 <= value <= 1e9:
        raise argparse.ArgumentTypeError(f"'{text}': must be a length of 1e-9 to 1e9")
    return value


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "a picture has samples that are not finite"})
    add = parser.add_argument
    ladder = [name for name, phase in registry.phases().items() if phase.family == "ladder"]
    switches = [name for name in pareto.SWITCHES if name.partition("+")[0] in ladder]
    add(
        "--phase",
        nargs="+",
        default=ladder + switches,
        metavar="SPEC",
        help="default: the ladder and switches",
    )
    add(
        "--scene",
        nargs="+",
        default=["scene0", "trio", "mandelbulb"],
        metavar="NAME",
        help="default: %(default)s",
    )
    about = "besides the scene's own; default: %(default)s"
    add("--hit-distance", nargs="+", type=length, default=list(pareto.HIT_DISTANCES), help=about)
    add("--max-steps", nargs="+", type=positive(int), default=list(pareto.STEPS), help=about)
    add("-n", type=positive(int), default=90, help="height in pixels; default: 90")
    add("--launches", type=positive(int), default=6, help="process launches of each; default: 6")
    add("--seed", type=int, help="of order and padding; default: random")
    add("--cpu", type=int, default=run.USABLE[-1], metavar="C", help="CPU to pin to; default: the last one")
    add("--run", type=Path, metavar="DIR", help="for pareto.json and figures/; default: build/pareto")
    return parser.parse_args()


def main() -> int:
    args = arguments()
    args.seed = secrets.randbelow(2**32) if args.seed is None else args.seed
    folder = store.writable(args.run or registry.ROOT / "build" / "pareto")
    specs = [Spec.parse(name) for name in dict.fromkeys(args.phase)]
    scenes = [registry.find_scene(name) for name in dict.fromkeys(args.scene)]
    lacking = {spec: registry.missing_isa(spec) for spec in specs}
    run.cpu_set(args.cpu, 1)
    rows: list[dict] = []
    skipped = [
        {"phase": str(spec), "scene": "any scene", "reason": f"this CPU lacks {' '.join(what)}"}
        for spec, what in lacking.items()
        if what
    ]
    able = [spec for spec in specs if not lacking[spec]]
    if not able:
        raise StudyError("no phase of these can run on this CPU", cli.CANNOT_RUN)
    with tempfile.TemporaryDirectory(prefix="stepwise-") as scratch:
        for scene in scenes:
            points = pareto.grid(scene, able, args.hit_distance, args.max_steps)
            found, missing = pareto.study_scene(
                scene, points, args.n, args.launches, args.seed, args.cpu, Path(scratch)
            )
            rows, skipped = rows + found, skipped + missing
    if not rows:
        pareto.say_missing(skipped)
        raise StudyError("nothing was measured: every point was refused, for the reasons above")
    settings = {key: getattr(args, key) for key in ("n", "launches", "seed", "cpu")}
    result = {"schema": 1, **settings, "context": machine.context(), "rows": rows, "skipped": skipped}
    result["winners"] = pareto.winners(rows)
    result["sentences"] = [pareto.sentence(winner) for winner in result["winners"]]
    store.write_json(folder / pareto.FILE, result)
    with matplotlib.rc_context(STYLE):
        figures = save(pareto_page.figure(rows), folder / "figures" / "pareto", pareto_page.note(result))
    if args.json:
        cli.emit(result)
    else:
        print("\n".join(result["sentences"]))
        print("\n".join(str(path) for path in figures))
    pareto.say_missing(skipped)
    bad = [row for row in rows if row["non_finite"]]
    for row in bad:
        cli.say(f"FAIL {row['phase']} on {row['scene']} at {row['hit_distance']:g}: not finite")
    return cli.FAILED if bad else cli.OK


if __name__ == "__main__":
    cli.main(main)
