"""Speed against error of roots, exp, log, pow and trigonometry."""

import argparse
import os
import secrets
from pathlib import Path

from study.core import cli, run, show, store
from study.core.cli import Outcome
from study.experiments import running
from study.experiments.functions import coefficients, figures, tables
from study.experiments.functions.measure import QUICK_ROUNDS, QUICK_VECTORS, ROUNDS, study, wrong
from study.experiments.functions.schema import FILE
from study.measuring.function_bench import VECTORS

DESCRIPTION = """\
Instructions, bit tricks, own polynomials, libm, libmvec and SLEEF: ns per element against the largest error
in ulp. Floats of one argument are tried exhaustively (minutes); --quick tries one in thousands (seconds)."""
STATUSES = {1: "an implementation gave no number within its range"}


def options(parser: argparse.ArgumentParser) -> None:
    add, one = parser.add_argument, cli.at_least(1)
    add("--quick", action="store_true", help="one float in thousands, few rounds, small arrays")
    add("--rounds", type=one, help=f"of timing; default: {ROUNDS}")
    add("--vectors", type=cli.at_least(1024), help=f"to normalise at most; default: {VECTORS}")
    jobs = len(os.sched_getaffinity(0))
    add("--jobs", type=one, default=jobs, help="threads of the error search; default: all CPUs")
    add("--seed", type=int, default=secrets.randbelow(2**32), help="of samples and order; default: random")
    add("--cpu", type=int, default=run.FASTEST, help="CPU to pin timing to; default: of a fast core")
    add("--run", type=Path, metavar="DIR", help="for functions.json and figures/; default: build/functions")
    parser.set_defaults(home="functions")
    add("--derive", action="store_true", help="only write common/functions/coefficients.h again")


def measure(args: argparse.Namespace) -> Outcome:
    if args.derive:
        store.write_text(coefficients.FILE, coefficients.header())
        return Outcome({"file": coefficients.FILE}, [coefficients.FILE])
    run.cpu_set(args.cpu, 1)  # says so if there is none such
    folder = running.folder(args, FILE)
    rounds, vectors = ROUNDS, VECTORS
    if args.quick:
        rounds, vectors = QUICK_ROUNDS, QUICK_VECTORS
    how = (args.rounds or rounds, args.vectors or vectors, args.jobs, args.seed, args.cpu)
    result = study(args.quick, *how)
    store.write_json(folder / FILE, result)
    table = show.markdown(show.table(tables.fronts(result), tables.ON_FRONTS))
    drawn = running.draw(folder, figures.drawings(result))
    return Outcome(result, [table, *drawn], folder, failed=wrong(result.entries))
