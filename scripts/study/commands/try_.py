"""A phase beside its parent within a minute: speed, error, work, what changed."""

import argparse
import contextlib
import math
import secrets
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from study.bounds import work
from study.core import cli, patches, registry, show
from study.core.build import build, build_together
from study.core.cli import Outcome, StudyError
from study.core.registry import Scene, Spec
from study.core.run import FASTEST, USABLE, DriverError, frames, interleaved, render
from study.counting import flops
from study.counting.schema import Declared
from study.numbers import stats
from study.numbers.accuracy import Row
from study.numbers.stats import Interval
from study.pictures import gate, images, panels
from study.pictures.gallery import Gallery
from study.truth import judging
from study.truth.subject import FLOAT, Subject

DESCRIPTION = """\
Builds NAME and its parent (--against) and shows them side by side: the time of a frame, interleaved, and its
ratio; errors to ground truth and to baseline; evaluations, FLOPs, lanes at work and calls of functions; which
tolerance fails. A strip of both pictures and their difference goes to build/try. With --watch it does so
again whenever a file of the two is saved."""
FOLDER = registry.ROOT / "build" / "try"
BASE = Spec("baseline", "baseline")
SIZES = (720, 540, 360, 270, 180, 90)  # heights of what is timed
FRAME = 0.1  # s that a timed frame may take: ten launches of both fit half a minute
POLL = 0.5  # s between two looks at the files
CHANGED = 0.001  # of calls: less is not listed
LISTED = 12  # functions
DOUBT = ' The interval holds 1: no difference can be told. More launches narrow it: ARGS="--launches 30".'


@dataclass(frozen=True)
class Side:
    """What is known of one phase: its row against ground truth, its metrics against baseline, what of its
    tolerance fails, evaluations of the scene by a camera ray, and by the counting build evaluations of a
    shape (a ray's, over all rays of a pixel), FLOPs by whose costs.def, lanes and calls."""

    name: str
    truth: Row
    baseline: dict[str, Any]
    fails: list[str]
    evaluations: float
    shape_evaluations: float = math.nan
    ms: Interval | None = None
    flops: int | None = None
    costs: str = ""
    lanes_at_work: float | None = None
    parts: dict[str, Any] | None = None
    calls: dict[str, int] | None = None


@dataclass(frozen=True)
class Compared:
    """What is shown: sizes of the pictures and of what is timed, both sides, the parent first, and calls."""

    scene: str
    width: int
    height: int
    timed_width: int
    timed_height: int
    launches: int
    seed: int
    ratio: Interval
    sides: list[Side]
    same_bits: bool
    calls: list[tuple[str, int, int]] | None
    picture: str
    schema: int = 1


Sides = tuple[Spec, Spec]  # what is compared, the parent first


STATUSES = {cli.FAILED: "the phase is outside its tolerance"}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("name", metavar="PHASE", help="a phase, or an ablation like opt2+title")
    add("--against", metavar="PHASE", help="default: the parent that its phase.json names")
    add("--scene", default="scene0", metavar="SCENE", help="default: scene0")
    add("-n", type=cli.at_least(16), default=180, metavar="HEIGHT", help="of the pictures; default: 180")
    add("--launches", type=cli.at_least(1), default=10, help="process launches of each; default: 10")
    add("--seed", type=int, default=secrets.randbelow(2**32), help="of order and padding; default: random")
    add("--watch", action="store_true", help="again at every save, until Ctrl-C")


def sides(name: str, against: str | None) -> Sides:
    """Raises StudyError for a phase without a parent, and for one that this CPU cannot run."""
    mine = Spec.parse(name)
    parent = against or registry.parent_of(name)
    if not parent or parent == name:
        raise StudyError(f"{name} needs another phase beside it; name one with --against")
    both = Spec.parse(parent), mine
    for spec in both:
        if lacking := registry.missing_isa(spec):
            raise StudyError(f"{spec} needs {', '.join(lacking)}, which this CPU lacks", cli.CANNOT_RUN)
    return both


def timed_height(both: Sequence[Spec], scene: Scene) -> int:
    """The largest height whose frame by each takes FRAME; by a frame of the least."""
    least = SIZES[-1]
    slowest = 0
    for spec in both:
        found = render(spec, scene.path, least, scene.size(least)[0], cpu=FASTEST)
        slowest = max(slowest, found["frames"][0]["ns"])
    return next((n for n in SIZES if slowest * (n / least) ** 2 <= FRAME * 1e9), least)


