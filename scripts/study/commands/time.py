"""Times any programs in turns until their ratios are known."""

import argparse
import contextlib
import hashlib
import itertools
import os
import random
import re
import secrets
import shlex
import shutil
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pandas as pd

from study.core import cli, machine, progress, store
from study.core.cli import Outcome, StudyError
from study.core.host import quotas
from study.core.run import FASTEST, cpu_set, off
from study.core.run_schema import End, Plan, Program
from study.measuring import launcher, programs
from study.measuring.launcher import Launcher
from study.numbers import analysis, modes, noise, sequential, summary
from study.numbers import programs as table
from study.pictures import launch_order

DESCRIPTION = """\
Times any programs: a round launches each of them once, in random order, pinned to one CPU and with an
environment of random size. Rounds go on until the 95 % interval of every ratio to the first program is within
--precision of its value, at most for --budget. The interval holds however often one looks (S. R. Howard and
A. Ramdas, Bernoulli 28, 2022), so that stopping by it costs none of its 95 %.

    scripts/stepwise time -- ./old scene ::: ./new scene
    scripts/stepwise time --precision 0.5% --time-from 'frame ([0-9.]+) ms' -- ./old ::: ./new
    scripts/stepwise time --vary n 128,256,512 -- './mm {n}'

A ratio is the median over rounds of the first program's time over this one's: over 1, this one is faster.
Verdicts of several programs are corrected together (Bonferroni): of equal programs one or more is called
slower by chance in at most 2.5 % of runs.
Launches that another process interrupted are left out where ten others are there; their number is said, and
where they count all the same.
Warm-up are the first rounds, until no program is 1 % faster than before; they are in no statistic.
Options that hyperfine has mean what they mean there. Without --shell no shell is between: a command of one
word is split into words. With one, its own start is in every time.

With --fail-on-slower it is a gate: the status is 1 for a program that is slower than the first by more than
--least, and for one with too few launches."""
STATUSES = {1: "with --fail-on-slower: see above"}
MOST_WARM, SHARE_WARM = 10, 0.2  # rounds of warm-up, and of the seconds
LEAST_ROUNDS = 10  # where no --budget is given: so many or more even of slow programs
A_PROGRAM = 1.5  # s that each may take without --budget
BETWEEN = ":::"
SEEN = ("ns", *noise.TOLD)  # of a launch by the rule for when to stop


def precision(text: str) -> float:
    """`1%` or `0.01`."""
    with contextlib.suppress(ValueError):
        value = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
        if 0 < value < 1:
            return value
    raise argparse.ArgumentTypeError(f"'{text}': a share above 0 and below 1, like 1% or 0.01")


def codes(text: str) -> frozenset[int] | None:
    with contextlib.suppress(ValueError):
        return None if text == launcher.ALL else frozenset(map(int, text.split(",")))
    raise argparse.ArgumentTypeError(f"'{text}': exit statuses like 1,2, or {launcher.ALL}")


def given(text: str) -> Path | None:
    """`null`, as hyperfine has it: none."""
    return None if text == "null" else Path(text)


