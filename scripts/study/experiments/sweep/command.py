"""Times phases × scenes × sizes × threads in interleaved rounds of process launches."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import itertools
import os
import random
import re
import secrets
import time
from pathlib import Path
from typing import Any

from study.core import cli, machine, progress, run, store
from study.core.build import build
from study.core.cli import StudyError
from study.core.host import energy, quotas
from study.core.registry import Spec, find_scene, ladder
from study.core.run import DriverError
from study.experiments.sweep.plan import Config, fail, make_plan, now, overrides, sha256
from study.numbers import stats, summary

DESCRIPTION = """\
Times phases on scenes and sizes. A round launches every configuration once, in random order, pinned to one
CPU and with an environment of random size. So all phases of a comparison share the same stretch of time.
Rounds go on to --launches or to the end of --budget. When all phases of the ladder are swept, opt2 is also
measured with the flags of the others (the second base).

Each frame is a line of results/MACHINE/RUN/frames.jsonl, on disk before the next one. After a kill,
`--run DIR --resume` goes on: a launch that was cut off keeps its whole frames, and a further process measures
only the timed frames that it lacks."""
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


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    parser = cli.parser(
        DESCRIPTION,
        {0: "measured (what the budget did not reach is said)", 1: "a driver crashed; the rest is measured"},
    )
    whole, natural = cli.at_least(1), cli.at_least(0)
    plan = parser.add_argument_group("plan")
    plan.add_argument("--phase", nargs="+", metavar="PHASE", help="like opt3 or opt2@opt4; default: all")
    plan.add_argument("--scene", nargs="+", metavar="SCENE", help="default: scene0 mandelbulb")
    plan.add_argument("-n", nargs="+", type=size, metavar="HEIGHT", help="or WIDTHxHEIGHT; default: 180")
    plan.add_argument("--threads", nargs="+", type=whole, help="default: 1")
    plan.add_argument("--reps", type=whole, metavar="R", help="timed frames per launch; default: 3")
    plan.add_argument("--launches", type=whole, help="process launches; default: 10")
    plan.add_argument("--warmup", type=natural, metavar="K", help="frames before those; default: 1")
    plan.add_argument(
        "--long",
        type=cli.at_least(0, float),
        metavar="SECONDS",
        help="a frame longer than that warms itself up: one per launch, no warm-up",
    )
    plan.add_argument("--seed", type=natural, help="of order and padding; default: random")
    plan.add_argument("--cpu", type=natural, help="CPU to pin to; default: of a fast core")
    plan.add_argument("--hit-distance", type=cli.at_least(1e-300, float), metavar="X", help="in scene units")
    plan.add_argument("--max-steps", type=whole, metavar="K", help="evaluations per ray")
    about = "opt2@PHASE beside each PHASE with other flags; default: where all of the ladder is swept"
    plan.add_argument("--second-base", action=argparse.BooleanOptionalAction, help=about)
    plan.add_argument("--results", type=Path, metavar="DIR", help="parent of the run's folder")
    parser.add_argument("--run", type=Path, metavar="DIR", help="the run to go on with, by its own plan")
    parser.add_argument("--resume", action="store_true", help="go on with the run at --run")
    parser.add_argument("--budget", type=cli.at_least(0, float), metavar="SECONDS", help="stop after that")
    parser.add_argument("--dry-run", action="store_true", help="print plan and duration, measure nothing")
    options = parser.parse_args(argv)
    if options.resume != (options.run is not None):
        parser.error("--run DIR --resume goes on with a run; without both, a new run is made below --results")
    defaults: dict[str, Any] = {
        "phase": list(ladder()),
        "scene": ["scene0", "mandelbulb"],
        "n": [size("180")],
    }
    defaults |= {"threads": [1], "reps": 3, "launches": 10, "warmup": 1, "seed": secrets.randbelow(2**32)}
    defaults |= {"cpu": run.FASTEST, "results": store.RESULTS}
    for action in plan._group_actions:
        if options.run and getattr(options, action.dest) is not None:
            name = action.option_strings[0]
            parser.error(f"--resume goes on by the run's own plan, which {name} cannot change")
        if getattr(options, action.dest) is None:
            setattr(options, action.dest, defaults.get(action.dest))
    if options.second_base is None:
        options.second_base = set(ladder()) <= set(options.phase)
    return options


class Sweep:
    """The measuring of one run: what is there, what is missing, what still fits into the budget."""

    def __init__(self, target: store.Run | None, plan: dict[str, Any], budget: float | None) -> None:
        self.run, self.plan = target, plan
        self.configs = [Config(**entry) for entry in plan["configurations"]]
        self.frames: dict[tuple[str, int], set[int]] = {}  # (config, launch) -> numbers of its frames
        self.seconds: dict[str, list[float]] = {}  # config -> durations of this process's launches
        self.crashes: dict[str, int] = {}
        self.rounds = 0  # of those who measured into this run before
        self.now = 0  # the round: a launch that is made up for is of another than its number says
        self.deadline = time.monotonic() + (float("inf") if budget is None else budget)

    def load(self) -> float:
        """Learn from frames.jsonl what is measured already. Returns the seconds that went into it."""
        frames = self.run.frames()
        for row in frames.to_dict("records"):
            self.frames.setdefault((row["config"], row["launch"]), set()).add(row["frame"])
        self.rounds = 0 if frames.empty else int(stats.rounds_of(frames).fillna(frames["launch"]).max()) + 1
        return 0 if frames.empty else float((frames["ns"] + frames["present_ns"]).sum()) / 1e9

    def reps(self, config: Config) -> int:
        """Timed frames of a launch."""
        return 1 if config.once else self.plan["reps"]

    def timed(self, config: Config, launch: int) -> int:
        """Timed frames there are; those of the warm-up have negative numbers."""
        return sum(frame >= 0 for frame in self.frames.get((config.config, launch), ()))

    def done(self, config: Config) -> int:
        """Whole launches; launches come one after the other, so it is also the next one's number."""
        launches = self.plan["launches"]
        return next((n for n in range(launches) if self.timed(config, n) < self.reps(config)), launches)

    def due(self, config: Config, launches: int) -> bool:
        few = self.done(config) < min(launches, self.plan["launches"])
        return few and self.crashes.get(config.config, 0) < MOST_CRASHES

    def expected(self, config: Config) -> float:
        """Seconds of a launch: the middle one of this process's, or the plan's estimate."""
        seconds = sorted(self.seconds.get(config.config, [config.estimate_s]))
        return seconds[len(seconds) // 2]

    def remaining(self) -> float:
        """Seconds that the missing launches are expected to take."""
        return sum(self.expected(c) * (self.plan["launches"] - self.done(c)) for c in self.configs)

    def budget(self) -> float:
        return max(self.deadline - time.monotonic(), 0)

    def round(self, number: int) -> list[Config]:
        """The configurations of a round in random order: the comparisons that fit the budget whole.

        A comparison (scene and size) goes in with all its phases or not at all, cheap ones first: so
        its phases share the same stretch of time, and what is left of a budget is still of use.
        """
        due = [config for config in self.configs if self.due(config, number + 1)]
        groups = [[c for c in due if c.group == group] for group in dict.fromkeys(c.group for c in due)]
        left, chosen = self.budget(), []
        for group in sorted(groups, key=lambda group: sum(map(self.expected, group))):
            left -= sum(map(self.expected, group))
            chosen += group if left >= 0 else []
        random.Random(f"{self.plan['seed']}:{number}").shuffle(chosen)
        return chosen

    def launch(self, config: Config) -> None:
        """One process: the frames that the next launch of `config` lacks, each stored at once."""
        number = self.done(config)
        there = self.frames.setdefault((config.config, number), set())
        offset = self.timed(config, number)
        padding = random.Random(f"{self.plan['seed']}:{config.config}:{number}").randint(0, 4096)
        spec = Spec(config.phase, config.flags_from)
        if sha256(build(spec)) != self.plan["binaries"][config.spec]:
            raise StudyError(f"build/{spec}/render was rebuilt since the run began; start a new run")
        frames = run.frames(
            spec,
            find_scene(config.scene).path,
            config.height,
            config.width,
            threads=config.threads,
            reps=self.reps(config) - offset,
            warmup=0 if config.once else self.plan["warmup"],
            cpu=self.plan["cpu"],
            env_bytes=padding,
            **overrides(self.plan),
        )
        begin, before, count = time.perf_counter(), energy.reading(), self.reps(config) - offset
        with contextlib.closing(frames):
            for frame in frames:
                if frame["scene_hash"] != config.scene_hash:
                    raise StudyError(f"scene {config.scene} changed since the run began; start a new run")
                if frame["warmup"]:
                    before = energy.reading()
                elif before and frame["frame"] == count - 1:  # of all that the process timed, and did between
                    used = energy.joules(before, energy.reading())
                    frame |= {} if used is None else {"joules": used / count}
                frame["frame"] += 0 if frame["warmup"] else offset
                if frame["frame"] in there:  # warm-up that the launch's first process has stored
                    continue
                head = {
                    "schema": frame["schema"],
                    "config": config.config,
                    "launch": number,
                    "round": self.now,
                }
                # The driver's name for the scene is ASCII and short: two scenes may have the same.
                frame |= {"scene": config.scene, "env_bytes": padding, "time": now()}
                self.run.append_frame(head | frame)
                there.add(frame["frame"])
        if self.timed(config, number) < self.reps(config):
            raise DriverError(0, f"{spec}: the driver ended before its last frame")
        if offset == 0:
            self.seconds.setdefault(config.config, []).append(time.perf_counter() - begin)

    def measure(self) -> None:
        """All rounds, with a progress bar in seconds. A crash is recorded, and the rest goes on."""
        work, budget = self.remaining(), self.budget()
        total, by_clock = min(work, budget), budget < work
        with progress.Progress("sweep", total, share=True) as bar:
            for number in itertools.count():
                self.now = self.rounds + number
                chosen = self.round(number)
                if not chosen and number >= self.plan["launches"]:  # a round may come late, for the budget
                    break
                for config in chosen:
                    if self.expected(config) > self.budget():
                        continue
                    bar.to(bar.done, f"round {number + 1}: {config}")
                    before, begin = self.expected(config), time.monotonic()
                    try:
                        self.launch(config)
                    except DriverError as error:
                        self.crashes[config.config] = self.crashes.get(config.config, 0) + 1
                        launch = {"launch": self.done(config)}
                        fail(self.plan, dataclasses.asdict(config) | launch, error)
                        store.write_json(self.run.path / "plan.json", self.plan)
                    step = time.monotonic() - begin if by_clock else before
                    bar.to(min(bar.done + step, total))
            bar.to(total)

    def finish(self) -> None:
        """Write what the budget did not reach, and that the run is over."""
        self.plan["not_reached"] = [
            {"name": str(config), "config": config.config, "launches": self.done(config)}
            for config in self.configs
            if self.due(config, self.plan["launches"])
        ]
        self.plan["finished"] = now()
        store.write_json(self.run.path / "plan.json", self.plan)
        end = {"time": now(), "load_average": os.getloadavg(), "steal_ticks": machine.steal_ticks()}
        end["limits"] = quotas.limits()
        self.run.context = self.run.context | {"end": end}
        store.write_json(self.run.path / "context.json", self.run.context)


def resume(options: argparse.Namespace) -> Sweep:
    """The run at --run; refused where machine or programs are not what they were."""
    target = store.Run.open(options.run)
    plan = target.plan
    if other := machine.differs(target.context, machine.context(plan["cpu"])):
        raise StudyError(f"{target}: measured on another machine ({'; '.join(other)}); start a new run here")
    if plan["cpu"] not in run.USABLE:
        raise StudyError(f"{target}: CPU {plan['cpu']} is not available; start a new run here")
    for spec, digest in plan["binaries"].items():
        if sha256(build(Spec.parse(spec))) != digest:
            raise StudyError(f"{target}: {spec} is another program now (sources, compiler); start a new run")
    sweep = Sweep(target, plan, options.budget)
    target.lock()
    spent = sweep.load()
    if options.budget is None and plan["budget_s"] is not None:
        sweep.deadline = time.monotonic() + plan["budget_s"] - spent
    return sweep


def unfinished(plan: dict[str, Any], results: Path) -> str | None:
    """The newest run that measures the same and was never finished."""
    keys = ("cpu", "launches", "reps", "warmup", "long", "binaries")
    for path in sorted(results.glob(f"{machine.slug()}/*/plan.json"), reverse=True):
        with contextlib.suppress(StudyError, KeyError):
            other = store.read_json(path)
            same = all(other[key] == plan[key] for key in keys) and other["finished"] is None
            ids = [[c["config"] for c in each["configurations"]] for each in (plan, other)]
            if same and ids[0] == ids[1]:
                return str(path.parent)
    return None


def start(plan: dict[str, Any], options: argparse.Namespace) -> Sweep:
    """A new run, with its folder and context."""
    if other := unfinished(plan, options.results):
        cli.say(f"note: {other} measures the same and is unfinished; --run {other} --resume goes on with it")
    target = store.Run.create(options.results, machine.slug())
    target.lock()
    context = machine.context(plan["cpu"])
    store.write_json(target.path / "context.json", context)
    for notice in quotas.notices(context):
        cli.say(f"note: {notice}")
    return Sweep(target, plan, options.budget)


def dry_run(sweep: Sweep, as_json: bool) -> int:
    """What would be measured and how long it would take."""
    plan, seconds = sweep.plan, sweep.remaining()
    rows = [
        {"name": str(config), "s": sweep.expected(config), "launches": plan["launches"] - sweep.done(config)}
        for config in sweep.configs
    ]

    if as_json:
        todo = sum(row["launches"] for row in rows)
        cli.emit(plan | {"estimated_s": seconds, "launches_to_do": todo}, sweep.run and sweep.run.path)
        return cli.OK
    print(summary.table(rows, [("name", "configuration"), ("launches", "launches"), ("s", "s per launch")]))
    frames = f"{plan['reps']} timed frames and {plan['warmup']} of warm-up each"
    if once := sum(config.once for config in sweep.configs):
        frames += f" ({once} long configurations: one frame)"
    print(
        f"{sum(row['launches'] for row in rows)} launches, {frames}; CPU {plan['cpu']}, seed {plan['seed']}"
    )
    limit = f", cut off after {progress.duration(sweep.budget())}" if seconds > sweep.budget() else ""
    print(f"estimated duration: {progress.duration(seconds)}{limit}")
    return cli.OK


def report(sweep: Sweep, as_json: bool) -> int:
    """Table and warnings of the run as it is now. Status 1 if a driver crashed."""
    frames, plan = sweep.run.frames(), sweep.plan
    rows = summary.rows(frames)
    warnings = summary.indistinguishable(frames) + stats.noise_warnings(frames)
    warnings += quotas.notices(sweep.run.context)
    if crowded := sorted({c.threads for c in sweep.configs if c.threads > len(run.USABLE)}):
        counts = ", ".join(map(str, crowded))
        warnings.append(f"{counts} threads: more than the CPUs that may be used ({len(run.USABLE)})")
    for entry in plan["not_reached"]:
        warnings.append(f"budget: {entry['name']} has {entry['launches']} of {plan['launches']} launches")
    if as_json:
        notes = {key: plan[key] for key in ("skipped", "failures", "not_reached")}
        cli.emit({"rows": rows, "warnings": warnings} | notes, sweep.run.path)
    else:
        print(summary.table(rows, summary.SPEED) if rows else "nothing was measured")
    for warning in warnings:
        cli.say(f"warning: {warning}")
    return cli.FAILED if plan["failures"] else cli.OK


def main() -> int:
    options = arguments()
    if options.run:
        sweep = resume(options)
    else:
        plan = make_plan(options)
        if not plan["configurations"] and not plan["failures"]:
            raise StudyError("nothing to measure: every phase and scene was skipped", cli.CANNOT_RUN)
        sweep = Sweep(None, plan, options.budget) if options.dry_run else start(plan, options)
    if options.dry_run:
        return dry_run(sweep, options.json)
    sweep.plan["finished"] = None
    store.write_json(sweep.run.path / "plan.json", sweep.plan)
    cli.say(f"run: {sweep.run}")
    if others := set(run.USABLE) - run.cpu_set(sweep.plan["cpu"], 1):
        with contextlib.suppress(OSError):  # no longer allowed there: the first launch says so
            os.sched_setaffinity(0, others)  # this process only waits and writes: not on the measured CPU
    try:
        sweep.measure()
    except KeyboardInterrupt:
        cli.say(f"to go on: scripts/stepwise sweep --run {sweep.run} --resume")
        raise
    sweep.finish()
    return report(sweep, options.json)
