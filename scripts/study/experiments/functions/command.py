"""Speed against error of sqrt, 1/sqrt, exp, log, pow, sin, cos, atan2, acos and of vector normalisation."""

from __future__ import annotations

import argparse
import os
import secrets
from pathlib import Path

import matplotlib

from study.core import cli, registry, run, show, store
from study.experiments.functions import coefficients as functions_coefficients
from study.experiments.functions import figures as functions_figures
from study.experiments.functions import measure as functions
from study.experiments.functions import tables as functions_page
from study.pictures.draw import STYLE

DESCRIPTION = """\
Instructions, bit tricks, own polynomials, libm, libmvec and SLEEF: ns per element against the largest error
in ulp. Floats of one argument are tried exhaustively (minutes); --quick tries one in thousands (seconds)."""


def whole(least: int, most: int) -> object:
    def check(text: str) -> int:
        if not text.isdecimal() or not least <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"'{text}': a whole number from {least} to {most} is required")
        return int(text)

    return check


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "an implementation gave no number within its range"})
    add = parser.add_argument
    add("--quick", action="store_true", help="one float in thousands, few rounds, small arrays")
    add("--rounds", type=whole(1, 1000), help=f"of timing; default: {functions.ROUNDS}")
    add("--vectors", type=whole(1024, 1 << 30), help=f"to normalise at most; default: {functions.VECTORS}")
    add("--jobs", type=whole(1, 1024), help="threads of the error search; default: all CPUs")
    add("--seed", type=whole(0, 2**63), help="of samples and order; default: random")
    add("--cpu", type=int, default=run.FASTEST, help="CPU to pin timing to; default: of a fast core")
    add("--run", type=Path, metavar="DIR", help="for functions.json and figures/; default: build/functions")
    add("--derive", action="store_true", help="only write common/functions/coefficients.h again")
    return parser.parse_args()


def main() -> int:
    args = arguments()
    if args.derive:
        store.write_text(functions_coefficients.FILE, functions_coefficients.header())
        print(functions_coefficients.FILE)
        return cli.OK
    run.cpu_set(args.cpu, 1)  # says so if there is none such
    folder = store.writable(args.run or registry.ROOT / "build" / "functions")
    quick = args.quick
    result = functions.study(
        quick,
        args.rounds or (functions.QUICK_ROUNDS if quick else functions.ROUNDS),
        args.vectors or (functions.QUICK_VECTORS if quick else functions.VECTORS),
        args.jobs or len(os.sched_getaffinity(0)),
        secrets.randbelow(2**32) if args.seed is None else args.seed,
        args.cpu,
        cli.say,
    )
    store.write_json(folder / functions.FILE, result)
    with matplotlib.rc_context(STYLE):
        files = functions_figures.save_all(result, folder / "figures")
    if args.json:
        cli.emit(result, folder)
    else:
        print(show.markdown(show.table(functions_page.fronts(result), functions_page.ON_FRONTS)))
        print("\n".join(map(str, files)))
    bad = functions.wrong(result["entries"])
    for sentence in bad:
        cli.say(f"FAIL {sentence}")
    return cli.FAILED if bad else cli.OK
