"""An experiment in shards on a cluster of processes or machines, by Dask; workers check one another."""

from __future__ import annotations

import argparse
from pathlib import Path

from study.core import cli, store
from study.core.cli import Outcome, StudyError
from study.experiments import running
from study.experiments.farm import measure as farm
from study.experiments.farm.schema import FILE, Farm, Mismatch

DESCRIPTION = """\
Splits an experiment that has --shard into shards, and runs each as a command on a worker of one thread. The
joined results are the bytes of one run on one machine. A worker that dies loses its shard and no more.

Some shards are drawn twice, on two workers: one of each worker, and one in a hundred of all. Where the two
differ, a third worker tells which is wrong, and what the wrong one drew is drawn again by others.

What stands behind -- goes to the experiment, as in `farm accuracy --workers 4 -- -n 180`. Dask is no part of
the project: --install puts it into build/farm. docs/scale.md says how to start workers on other machines."""
STATUSES = {
    1: "two results of a shard differ, or a check of the experiment failed",
    3: "no Dask, or no worker",
}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    names = list(farm.able())
    add("experiment", choices=names, metavar="EXPERIMENT", help=f"of {', '.join(names)}")
    many = parser.add_mutually_exclusive_group(required=True)
    many.add_argument("--workers", type=cli.at_least(1), metavar="N", help="N processes of this machine")
    many.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask scheduler, e.g. tcp://10.0.0.1:8786")
    about = "N jobs of Slurm, by dask-jobqueue and its configuration"
    many.add_argument("--slurm", type=cli.at_least(1), metavar="N", help=about)
    add("--shards", type=cli.at_least(1), metavar="N", help="default: one for each unit of work")
    add("--run", type=Path, metavar="DIR", help=f"for its file and {FILE}; default: build/farm")
    add("--install", action="store_true", help="put Dask into build/farm first, if it is not there")
    add("arguments", nargs="*", metavar="ARGUMENTS", help="behind --: of the experiment")
    parser.set_defaults(home="farm")
    # Options may stand between EXPERIMENT and ARGUMENTS.
    parser.parse_args = parser.parse_intermixed_args  # type: ignore[method-assign]


def table(result: Farm) -> str:
    """One line of counts below their names."""
    row = {
        "workers": len(result.workers),
        "shards": result.shards,
        "done": result.done,
        "recomputed": result.recomputed,
        "checked twice": result.drawn_twice,
        "mismatches": len(result.mismatches),
    }
    return "  ".join(row) + "\n" + "  ".join(f"{value:>{len(name)}}" for name, value in row.items())


def told(mismatch: Mismatch, of: int) -> str:
    """A mismatch in a line."""
    first, second, *third = mismatch.workers
    text = f"shard {mismatch.shard}/{of}: workers {first} and {second} have different results"
    if mismatch.odd is not None:
        (agreed,) = third
        return f"{text}; worker {agreed} says that {mismatch.odd} is wrong: what it drew is drawn again"
    return f"{text}; " + (f"worker {third[0]} has a third" if third else "there is no third worker to ask")


def measure(args: argparse.Namespace) -> Outcome:
    count = farm.units(args.experiment, args.arguments)
    if args.shards and args.shards > count:
        raise StudyError(f"--shards {args.shards}: must be at most {count}, the number of units of work")
    python = farm.find_python(args.install)
    folder = running.folder(args)
    cluster = {key: getattr(args, key) for key in ("workers", "scheduler", "slurm")}
    plan = farm.plan(args.experiment, args.arguments, args.shards or count, folder, cluster)
    found = farm.drive(python, plan)
    result = farm.told(args.experiment, args.arguments, found)
    store.write_json(folder / FILE, cli.plain(result))
    failed = [told(one, result.shards) for one in result.mismatches]
    lines = [table(result)]
    if all(found.hashes):
        lines += farm.join(args.experiment, folder, found.hashes)
    else:
        failed.append(f"{args.experiment} is not joined: nobody knows the right result of every shard")
    failed += [line.removeprefix("FAIL ") for line in found.failed]
    return Outcome(result, lines, folder, failed=failed)
