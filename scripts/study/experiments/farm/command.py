"""An experiment in shards on a cluster of processes or machines, by Dask."""

import argparse
from pathlib import Path

from study.core import cli, store
from study.core.cli import Outcome, StudyError
from study.experiments import running
from study.experiments.farm.measure import able, drive, find_python, join, plan, units
from study.experiments.farm.schema import FILE, Farm

DESCRIPTION = """\
Splits an experiment that has --shard into shards, and runs each as a command on a worker of one thread. The
joined results are the bytes of one run on one machine. A worker that dies loses its shard and no more.

What stands behind -- goes to the experiment, as in `farm accuracy --workers 4 -- -n 180`. Dask is no part of
the project: --install puts it into build/farm. docs/scale.md says how to start workers on other machines."""
STATUSES = {1: "a check of the experiment failed", 3: "no Dask, or no worker"}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    names = list(able())
    add("experiment", choices=names, metavar="EXPERIMENT", help=f"of {', '.join(names)}")
    many = parser.add_mutually_exclusive_group(required=True)
    many.add_argument("--workers", type=cli.at_least(1), metavar="N", help="N processes of this machine")
    many.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask scheduler, e.g. tcp://10.0.0.1:8786")
    add("--shards", type=cli.at_least(1), metavar="N", help="default: one for each unit of work")
    add("--run", type=Path, metavar="DIR", help=f"for its file and {FILE}; default: build/farm")
    add("--install", action="store_true", help="put Dask into build/farm first, if it is not there")
    add("arguments", nargs="*", metavar="ARGUMENTS", help="behind --: of the experiment")
    parser.set_defaults(home="farm")
    # Options may stand between EXPERIMENT and ARGUMENTS.
    parser.parse_args = parser.parse_intermixed_args  # type: ignore[method-assign]


def measure(args: argparse.Namespace) -> Outcome:
    words, most = args.arguments, units(args.experiment, args.arguments)
    count = args.shards or most
    if count > most:
        raise StudyError(f"--shards {count}: must be at most {most}, the number of units of work")
    python = find_python(args.install)
    folder = running.folder(args, FILE)
    told = plan(args.experiment, words, count, folder, args.workers, args.scheduler)
    found = drive(python, told)
    about = {"experiment": args.experiment, "arguments": words, "shards": count}
    result = Farm(schema=1, **about, workers=found.workers, seconds=found.seconds)
    store.write_json(folder / FILE, cli.plain(result))
    lines = [f"worker {one.name}: {one.shards} of {count} shards" for one in result.workers]
    lines += join(args.experiment, folder, count)
    return Outcome(result, lines, folder, failed=[line.removeprefix("FAIL ") for line in found.failed])