def times(
    both: Sequence[Spec], scene: Scene, height: int, launches: int, seed: int, threads: int = 1
) -> dict[Spec, list[float]]:
    """Milliseconds of a frame, per launch the median of three. Raises DriverError."""

    def once(spec: Spec, padding: int) -> float:
        width, cpu = scene.size(height)[0], FASTEST
        how = {"cpu": cpu, "threads": threads, "env_bytes": padding}
        made = frames(spec, scene.path, height, width, **how, reps=3, warmup=1)
        with contextlib.closing(made):
            return float(np.median([frame["ns"] / 1e6 for frame in made if not frame["warmup"]]))

    return interleaved(both, launches, seed, FASTEST, once, "time")


def counted(spec: Spec, scene: Scene, height: int) -> Declared | None:
    """FLOPs, calls and lanes by the counting build; None, with a word, where that cannot be built or run."""
    try:
        return flops.declared(spec, scene, height)
    except (StudyError, DriverError) as error:
        cli.say(f"no counts of {spec}: {str(error).splitlines()[0]}")
        return None


def errors(both: Sides, scene: Scene, height: int) -> tuple[dict[Spec, Side], bool, Path]:
    """Each phase's row against ground truth (as stepwise accuracy has it), its metrics against baseline and
    what fails; whether both pictures have the same bits; and the strip of pictures. Raises StudyError where
    one cannot draw the scene.
    """
    size = scene.size(height)
    plain = judging.without_shadows(scene, FOLDER / "scenes")
    beside = [FLOAT] if scene.fractal else []
    specs = list(dict.fromkeys([BASE, *beside, *both]))
    gallery = Gallery(FOLDER / "images", specs)
    refused = gallery.render_all([(spec, one, size) for spec in specs for one in (scene, plain)], 2)
    if refused:
        raise StudyError(str(next(iter(refused.values()))))
    subject = Subject(gallery, scene, plain, size, beside)
    pictures = {spec: images.read(gallery.path(spec, scene, size)) for spec in specs}
    found = {}
    for spec in both:
        row, phase = subject.row(spec), registry.find_phase(spec.phase)
        pair = (pictures[BASE], pictures[spec])
        to_base = images.compare(*pair, pair if scene.fractal else None)
        declared = gate.tolerance(phase, scene)
        fails = list(row.why) if row.failed else []
        if declared is not None:
            fails += [f"{name}: {why}" for name, why in gate.failures(to_base, declared).items()]
        evaluations = float(np.nanmean(pictures[spec]["evals"]))
        found[spec] = Side(str(spec), row, to_base, fails, evaluations)
    parent, mine = both
    pair, names = (pictures[parent], pictures[mine]), (str(parent), str(mine))
    metrics, bad = images.compare(*pair), bool(found[mine].fails)
    title = f"{scene.name}, {size[0]}×{size[1]} pixels: {mine} beside {parent}"
    notes = ("", "", "outside its tolerance" if bad else "within its tolerance")
    path = FOLDER / f"{mine}-{scene.name}.png"
    drawn = panels.save(panels.pair(pair, names, title, metrics, notes, bad), path)
    return found, bool(metrics["identical"]), drawn


def calls(parent: Declared, mine: Declared) -> list[tuple[str, int, int]]:
    """Function, calls by the parent and by the phase, where they differ; the largest difference first."""
    old, new = ({name: one.calls for name, one in c.by_function.items()} for c in (parent, mine))
    rows = [(name, old.get(name, 0), new.get(name, 0)) for name in old.keys() | new.keys()]
    rows = [row for row in rows if abs(row[2] - row[1]) > CHANGED * max(row[1:])]
    return sorted(rows, key=lambda row: -abs(row[2] - row[1]))


def stated_by(name: str) -> str:
    """The owner of the costs.def that the phase or ablation has: itself, or the nearest it derives from."""
    for patch in reversed(patches.chain(name)):
        if "+++ b/costs.def" in patch.diff:
            return patch.name
    return registry.find_phase(name.partition("+")[0]).file("costs.def").parent.name


def compared(args: argparse.Namespace) -> Compared:
    both, scene = sides(args.name, args.against), registry.find_scene(args.scene)
    targets = [(spec, target) for spec in both for target in ("render", "render-count")]
    build_together([*targets, (BASE, "render")], len(USABLE))
    for spec in (*both, BASE):
        build(spec)
    found, same, strip = errors(both, scene, args.n)
    untimed = getattr(args, "untimed", False)
    height = args.n if untimed else timed_height(both, scene)
    ms = None if untimed else times(both, scene, height, args.launches, args.seed)
    counts = [counted(spec, scene, args.n) for spec in both]
    made = []
    for spec, counts_of in zip(both, counts, strict=True):
        side = replace(found[spec], ms=stats.median_interval(ms[spec]) if ms else None)
        if counts_of:
            parts = {name: one.parts for name, one in counts_of.by_function.items()}
            machine = counts_of.flops.machine if counts_of.flops else None
            calls_of = {name: one.calls for name, one in counts_of.by_function.items()}
            side = replace(side, flops=machine, costs=stated_by(spec.phase), parts=parts, calls=calls_of)
            shapes = work.evaluations(counts_of.by_function)
            side = replace(
                side, shape_evaluations=shapes / found[spec].truth.width / found[spec].truth.height
            )
            side = replace(side, lanes_at_work=work.efficiency(counts_of))
        made.append(side)
    (width, n), timed = scene.size(args.n), scene.size(height)
    return Compared(
        scene=scene.name,
        width=width,
        height=n,
        timed_width=timed[0],
        timed_height=timed[1],
        launches=args.launches,
        seed=args.seed,
        ratio=stats.ratio_interval(*(ms[spec] for spec in both)) if ms else stats.UNKNOWN,
        sides=made,
        same_bits=same,
        calls=calls(*counts) if all(counts) else None,
        picture=str(strip),
    )


