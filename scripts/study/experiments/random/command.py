"""Random scenes and bytes, by seed: what breaks a phase or a reader."""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from study.core import cli, progress
from study.core.cli import Outcome
from study.experiments import running, shards
from study.experiments.random import inputs
from study.experiments.random.schema import Random, Row

DESCRIPTION = """\
Scenes are drawn by tests/hard/test_random_scenes.py, other ones for each seed. They are any scenes, scenes at
the format's limits, and benign ones and groups, on which every phase must see what baseline sees. The readers
are those of tests/fuzz, under ASan and UBSan. `make fuzz MINUTES=60` tries longer: it keeps the inputs that
reached new code, where this command starts anew with each seed."""
FILE = "random.json"
Unit = tuple[str, int]


STATUSES = {cli.FAILED: "an input broke a phase or a reader", cli.CANNOT_RUN: "clang is missing"}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    kinds = inputs.kinds()
    about = f"of {', '.join(kinds)}; default: all"
    add("--kind", nargs="+", choices=kinds, default=kinds, metavar="KIND", help=about)
    add("--seeds", type=cli.at_least(1), default=4, metavar="N", help="of each kind; default: 4")
    add("--first-seed", type=cli.at_least(1), default=1, metavar="K", help="default: 1")
    add("--scenes", type=cli.at_least(1), default=20, metavar="N", help="for each seed; default: 20")
    about = "of a harness for each seed; default: 200000"
    add("--executions", type=cli.at_least(1), default=200_000, metavar="N", help=about)
    add("--run", type=Path, metavar="DIR", help="for random.json; default: build/random")
    cores = len(os.sched_getaffinity(0))
    add("--jobs", type=cli.at_least(1), default=cores, help="seeds tried at a time; default: CPUs")
    parser.set_defaults(home="random")
    shards.option(parser, "pairs of kind and seed")


def units(args: argparse.Namespace) -> list[Unit]:
    """Kinds and seeds. All seeds of a kind are neighbours."""
    seeds = range(args.first_seed, args.first_seed + args.seeds)
    return [(kind, seed) for kind in dict.fromkeys(args.kind) for seed in seeds]


def measure(args: argparse.Namespace) -> Outcome:
    chosen = shards.part(units(args), args.shard)
    folder = running.folder(args, FILE)
    inputs.prepare([kind for kind, _ in chosen])

    def one(unit: Unit) -> Row:
        kind, seed = unit
        if kind in inputs.SCENES:
            return inputs.scenes(kind, seed, args.scenes)
        return inputs.fuzzed(kind, seed, args.executions)

    with ThreadPoolExecutor(args.jobs) as pool:
        rows = list(progress.each(pool.map(one, chosen), "seeds", len(chosen)))
    result = Random(schema=1, rows=rows)
    path = shards.write(folder, FILE, result, args.shard)
    failed = [f"{row.kind}, seed {row.seed}: {row.found}" for row in rows if row.found]
    lines = []
    for kind in dict.fromkeys(row.kind for row in rows):
        tried = [row.tried for row in rows if row.kind == kind]
        lines.append(f"{kind}: {sum(tried):,} inputs by {len(tried)} seeds")
    return Outcome(result, [*lines, path], folder, failed=failed)
