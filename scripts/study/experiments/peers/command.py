"""Our phases beside other renderers: time and error in one run."""

import argparse

from study.core import cli, registry, run, store
from study.core.build import build
from study.core.cli import Outcome, StudyError
from study.core.registry import Spec
from study.experiments import running
from study.experiments.peers import peer, tables
from study.experiments.peers.measure import PHASES, Measuring, plain, points
from study.experiments.peers.peer import Peer
from study.numbers.beside import PEERS, Peers, Program
from study.numbers.schema import Skipped

DESCRIPTION = """\
Draws scenes without shadows and mirrors by our phases and by other programs: POV-Ray, Embree, Dr.Jit,
Taichi, fidget, and OpenGL and OpenCL on the CPU by Mesa's llvmpipe and PoCL. A program that is not there is
left out by name. --install puts those from PyPI and crates.io into build/peers; Debian's packages are
named."""
SAID = ("timed", "differs", "least_db")  # what a Program has of its Peer
STATUSES = {cli.FAILED: "a picture is wrong", cli.CANNOT_RUN: "none of the other programs can run here"}


def options(parser: argparse.ArgumentParser) -> None:
    add, every = parser.add_argument, list(peer.find_all())
    add("--peer", nargs="+", choices=every, metavar="PEER", help=f"default: all, {', '.join(every)}")
    add("--phase", nargs="+", metavar="PHASE", help=f"of ours; default: {', '.join(PHASES)}")
    names = sorted({scene for one in peer.find_all().values() for scene in one.least_db})
    about = f"default: {', '.join(names)}"
    add("--scene", nargs="+", default=names, choices=names, metavar="SCENE", help=about)
    running.height(parser, 360)
    running.height(parser, 180, "height of the pictures that are judged", "--error-n")
    add("--threads", type=cli.at_least(1), nargs="+", help="default: 1 and all CPUs")
    add("--cpu", type=int, default=run.FASTEST, help="first CPU to pin to; default: of a fast core")
    add("--install", action="store_true", help="put what comes from PyPI and crates.io into build/peers")
    running.options(parser, PEERS, "peers")


def others(args: argparse.Namespace) -> tuple[dict[str, Peer], list[Skipped]]:
    able, out = {}, []
    for name, one in peer.find_all().items():
        if name not in (args.peer or peer.find_all()):
            continue
        failed = None
        try:
            if args.install:
                one.install()
        except StudyError as error:
            failed = str(error)
        needed = one.lacking()
        if needed is None:
            able[name] = one
        else:
            out.append(Skipped(phase=one.title, reason=failed or needed))
    return able, out


def measure(args: argparse.Namespace) -> Outcome:
    folder = running.folder(args, PEERS)
    run.cpu_set(args.cpu, 1)
    threads = args.threads or [1, len(run.USABLE)]
    if max(threads) > len(run.USABLE):
        raise StudyError(f"--threads {max(threads)}: there are {len(run.USABLE)} CPUs")
    scenes = {name: plain(name, peer.HOME / "scenes") for name in args.scene}
    specs = [Spec.parse(name) for name in dict.fromkeys(args.phase or PHASES)]
    specs = [spec for spec in specs if registry.cpu_supports(spec)]
    able, out = others(args)
    for one in out:
        cli.say(f"left out: {one.phase}: {one.reason}")
    planned = points(specs, able, scenes, threads)
    if not planned:
        what = "draws these scenes" if able else "is here; --install gets what it can"
        raise StudyError(f"none of the other programs {what}", cli.CANNOT_RUN)
    for program in dict.fromkeys(point.program for point in planned if point.program not in able):
        build(program)
    work = Measuring(able, scenes, args.n, args.cpu)
    told, failed = work.judged(planned, args.error_n)
    planned = [point for point in planned if (point.program, point.scene) in told]
    times = run.interleaved(planned, args.launches, args.seed, args.cpu, work.once)
    drew = [(one, work.versions[name]) for name, one in able.items() if name in {p.program for p in planned}]
    result = Peers(
        **running.about(args),
        n=args.n,
        error_n=args.error_n,
        programs=[
            Program(program=one.title, version=version, **{name: getattr(one, name) for name in SAID})
            for one, version in drew
        ],
        rows=work.rows(times, told),
        left_out=out + failed,
    )
    store.write_json(folder / PEERS, result)
    lines = [one.markdown for one in tables.parts(result)]
    return Outcome(result, lines, folder, failed=tables.wrong(result))
