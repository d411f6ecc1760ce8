"""Times phases in interleaved launches."""

import argparse
import contextlib
import itertools
import math
import os
import random
import re
import secrets
import time
from pathlib import Path
from typing import Any

import msgspec

from study.core import cli, machine, progress, run, store
from study.core.build import build
from study.core.cli import Outcome, StudyError
from study.core.host import energy, quotas
from study.core.registry import Spec, find_scene, ladder
from study.core.run import DriverError
from study.core.run_schema import Configuration, End, Left, Plan, Short
from study.experiments.sweep.plan import fail, make_plan, now, overrides, sha256
from study.numbers import analysis, noise, summary
from study.numbers.stats import FEWEST

DESCRIPTION = """\
Times phases on scenes and sizes. A round launches every configuration once, in random order, pinned to one
CPU and with an environment of random size. So all phases of a comparison share the same stretch of time.
Rounds go on to --launches or to the end of --budget. When all phases of the ladder are swept, opt2 is also
measured with the flags of the others (the second base).

Each frame is a line of results/MACHINE/RUN/frames.jsonl, on disk before the next one. After a kill,
`--run DIR --resume` goes on: a launch that was cut off keeps its whole frames, and a further process measures
only the timed frames that it lacks."""
STATUSES = {
    cli.OK: "measured (what the budget did not reach is said)",
    cli.FAILED: "a driver crashed; the rest is measured",
}
MOST_CRASHES = 2  # of one configuration in one session, then it is given up
LARGEST_SIDE, LARGEST_PIXELS = 32768, 1 << 28  # the driver's


def size(text: str) -> tuple[int | None, int]:
    """`720` or `800x800` as (width or None, height) in pixels."""
    match = re.fullmatch(r"(?:([0-9]{1,6})x)?([0-9]{1,6})", text)
    width, height = (int(side) if side else None for side in match.groups()) if match else (0, 0)
    wide = height * 16 / 9 if width is None else width
    if not (0 < wide <= LARGEST_SIDE and 0 < height <= LARGEST_SIDE and wide * height <= LARGEST_PIXELS):
        raise argparse.ArgumentTypeError(
            f"'{text}': a height like 720 or WIDTHxHEIGHT like 800x800, sides of 1 to {LARGEST_SIDE} pixels"
            f" and at most {LARGEST_PIXELS} pixels in all"
        )
    return width, height


PLANNED: dict[str, Any] = {  # option of a new run's plan → default
    "phase": None,
    "scene": ["scene0", "mandelbulb"],
    "n": [(None, 180)],
    "threads": [1],
    "reps": 3,
    "launches": 10,
    "warmup": 1,
    "long": None,
    "few": None,
    "seed": None,
    "cpu": run.FASTEST,
    "hit_distance": None,
    "max_steps": None,
    "second_base": None,
    "results": store.RESULTS,
}


def options(parser: argparse.ArgumentParser) -> None:
    whole, natural = cli.at_least(1), cli.at_least(0)
    add = parser.add_argument_group("plan").add_argument
    add("--phase", nargs="+", metavar="PHASE", help="like opt3 or opt2@opt4; default: all")
    add("--scene", nargs="+", metavar="SCENE", help="default: scene0 mandelbulb")
    add("-n", nargs="+", type=size, metavar="HEIGHT", help="or WIDTHxHEIGHT; default: 180")
    add("--threads", nargs="+", type=whole, help="default: 1")
    add("--reps", type=whole, metavar="R", help="timed frames per launch; default: 3")
    add("--launches", type=whole, help="process launches; default: 10")
    add("--warmup", type=natural, metavar="K", help="frames before those; default: 1")
    about = "a frame longer than that warms itself up: one per launch, no warm-up"
    add("--long", type=cli.at_least(0, float), metavar="SECONDS", help=about)
    about = f"a frame longer than that has {FEWEST} launches, spread over the rounds"
    add("--few", type=cli.at_least(0, float), metavar="SECONDS", help=about)
    add("--seed", type=natural, help="of order and padding; default: random")
    add("--cpu", type=natural, help="CPU to pin to; default: of a fast core")
    add("--hit-distance", type=cli.at_least(1e-300, float), metavar="X", help="in scene units")
    add("--max-steps", type=whole, metavar="K", help="evaluations per ray")
    about = "opt2@PHASE beside each PHASE with other flags; default: where all of the ladder is swept"
    add("--second-base", action=argparse.BooleanOptionalAction, help=about)
    add("--results", type=Path, metavar="DIR", help="parent of the run's folder")
    add = parser.add_argument
    add("--run", type=Path, metavar="DIR", help="the run to go on with, by its own plan")
    add("--resume", action="store_true", help="go on with the run at --run")
    add("--budget", type=cli.at_least(0, float), metavar="SECONDS", help="stop after that")
    add("--dry-run", action="store_true", help="print plan and duration, measure nothing")


