"""Rod marching against per-pixel marching: the article's pictures, time, evaluations, error on all scenes."""

from __future__ import annotations

import argparse
import secrets
import time
from pathlib import Path

import matplotlib

from study.core import cli, machine, registry, store
from study.experiments.rods import measure as rods
from study.experiments.rods import pictures as rods_pictures
from study.experiments.rods import tables as rods_page
from study.pictures.draw import STYLE, save

DESCRIPTION = """\
The article's two pictures by rods and by rays (two_spheres, 800×800, 20 steps), the march alone timed in
interleaved launches, evaluations and the error of both to truth; the same on every scene; and the trade-off
that the article left open: starting rods × step cap → time and error."""


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "a picture has samples that are not finite"})
    add = parser.add_argument
    add("--scene", nargs="+", default=list(registry.scenes()), metavar="SCENE", help="default: all")
    add(
        "-n",
        type=cli.at_least(16),
        default=180,
        metavar="HEIGHT",
        help="height of every scene's pictures; default: 180",
    )
    add(
        "--article-n",
        type=cli.at_least(16),
        default=rods.ARTICLE["size"],
        metavar="HEIGHT",
        help="default: 800",
    )
    add("--launches", type=cli.at_least(2), default=6, help="process launches of each; default: 6")
    add("--seed", type=int, help="of the order; default: random")
    add("--run", type=Path, metavar="DIR", help="for rods.json, images/, figures/; default: build/systems")
    args = parser.parse_args()
    args.seed = secrets.randbelow(2**32) if args.seed is None else args.seed
    return args


def main() -> int:
    args = arguments()
    folder = store.writable(args.run or registry.ROOT / "build" / "systems")
    scenes = [registry.find_scene(name) for name in dict.fromkeys(args.scene)]
    begun = time.monotonic()
    found = rods.study(scenes, args.n, args.article_n, args.launches, args.seed)
    about = {"launches": args.launches, "seed": args.seed, "took_s": time.monotonic() - begun}
    result = cli.plain({"schema": 1, **about, "context": machine.context(), **found})
    store.write_json(folder / rods.FILE, result)
    paths = rods_pictures.write_pictures(folder, args.article_n)
    with matplotlib.rc_context(STYLE):
        for name, drawing in rods_page.drawings(result).items():
            paths += save(drawing.make(), folder / "figures" / name, drawing.note)
    if args.json:
        cli.emit(result, folder)
    else:
        print("\n".join([*map(rods_page.sentence, [result["own"], *result["rows"]]), *map(str, paths)]))
    bad = [
        r for r in (result["own"], *result["rows"]) if r["rods"]["non_finite"] or r["pixels"]["non_finite"]
    ]
    for row in bad:
        cli.say(f"FAIL rods on {row['scene']}: samples that are not finite")
    return cli.FAILED if bad else cli.OK
