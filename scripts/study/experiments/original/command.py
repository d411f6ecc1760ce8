"""The paper's own program beside this project's phases: fetched, built and timed on this machine."""

from __future__ import annotations

import argparse
import sys

from study.core import cli, machine, registry, store
from study.core.build import build
from study.core.cli import StudyError
from study.experiments import running
from study.experiments.original import measure as original

DESCRIPTION = """\
Fetches the paper's program from its public repository and builds each of its steps by its own makefile. Times
each step and this project's phase of the same step in turn, on one core. Prints the ratio of the times (ours
over theirs) and how far apart the two pictures are. At the paper's size a pair of baselines takes 40 s."""


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION)
    add = parser.add_argument
    phases, scenes = list(original.COMMITS), list(original.SCENES)
    add("--phase", nargs="+", choices=phases, default=phases, metavar="PHASE", help="default: all five")
    add("--scene", nargs="+", choices=scenes, default=scenes, metavar="SCENE", help="default: both")
    running.height(parser, 720, "height of the pictures", least=2)
    add("--repository", default=original.REPOSITORY, metavar="URL", help="default: %(default)s")
    running.options(parser, original.FILE, "original")
    return parser.parse_args()


def main() -> int:
    args = arguments()
    for phase in args.phase:
        if lacking := registry.missing_isa(registry.Spec.parse(phase)):
            raise StudyError(f"{phase} needs {', '.join(lacking)}, which this CPU lacks", cli.CANNOT_RUN)
    folder = running.folder(args)
    kept = original.folder_of(args.repository)
    original.fetch(args.repository, kept)
    programs = {phase: original.build(kept, phase, args.n) for phase in args.phase}
    for phase in args.phase:
        build(phase)
    settings = original.Settings(args.n, args.launches, args.seed)
    kept = original.others(folder / original.FILE, args.n, args.phase, args.scene)
    rows = []
    for phase in args.phase:
        for name in args.scene:
            rows.append(cli.plain(original.measure(programs, registry.find_scene(name), phase, settings)))
            print(original.sentence(rows[-1]), file=sys.stderr if args.json else sys.stdout, flush=True)
            result = {"schema": 1, "repository": original.called(args.repository), "launches": args.launches}
            result |= {"seed": args.seed, "rows": kept + rows, "context": machine.context()}
            store.write_json(folder / original.FILE, result)
    return running.end(args, result, [folder / original.FILE])
