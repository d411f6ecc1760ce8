"""Rod marching against per-pixel marching: time, evaluations, error."""

from __future__ import annotations

import argparse

from study.core import registry
from study.core.cli import Outcome
from study.experiments import running
from study.experiments.rods import pictures, tables
from study.experiments.rods.measure import ARTICLE, SCENE, beside, trade
from study.experiments.rods.schema import FILE, Rods
from study.measuring import hit_tables

DESCRIPTION = """\
The article's two pictures by rods and by rays: two_spheres, 800×800, 20 steps; the same on every scene; and
the number of starting rods and the step cap against time and error. Launches time the march alone."""
STATUSES = {1: "a picture has samples that are not finite"}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--scene", nargs="+", default=list(registry.scenes()), metavar="SCENE", help="default: all")
    running.height(parser, 180, "height of every scene's pictures")
    running.height(parser, ARTICLE.size, "of the article's", "--article-n")
    running.options(parser, f"{FILE}, images/", "systems", 2, "the order")


def measure(args: argparse.Namespace) -> Outcome:
    folder = running.folder(args, FILE)
    scenes = [registry.find_scene(name) for name in dict.fromkeys(args.scene)]
    how = (args.launches, args.seed)
    own = beside(registry.find_scene(SCENE), args.article_n, *how)
    rows = [beside(scene, args.n, *how, 1) for scene in scenes]
    traded, pixels = trade(args.article_n, *how)
    found = {"article": ARTICLE, "own": own, "rows": rows, "trade": traded, "trade_pixels": pixels}
    result = Rods(**running.about(args), **found)
    ways = [(f"rods on {row.scene}", one) for row in (own, *rows) for one in (row.rods, row.pixels)]
    made = pictures.write_pictures(folder, args.article_n)
    failed = hit_tables.not_finite(ways)
    return running.end(folder / FILE, result, tables.parts(result), images=made, failed=failed)
