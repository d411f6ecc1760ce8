"""Measures what one core can do at best: arithmetic and bandwidth. That takes five seconds, half a
minute where it is disturbed."""

from __future__ import annotations

import argparse
from pathlib import Path

from study.bounds import ceilings
from study.bounds.ceilings import BANDWIDTH, COMPUTE, grid
from study.core import cli, show, store
from study.core.cli import Outcome
from study.core.run_schema import Context


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--run", type=Path, metavar="DIR", help="for ceilings.json; default: the newest run")
    parser.add_argument("--cpu", type=int, help="CPU to pin to; default: of a fast core")
    parser.add_argument("--samples", type=int, metavar="N", help="of each ceiling, 5 to 1000; default: 30")


def measure(args: argparse.Namespace) -> Outcome:
    target = store.Run.open(args.run) if args.run else store.latest()
    context = Context.load_if_there(target.path / "context.json") or Context()
    ceilings.refuse(target.path, context.cpu)
    measured = ceilings.measure(args.cpu, args.samples)
    path = target.path / ceilings.FILE
    store.write_json(path, measured)
    tables = [
        f"{title}\n\n{show.markdown(show.table(grid(measured, by), columns))}"
        for by, title, columns in (
            ("precision", "flop per core cycle", COMPUTE),
            ("level", "bytes per core cycle", BANDWIDTH),
        )
    ]
    return Outcome(cli.plain(measured) | {"file": path}, [*tables, path], target.path, measured.remarks())
