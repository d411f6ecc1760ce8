"""The paper's own program, built and timed beside our phases."""

from __future__ import annotations

import argparse

from study.core import cli, registry, store
from study.core.build import build
from study.core.cli import Outcome, StudyError
from study.experiments import running
from study.experiments.original import measure as original
from study.numbers.beside import ORIGINAL, Original

DESCRIPTION = """\
Fetches the paper's program from its public repository and builds each of its steps by its own makefile. Times
each step and this project's phase of the same step in turn, on one core. Prints the ratio of the times (ours
over theirs) and how far apart the two pictures are. At the paper's size a pair of baselines takes 40 s."""


def options(parser: argparse.ArgumentParser) -> None:
    add, phases = parser.add_argument, list(original.COMMITS)
    add("--phase", nargs="+", choices=phases, default=phases, metavar="PHASE", help="default: all five")
    about = "a scene file of its repository; default: %(default)s"
    add("--scene", nargs="+", default=list(original.SCENES), metavar="SCENE", help=about)
    running.height(parser, 720, "height of the pictures", least=2)
    add("--repository", default=original.REPOSITORY, metavar="URL", help="default: %(default)s")
    running.options(parser, ORIGINAL, "original")


def measure(args: argparse.Namespace) -> Outcome:
    for phase in args.phase:
        if lacking := registry.missing_isa(registry.Spec.parse(phase)):
            raise StudyError(f"{phase} needs {', '.join(lacking)}, which this CPU lacks", cli.CANNOT_RUN)
    folder = running.folder(args, ORIGINAL)
    kept = original.folder_of(args.repository)
    original.fetch(args.repository, kept)
    programs = {phase: original.build(kept, phase, args.n) for phase in args.phase}
    scenes = [original.scene_of(name, programs.values()) for name in args.scene]
    for phase in args.phase:
        build(phase)
    path = folder / ORIGINAL
    rows = original.others(path, args.n, args.phase, args.scene)
    repository = original.called(args.repository)
    for phase in args.phase:
        for scene in scenes:
            rows.append(original.measure(programs[phase], scene, phase, args))
            cli.say(original.sentence(rows[-1]))
            result = Original(**running.about(args), repository=repository, rows=rows)
            store.write_json(path, result)
    return Outcome(result, [path], folder)