def cells(side: Side) -> dict[str, str]:
    truth, base = side.truth, side.baseline
    decibels, means = truth.shown.psnr_db, truth.of
    declared = show.NOTHING
    if side.flops is not None:
        declared = show.number(side.flops / truth.width / truth.height, 4)
        inherited = side.costs != side.name.partition("@")[0]
        declared += f", by {side.costs}'s costs.def" * inherited
    lanes = show.NOTHING if side.lanes_at_work is None else show.percent(side.lanes_at_work)
    return {
        "time of a frame, ms [95 %]": show.spread(side.ms, 4),
        "PSNR to ground truth, dB": ("identical" if decibels == math.inf else show.number(decibels)) + means,
        "wrong hits, ppm of the pixels": show.number(truth.wrong_ppm),
        "PSNR to baseline, dB": "identical" if base["identical"] else show.number(base["psnr_db"]),
        "pixels off by more than 1/255 to baseline": show.percent(base["fraction_over_1_255"]),
        "evaluations of a camera ray": show.number(side.evaluations, 4),
        "evaluations of a shape, a pixel": show.number(side.shape_evaluations, 4),
        "declared FLOPs a pixel": declared,
        "lanes at work": lanes,
    }


def text(result: Compared) -> str:
    """Text for people: a table of both sides, then calls that changed, what fails, and the strip."""
    parent, mine = result.sides
    left, right = cells(parent), cells(mine)
    wide = [max(map(len, column)) for column in (left, [parent.name, *left.values()])]
    ratio = result.ratio
    lines = [
        f"{result.scene}: pictures and counts {result.width}×{result.height}, "
        f"times {result.timed_width}×{result.timed_height}, one thread, {result.launches} launches",
        "",
        f"{'':{wide[0]}}  {parent.name:{wide[1]}}  {mine.name}",
        *(f"{name:{wide[0]}}  {left[name]:{wide[1]}}  {right[name]}" for name in left),
        "",
        f"{mine.name} is {show.spread(ratio, 3, '×')} as fast as {parent.name}.{DOUBT * doubtful(ratio)}",
    ]
    if result.calls is not None:
        lines += ["", "Calls that changed (--json has all):" if result.calls else "No counted call changed."]
        lines += [f"  {name}: {old:,} → {new:,}" for name, old, new in result.calls[:LISTED]]
    lines += ["", f"{mine.name} is {'outside' if mine.fails else 'within'} its tolerance."]
    return "\n".join([*lines, *(f"  {why}" for why in mine.fails), f"Pictures: {result.picture}"])


def doubtful(ratio: Interval) -> bool:
    return ratio.sufficient and ratio.low <= 1 <= ratio.high


def files(both: Sides) -> dict[Path, float]:
    """The sources, patches and phase.json of both, and their folders, with the time of their last change."""
    found = {}
    for spec in both:
        base = spec.phase.partition("+")[0]
        folder = registry.find_phase(base).path
        changes = [patch.path for patch in patches.chain(spec.phase)]
        for path in [*patches.files(base).values(), *changes, folder, folder / "phase.json"]:
            with contextlib.suppress(OSError):
                found[path] = path.stat().st_mtime
    return found


def watch(args: argparse.Namespace) -> Outcome:
    """Again at every save; each time in a process of its own, which builds anew."""
    both = sides(args.name, args.against)
    words = [args.name, "--against", both[0], "--scene", args.scene, "-n", args.n]
    words += ["--launches", args.launches, "--seed", args.seed, *["--json"] * args.json]
    while True:
        seen = files(both)
        command = [sys.executable, registry.ROOT / "scripts" / "stepwise", "try", *map(str, words)]
        subprocess.run(command, check=False)
        cli.say("watching; Ctrl-C ends")
        while files(both) == seen:
            time.sleep(POLL)
            registry.phases.cache_clear()


def run(args: argparse.Namespace) -> Outcome:
    if args.watch:
        return watch(args)
    result = compared(args)
    status = cli.FAILED if result.sides[1].fails else cli.OK
    return Outcome(result, [text(result)], status=status)