def with_defaults(args: argparse.Namespace) -> argparse.Namespace:
    """The arguments with what was not given. StudyError where they contradict one another."""
    if args.resume != (args.run is not None):
        raise StudyError("--run DIR --resume goes on with a run; without both, a new run is made")
    given = [name for name in PLANNED if getattr(args, name) is not None]
    if args.run and given:
        name = f"-{given[0]}" if given[0] == "n" else f"--{given[0].replace('_', '-')}"
        raise StudyError(f"--resume goes on by the run's own plan, which {name} cannot change")
    made = argparse.Namespace(**vars(args) | {k: value for k, value in PLANNED.items() if k not in given})
    names = list(ladder())
    made.phase = made.phase or names
    made.seed = secrets.randbelow(2**32) if made.seed is None else made.seed
    if made.second_base is None:
        made.second_base = set(names) <= set(made.phase)
    return made


class Drawn(msgspec.Struct):
    schema: int
    scene_hash: str
    frame: int
    warmup: bool


class Sweep:
    """The measuring of one run: what is there, what is missing, what still fits into the budget."""

    def __init__(self, target: store.Run | None, plan: Plan, budget: float | None) -> None:
        self.run, self.plan = target, plan
        self.configs = plan.configurations
        self.frames: dict[tuple[str, int], set[int]] = {}  # (config, launch) -> numbers of its frames
        self.seconds: dict[str, list[float]] = {}  # config -> durations of this process's launches
        self.crashes: dict[str, int] = {}
        self.rounds = 0  # of those who measured into this run before
        self.now = 0  # the round: a launch that is made up for is of another than its number says
        self.deadline = time.monotonic() + (float("inf") if budget is None else budget)

    def load(self) -> float:
        """Learn from frames.jsonl what is measured already. Returns the seconds that went into it."""
        assert self.run
        lines = self.run.lines()
        for one in lines:
            self.frames.setdefault((one.config, one.launch), set()).add(one.frame)
        rounds = [one.launch if one.round is None else one.round for one in lines]
        self.rounds = max(rounds, default=-1) + 1
        return sum(one.ns + one.present_ns for one in lines) / 1e9

    def reps(self, config: Configuration) -> int:
        """Timed frames of a launch."""
        return 1 if config.once else self.plan.reps

    def timed(self, config: Configuration, launch: int) -> int:
        """Timed frames there are; those of the warm-up have negative numbers."""
        return sum(frame >= 0 for frame in self.frames.get((config.config, launch), ()))

    def done(self, config: Configuration) -> int:
        """Whole launches; launches come one after the other, so it is also the next one's number."""
        launches = self.launches(config)
        return next((n for n in range(launches) if self.timed(config, n) < self.reps(config)), launches)

    def launches(self, config: Configuration) -> int:
        return min(config.launches or self.plan.launches, self.plan.launches)

    def due(self, config: Configuration, rounds: int) -> bool:
        """Whether it lacks a launch after so many rounds; fewer launches than rounds are spread over them."""
        share = math.ceil(self.launches(config) * min(rounds / max(self.plan.launches, 1), 1))
        return self.done(config) < share and self.crashes.get(config.config, 0) < MOST_CRASHES

    def expected(self, config: Configuration) -> float:
        """Seconds of a launch: the middle one of this process's, or the plan's estimate."""
        seconds = sorted(self.seconds.get(config.config, [config.estimate_s]))
        return seconds[len(seconds) // 2]

    def remaining(self) -> float:
        return sum(self.expected(c) * (self.launches(c) - self.done(c)) for c in self.configs)

    def budget(self) -> float:
        return max(self.deadline - time.monotonic(), 0)

    def round(self, number: int) -> list[Configuration]:
        """The configurations of a round in random order: the comparisons that fit the budget whole. A
        comparison (scene and size) goes in with all its phases or not at all, cheap ones first: so its phases
        share the same stretch of time, and what is left of a budget is still of use."""
        due = [config for config in self.configs if self.due(config, number + 1)]
        groups = [[c for c in due if c.group == group] for group in dict.fromkeys(c.group for c in due)]
        left, chosen = self.budget(), []
        for group in sorted(groups, key=lambda group: sum(map(self.expected, group))):
            left -= sum(map(self.expected, group))
            chosen += group if left >= 0 else []
        random.Random(f"{self.plan.seed}:{number}").shuffle(chosen)
        return chosen

    def launch(self, config: Configuration) -> None:
        """One process: the frames that the next launch of `config` lacks, each stored at once."""
        number = self.done(config)
        there = self.frames.setdefault((config.config, number), set())
        offset, reps = self.timed(config, number), self.reps(config)
        padding = random.Random(f"{self.plan.seed}:{config.config}:{number}").randint(0, 4096)
        spec = Spec(config.phase, config.flags_from)
        if sha256(build(spec)) != self.plan.binaries[config.spec]:
            raise StudyError(f"build/{spec}/render was rebuilt since the run began; start a new run")
        size = find_scene(config.scene).path, config.height, config.width
        how = {"threads": config.threads, "cpu": self.plan.cpu, "env_bytes": padding, **overrides(self.plan)}
        warmup = 0 if config.once else self.plan.warmup
        frames = run.frames(spec, *size, reps=reps - offset, warmup=warmup, **how)
        begin, before = time.perf_counter(), energy.reading()
        with contextlib.closing(frames):
            for frame in frames:
                drawn = msgspec.convert(frame, Drawn)
                if drawn.scene_hash != config.scene_hash:
                    raise StudyError(f"scene {config.scene} changed since the run began; start a new run")
                at = drawn.frame + (0 if drawn.warmup else offset)
                # The driver's name for the scene is ASCII and short: two scenes may have the same.
                more = {"frame": at, "scene": config.scene, "env_bytes": padding, "time": now()}
                if drawn.warmup:
                    before = energy.reading()
                elif before and at == reps - 1:  # of all that the process timed, and did between
                    used = energy.joules(before, energy.reading())
                    more |= {} if used is None else {"joules": used / (reps - offset)}
                if at not in there:  # else it is a warm-up that the launch's first process has stored
                    which = {"config": config.config, "launch": number, "round": self.now}
                    self.run.append_frame({"schema": drawn.schema, **which, **frame, **more})
                    there.add(at)
        if self.timed(config, number) < reps:
            raise DriverError(0, f"{spec}: the driver ended before its last frame")
        if offset == 0:
            self.seconds.setdefault(config.config, []).append(time.perf_counter() - begin)

    def measure(self) -> None:
        """All rounds, with a progress bar in seconds. A crash is recorded, and the rest goes on."""
        total = min(self.remaining(), self.budget())
        with progress.Progress("sweep", total, share=True) as bar:
            for number in itertools.count():
                self.now = self.rounds + number
                chosen = self.round(number)
                if not chosen and number >= self.plan.launches:  # a round may come late, for the budget
                    break
                for config in chosen:
                    if self.expected(config) > self.budget():
                        continue
                    bar.to(bar.done, f"round {number + 1}: {config}")
                    begin = time.monotonic()
                    try:
                        self.launch(config)
                    except DriverError as error:
                        self.crashes[config.config] = self.crashes.get(config.config, 0) + 1
                        names = ("spec", "scene", "width", "height", "threads")
                        about = {name: getattr(config, name) for name in names}
                        fail(self.plan, Left(**about, launch=self.done(config)), error)
                        store.write_json(self.run.path / "plan.json", self.plan)
                    bar.to(min(bar.done + time.monotonic() - begin, total))
            bar.to(total)

    def finish(self) -> None:
        self.plan.not_reached = [
            Short(name=str(config), config=config.config, launches=self.done(config))
            for config in self.configs
            if self.due(config, self.plan.launches)
        ]
        self.plan.finished = now()
        store.write_json(self.run.path / "plan.json", self.plan)
        about = {"load_average": list(os.getloadavg()), "steal_ticks": machine.steal_ticks()}
        self.run.context.end = End(time=now(), limits=quotas.limits(), **about)
        store.write_json(self.run.path / "context.json", self.run.context)


def resume(args: argparse.Namespace) -> Sweep:
    """The run at --run; refused where machine or programs are not what they were."""
    target = store.Run.open(args.run)
    plan = target.plan
    if other := machine.differs(target.context, machine.context(plan.cpu or 0)):
        raise StudyError(f"{target}: measured on another machine ({'; '.join(other)}); start a new run here")
    if plan.cpu not in run.USABLE:
        raise StudyError(f"{target}: CPU {plan.cpu} is not available; start a new run here")
    for spec, digest in plan.binaries.items():
        if sha256(build(Spec.parse(spec))) != digest:
            raise StudyError(f"{target}: {spec} is another program now (sources, compiler); start a new run")
    sweep = Sweep(target, plan, args.budget)
    target.lock()
    spent = sweep.load()
    if args.budget is None and plan.budget_s is not None:
        sweep.deadline = time.monotonic() + plan.budget_s - spent
    return sweep


def start(plan: Plan, args: argparse.Namespace) -> Sweep:
    target = store.Run.create(args.results, machine.slug())
    target.lock()
    store.keep_scenes(target.path)
    context = machine.context(plan.cpu or 0)
    store.write_json(target.path / "context.json", context)
    for notice in quotas.notices(context):
        cli.say(f"note: {notice}")
    return Sweep(target, plan, args.budget)


def dry_run(sweep: Sweep) -> Outcome:
    plan, seconds = sweep.plan, sweep.remaining()
    rows = [
        {"name": str(one), "s": sweep.expected(one), "launches": sweep.launches(one) - sweep.done(one)}
        for one in plan.configurations
    ]
    todo = sum(sweep.launches(config) - sweep.done(config) for config in plan.configurations)
    lines = [
        summary.table(rows, [("name", "configuration"), ("launches", "launches"), ("s", "s per launch")]),
        f"{todo} launches; CPU {plan.cpu}, seed {plan.seed}",
        f"estimated duration: {progress.duration(min(seconds, sweep.budget()))}",
    ]
    result = cli.plain(plan) | {"estimated_s": seconds, "launches_to_do": todo}
    return Outcome(result, lines, sweep.run and sweep.run.path)


def report(sweep: Sweep, target: store.Run) -> Outcome:
    """Table and warnings of the run as it is now. Status 1 if a driver crashed."""
    frames, plan = target.frames(), sweep.plan
    rows, cells = summary.rows(frames), analysis.cells_of(frames)
    warnings = noise.indistinguishable(cells) + noise.remarks(frames, cells)
    warnings += quotas.notices(target.context)
    if crowded := sorted({c.threads for c in plan.configurations if c.threads > len(run.USABLE)}):
        counts = ", ".join(map(str, crowded))
        warnings.append(f"{counts} threads: more than the CPUs that may be used ({len(run.USABLE)})")
    for one in plan.not_reached:
        warnings.append(f"budget: {one.name} has {one.launches} of {plan.launches} launches")
    about = {"skipped": plan.skipped, "failures": plan.failures, "not_reached": plan.not_reached}
    result = {"rows": rows, "warnings": warnings, **about}
    lines = [summary.table(rows, summary.SPEED) if rows else "nothing was measured"]
    said = [f"warning: {warning}" for warning in warnings]
    return Outcome(result, lines, target.path, said, status=cli.FAILED if plan.failures else cli.OK)


def measure(args: argparse.Namespace) -> Outcome:
    args = with_defaults(args)
    if args.run:
        sweep = resume(args)
    else:
        plan = make_plan(args)
        if not plan.configurations and not plan.failures:
            raise StudyError("nothing to measure: every phase and scene was skipped", cli.CANNOT_RUN)
        sweep = Sweep(None, plan, args.budget) if args.dry_run else start(plan, args)
    if args.dry_run:
        return dry_run(sweep)
    target = sweep.run
    assert target
    with contextlib.closing(target), run.off(sweep.plan.cpu):
        sweep.plan.finished = None
        store.write_json(target.path / "plan.json", sweep.plan)
        cli.doing(f"run: {target}")
        try:
            sweep.measure()
        except KeyboardInterrupt:
            cli.say(f"to go on: scripts/stepwise sweep --run {target} --resume")
            raise
        sweep.finish()
    return report(sweep, target)