def pattern(text: str) -> re.Pattern[str]:
    with contextlib.suppress(re.error):
        if (found := re.compile(text, re.MULTILINE)).groups:
            return found
    raise argparse.ArgumentTypeError(f"'{text}': a pattern whose group is a number, like 'took ([0-9.]+) ms'")


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("command", nargs="*", metavar="-- CMD ::: CMD", help="the programs, the first of all the base")
    add("--precision", type=precision, metavar="P", help="of the ratios, ±; default: 1%%")
    about = f"of measuring them all at most; default: {A_PROGRAM:g} a program, or {LEAST_ROUNDS} rounds"
    add("--budget", type=cli.at_least(0.001, float), metavar="SECONDS", help=about)
    add("--launches", type=cli.at_least(1), help="of each program, instead of --precision")
    about = "smallest change that --fail-on-slower counts, like 2%%; default: 0%%"
    add("--least", type=cli.percent, default=0.0, metavar="P", help=about)
    add("--fail-on-slower", action="store_true", help="a gate: status 1, see above")
    add("--warmup", type=cli.at_least(0), metavar="ROUNDS", help="rounds left out; default: found")
    add("--vary", nargs=2, action="append", default=[], metavar=("NAME", "A,B,C"), help="values of {NAME}")
    one = parser.add_mutually_exclusive_group().add_argument
    one("--time-from", type=pattern, metavar="REGEX", help="time what it prints to stdout: number, unit")
    one("--by", choices=("wall", "cpu"), default="wall", help="cpu: user + system time; default: wall")
    add("--command-name", action="append", default=[], metavar="NAME", help="of a program in the table")
    for name, about in (("--prepare", "before each launch"), ("--cleanup", "after the last launch")):
        add(name, action="append", default=[], metavar="CMD", help=f"{about}; once, or once for each program")
    about, fine = "go on after a status that is not 0, or after these", frozenset[int]()
    add("--ignore-failure", type=codes, nargs="?", default=fine, metavar="CODES", help=about)
    add("--input", type=given, metavar="FILE", help="standard input of the programs; default: none")
    add("--shell", metavar="SHELL", help="none, default (sh), or like 'bash --norc'; see above")
    add("--cpu", type=cli.at_least(0), default=FASTEST, help="to pin to; default: of a fast core")
    add("--threads", type=cli.at_least(1), default=1, help="CPUs to pin to; default: 1")
    add("--seed", type=cli.at_least(0), help="of order and padding; default: random")
    add("--results", type=Path, default=store.RESULTS, metavar="DIR", help="parent of the run's folder")
    add("--export-json", type=Path, metavar="PATH", help="as hyperfine writes it")


def commands(words: Sequence[str]) -> list[list[str]]:
    """Commands, one between two :::. Raises StudyError for an empty one."""
    found = [list(some) for end, some in itertools.groupby(words, lambda word: word == BETWEEN) if not end]
    if not found or len(found) != list(words).count(BETWEEN) + 1 or not all(map(any, found)):
        raise StudyError("name the programs: stepwise time [options] -- ./old args ::: ./new args")
    return found


def each(given: Sequence[str], many: int, option: str) -> list[str | None]:
    """A value for each command, of an option that is given never, once for all or once for each."""
    if len(given) not in (0, 1, many):
        raise StudyError(f"{option}: {len(given)} times for {many} commands; once, or once for each")
    return [None] * many if not given else [*given] * (many if len(given) == 1 else 1)


def asked(args: argparse.Namespace) -> list[Program]:
    """Every command with every value of --vary. Raises StudyError."""
    found = commands(args.command)
    prepare, cleanup = (each(getattr(args, name), len(found), f"--{name}") for name in ("prepare", "cleanup"))
    names = args.command_name or [" ".join(one) if len(one) == 1 else shlex.join(one) for one in found]
    if len(names) != len(found):
        raise StudyError(f"--command-name: {len(names)} for {len(found)} commands; once for each")
    for place, name in enumerate(names):  # a program beside itself shows what chance does
        if (before := names[:place].count(name)) > 0:
            names[place] = f"{name} ({before + 1})"
    values = [[(name, value) for value in text.split(",")] for name, text in args.vary]
    for name, text in args.vary:
        if not all(text.split(",")):
            raise StudyError(f"--vary {name} {text}: an empty value; values stand between commas, as 1,2,4")
        if not all(any(f"{{{name}}}" in word for word in one) for one in found):
            raise StudyError(f"--vary {name}: every command must have {{{name}}} in it")
    made = []
    for chosen in itertools.product(*values):

        def put(text: str, chosen: Sequence[tuple[str, str]] = chosen) -> str:
            for name, value in chosen:
                text = text.replace(f"{{{name}}}", value)
            return text

        for name, words, before, after in zip(names, found, prepare, cleanup, strict=True):
            around = {"prepare": before and put(before), "cleanup": after and put(after)}
            case = " ".join(f"{key}={value}" for key, value in chosen)
            made.append(Program(name=name, case=case, command=[*map(put, words)], **around))
    if len({(one.name, one.case) for one in made}) < len(made):
        raise StudyError("two programs of one name and case; --command-name tells them apart")
    if args.fail_on_slower and len(made) < 2:
        typo = f"; {BETWEEN} stands between them, not ::" if "::" in args.command else ""
        raise StudyError(f"--fail-on-slower: a gate needs two programs{typo}")
    return made


