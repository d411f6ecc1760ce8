"""Rod marching against per-pixel marching: the article's pictures, time, evaluations, error on all scenes."""

from __future__ import annotations

import argparse

from study.core import cli, registry
from study.experiments import running
from study.experiments.rods import measure as rods
from study.experiments.rods import pictures as rods_pictures
from study.experiments.rods import tables as rods_page

DESCRIPTION = """\
The article's two pictures by rods and by rays: two_spheres, 800×800, 20 steps. Launches are interleaved and
time the march alone. Also: evaluations, the error of both to ground truth, the same on every scene, and the
trade-off that the article left open (number of starting rods and step cap against time and error)."""


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "a picture has samples that are not finite"})
    add = parser.add_argument
    add("--scene", nargs="+", default=list(registry.scenes()), metavar="SCENE", help="default: all")
    running.height(parser, 180, "height of every scene's pictures")
    running.height(parser, rods.ARTICLE["size"], "of the article's", "--article-n")
    running.options(parser, "rods.json, images/, figures/", "systems", 2, "the order")
    return parser.parse_args()


def main() -> int:
    args = arguments()
    folder = running.folder(args)
    scenes = [registry.find_scene(name) for name in dict.fromkeys(args.scene)]
    found = rods.study(scenes, args.n, args.article_n, args.launches, args.seed)
    result = running.write(folder / rods.FILE, {"launches": args.launches, "seed": args.seed}, found)
    paths = rods_pictures.write_pictures(folder, args.article_n)
    paths += running.draw(folder, rods_page.drawings(result))
    rows = [result["own"], *result["rows"]]
    bad = [row["scene"] for row in rows if row["rods"]["non_finite"] or row["pixels"]["non_finite"]]
    failed = [f"rods on {scene}: samples that are not finite" for scene in bad]
    return running.end(args, result, [*map(rods_page.sentence, rows), *paths], failed)