def digest(path: Path | str | None) -> str | None:
    with contextlib.suppress(OSError, TypeError):
        return hashlib.sha256(Path(path or "").read_bytes()).hexdigest()
    return None


class Timing:
    """The measuring: what is launched, how, and the launches so far, by round."""

    def __init__(self, args: argparse.Namespace, plan: Plan, how: Launcher) -> None:
        self.plan, self.how, self.results = plan, how, args.results
        self.dice = random.Random(plan.seed)
        self.context = machine.context(args.cpu)
        pattern = args.time_from.pattern if args.time_from else args.by.removeprefix("wall")
        work = f"{digest(args.input) or ''} {pattern}".strip()
        plan.configurations = [programs.configuration(one, work, args.threads) for one in plan.programs]
        self.done: list[dict[int, dict[str, float]]] = [{} for _ in plan.programs]
        self.run: store.Run | None = None
        self.round = 0
        self.limit = args.budget or A_PROGRAM * len(plan.programs)
        wide = table.cover(plan.programs)
        enough = next(n for n in itertools.count(LEAST_ROUNDS) if sequential.rank(n, wide))
        self.least = 1 if args.budget else enough
        self.begun = time.monotonic()

    def launches(self, warmup: bool) -> Iterator[dict[str, Any]]:
        """Lines of a round, in random order."""
        for place in self.dice.sample(range(len(self.done)), len(self.done)):
            program, padding = self.plan.programs[place], self.dice.randint(0, 4096)
            if program.prepare:
                self.how.around(program.prepare)
            found = self.how.launch(program.command, padding)
            about = {"round": self.round, "env_bytes": padding, "cpu": self.plan.cpu, "time": programs.now()}
            lines = [msgspec.structs.asdict(one) for one in found]
            self.done[place][self.round] = {key: np.median([one[key] for one in lines]) for key in SEEN}
            for one in lines:
                of = self.plan.configurations[place]
                yield programs.line(of, self.round, warmup=warmup, **about, **one)

    def one_round(self, warmup: bool = False) -> None:
        """The run's folder is made when its first round has passed: what cannot start leaves none."""
        lines: Iterable[dict[str, Any]] = self.launches(warmup)
        if self.run is None:
            lines = [*lines]
            self.run = programs.begin(self.results, machine.slug(), self.plan, self.context)
        for line in lines:
            self.run.append_frame(line)
        self.round += 1

    @property
    def spent(self) -> float:
        return time.monotonic() - self.begun

    def warm_up(self, rounds: int | None) -> None:
        """`rounds` of them, or until the last one was no faster; their times are forgotten."""
        while self.round != rounds and self.round < (MOST_WARM if rounds is None else rounds):
            self.one_round(warmup=True)
            warm = all(modes.warm([one["ns"] for one in done.values()]) for done in self.done)
            if rounds is None and (warm or self.spent > SHARE_WARM * self.limit):
                break
        self.plan.warmup = self.round
        self.done = [{} for _ in self.done]
        self.begun = time.monotonic()

    def known(self, rounds: int) -> bool:
        if self.plan.precision is None or rounds % max(rounds // 20, 1):
            return False
        launches = [pd.DataFrame.from_dict(done, "index") for done in self.done]
        return table.precise(launches, self.plan.programs, self.plan.precision)

    def measure(self) -> None:
        with progress.Progress("time", self.plan.launches or self.limit) as bar:
            for rounds in itertools.count(1):
                self.one_round()
                done = rounds if self.plan.launches else min(round(self.spent), self.limit)
                bar.to(done, f"round {rounds}")
                if rounds == self.plan.launches or self.known(rounds):
                    break
                late = self.plan.seconds is not None or not self.plan.launches
                if late and self.spent > self.limit and rounds >= self.least:
                    break
        self.plan.launches = rounds

    def clean_up(self) -> None:
        for program in self.plan.programs:
            if program.cleanup:
                self.how.around(program.cleanup)

    def end(self) -> store.Run:
        assert self.run
        about = {"load_average": list(os.getloadavg()), "steal_ticks": machine.steal_ticks()}
        self.context.end = End(time=programs.now(), limits=quotas.limits(), **about)
        store.write_json(self.run.path / "context.json", self.context)
        programs.end(self.run, self.plan)
        return self.run


def told(target: store.Run, plan: Plan, args: argparse.Namespace) -> Outcome:
    frames = target.frames()
    cells = analysis.cells_of(frames, plan)
    found = table.rows(cells, plan)
    picture = launch_order.drawing(frames, plan).write(target.path / "figures" / "launches")
    lines = [summary.table(found, table.COLUMNS), *picture[-1:], target.path]
    said = [*table.remarks(found), *noise.others(frames)]
    said += quotas.notices(target.context) if args.by == "wall" else []
    rounds = f"{plan.launches} rounds after {plan.warmup} of warm-up, CPU {plan.cpu}, seed {plan.seed}"
    ratios = [row.ratio for row in found if row.ratio]
    if any(one.launches < plan.launches for one in ratios):
        rounds += f"; in the ratios: {', '.join(str(one.launches) for one in ratios)}"
    known = ratios or [row.ms for row in found]
    if plan.precision and not all(sequential.within(one, plan.precision) for one in known):
        rounds += f"; not known to ±{100 * plan.precision:.3g} %: --budget allows more"
    elif plan.precision and any(row.verdict == table.UNSURE and row.step is None for row in found):
        rounds += f"; a --precision below {100 * plan.precision:.3g}% tells smaller differences"
    result = {"rows": found, "launches": plan.launches, "warmup": plan.warmup}
    failed = table.slower(found, args.least) if args.fail_on_slower else []
    remarks = [f"warning: {text}" for text in said]
    return Outcome(result, [*lines, rounds], target.path, remarks, failed=failed)


def timed(args: argparse.Namespace) -> store.Run:
    """Raises StudyError."""
    if args.launches and args.precision:
        raise StudyError("--launches counts, --precision stops by itself; give one of them")
    if args.input and not args.input.is_file():
        raise StudyError(f"{args.input}: no such file for --input")
    cpus = frozenset(cpu_set(args.cpu, args.threads) or ())
    how = Launcher(cpus, args.shell, args.input, args.ignore_failure, args.time_from, args.by)
    plan = Plan(
        programs=asked(args),
        words=["time", *sys.argv[1:]],
        seed=secrets.randbelow(2**32) if args.seed is None else args.seed,
        cpu=args.cpu,
        launches=args.launches or 0,
        reps=1,
        precision=None if args.launches else args.precision or 0.01,
        seconds=args.budget,
        time_from=args.time_from.pattern if args.time_from else None,
        began=programs.now(),
    )
    for one in plan.programs:
        one.sha256 = digest(shutil.which(how.words(one.command)[0]))
    timing = Timing(args, plan, how)
    try:
        with off(args.cpu):
            timing.warm_up(args.warmup)
            timing.measure()
    except StudyError:
        with contextlib.suppress(StudyError):
            timing.clean_up()
        raise
    except KeyboardInterrupt:
        if timing.run is None:
            raise
        held = sum(not one.warmup for one in timing.run.lines())
        raise StudyError(f"interrupted; {timing.run} holds {held} launches", cli.INTERRUPTED) from None
    timing.clean_up()
    return timing.end()


def run(args: argparse.Namespace) -> Outcome:
    target = timed(args)
    if args.export_json:
        store.write_json(args.export_json, table.hyperfine(target))
    return told(target, target.plan, args)
