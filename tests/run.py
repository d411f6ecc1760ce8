#!/usr/bin/env python3
"""Runs the tests, all of them or one half, and ends with the line 'N passed, N failed, N skipped'.

    run.py quick    what guards a change: `make test`
    run.py rest     all others: with the quick ones before, no test is run twice
    run.py all      both: `make test-all`

What builds comes first (builds.py), then pytest by pytest-xdist, then pytest again for the sanitized builds:
a line for each suite. `--phase NAME` runs what concerns one phase, `--part NAME` one part alone; V=1 in the
environment shows what the parts print. Standard library only.
"""

from __future__ import annotations

import argparse
import functools
import os
import re
import signal
import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import builds

ROOT = builds.ROOT
RESULTS = ROOT / "build" / "test-results"
# One more than there are cores: many tests start processes that pin themselves to a core, others wait.
WORKERS = builds.JOBS + 1
SLOWEST = 30  # tests named at the end
# What pytest is told of each half. A test that draws examples is in both: quick draws a fifth of them, rest
# draws all (tests/drawn.py).
HALVES = {
    "quick": ["-m", "not slow", "--hypothesis-profile=quick"],
    "rest": ["-m", "slow or hypothesis"],
    "all": [],
}
LEFT_OUT = {"quick": ("sanitized",)}  # parts, by half
# Folders of one pytest, and its environment.
PYTEST: dict[str, tuple[list[str], dict[str, str]]] = {
    "tests": (["tests"], {}),
    "sanitized": (["tests/conformance"], {"STEPWISE_BUILD": "build/asan"}),
}
WHOLE_FILES = ("phases", "systems")  # folders of tests that are about the phases that they name


@dataclass
class Tally:
    passed: int = 0
    failed: list[str] = field(default_factory=list)
    skipped: list[tuple[str, str]] = field(default_factory=list)  # name, reason
    seconds: dict[str, float] = field(default_factory=dict)  # of each test of pytest, by its name

    def add(self, other: Tally) -> None:
        self.passed += other.passed
        self.failed += other.failed
        self.skipped += other.skipped
        self.seconds |= other.seconds

    def line(self, suite: str) -> str:
        cost = f", {sum(self.seconds.values()):.0f} s of one core" if self.seconds else ""
        return (
            f"{suite:22} {self.passed:5} passed, {len(self.failed)} failed, {len(self.skipped)} skipped{cost}"
        )


def read_results(path: Path, part: str, ended_well: bool) -> dict[str, Tally]:
    """Counts of a JUnit XML file by suite, a folder of tests, and its failures' names. A crash that left no
    file is a failure."""
    suites: dict[str, Tally] = {}
    try:
        cases = list(ET.parse(path).getroot().iter("testcase"))
    except (OSError, ET.ParseError):
        alone = f"alone: make check PART={part}"
        return {part: Tally(failed=[f"{part}: no results: it did not start, or crashed; {alone}"])}
    for case in cases:
        name = case.get("classname", "").removeprefix("tests.")
        folders = name.split(".")[:-1]
        suite = part if part != "tests" else "/".join(folders[: 2 if folders[:1] == ["study"] else 1]) or part
        tally = suites.setdefault(suite, Tally())
        title = f"{name}::{case.get('name')}"
        title = f"{part}: {title}" if part != "tests" else title
        tally.seconds[title] = float(case.get("time", 0))
        skip = case.find("skipped")
        if case.find("failure") is not None or case.find("error") is not None:
            tally.failed.append(title)
        elif skip is not None:
            tally.skipped.append((title, skip.get("message") or ""))
        else:
            tally.passed += 1
    if not ended_well and not any(tally.failed for tally in suites.values()):
        suites[part] = Tally(failed=[f"{part}: ended with a failure after its tests"])
    return suites


def build(half: str, phase: str | None) -> dict[str, Tally]:
    """Whether what the half tests builds without a warning: each phase and compiler is a test."""
    tests, needs = {}, []
    if half in ("quick", "all"):
        tests |= builds.quick_tests()
        needs.append(builds.quick_needs())
    if half in ("rest", "all"):
        tests |= builds.rest_tests()
        needs += [builds.rest_needs(), builds.together(builds.quick_tests().values())]
    if phase:
        tests, needs = builds.phase_tests(phase), []
    wanted = builds.together([*tests.values(), *needs])
    failed = builds.build(tests, builds.together(needs), RESULTS)
    if not failed:  # what a test runs is asked for once, not by each process of each test (core/build.py)
        os.environ["STEPWISE_BUILT"] = os.pathsep.join(filter(os.path.exists, builds.programs(wanted)))
    return {"builds": Tally(len(tests) - len(failed), [f"builds: {name}" for name in failed])}


def concerning(phase: str) -> list[str]:
    """Files of the tests that name the phase, and those with a test for each phase."""
    files = [path for folder in WHOLE_FILES for path in sorted((ROOT / "tests" / folder).rglob("test_*.py"))]
    named = [
        path for path in files if re.search(rf"\b{re.escape(phase)}\b", path.read_text(encoding="utf-8"))
    ]
    return [str(path.relative_to(ROOT)) for path in named]


def tests(part: str, half: str, phase: str | None) -> dict[str, Tally]:
    """One pytest, on every core: of one phase, its own files and what the other suites have of it."""
    folders, environment = PYTEST[part]
    results = RESULTS / f"{part}.xml"
    results.unlink(missing_ok=True)
    words = [sys.executable, "-m", "pytest", "-q", f"-n{WORKERS}", f"--junitxml={results}"]
    words += HALVES[half] if part == "tests" else []
    if phase:
        words += ["--phase", phase]
        folders = [*concerning(phase), "tests/conformance", "tests/hard"]
    log = None if builds.LOUD else RESULTS / f"{part}.log"
    good = builds.run([*words, *folders], log, **(builds.environment() | environment))
    found = read_results(results, part, good)
    if log and any(tally.failed for tally in found.values()):
        print(failures(log.read_text(encoding="utf-8", errors="replace")))
    return found


def failures(log: str) -> str:
    """What pytest says of tests that failed, without its dots before and its list behind."""
    found = re.search(
        r"^=+ (FAILURES|ERRORS) =+$.*?(?=^=+ short test summary|\Z)", log, re.DOTALL | re.MULTILINE
    )
    return found.group().rstrip() if found else log[-3000:]


PARTS: dict[str, Callable[[str, str | None], dict[str, Tally]]] = {
    "builds": build,
    **{part: functools.partial(tests, part) for part in PYTEST},
}


def told(total: Tally, took: dict[str, float], slowest: int) -> str:
    """The end of a run: the slowest tests; what was skipped, by reason; what failed; the times; the sums."""
    lines = []
    if slowest:
        times = sorted(total.seconds.items(), key=lambda item: -item[1])[:slowest]
        lines += ["slowest tests:", *(f"{seconds:7.1f} s  {name}" for name, seconds in times)]
    reasons: dict[str, list[str]] = {}
    for name, reason in total.skipped:
        reasons.setdefault(reason, []).append(name)
    lines += [f"skipped {len(names)}: {why}: {', '.join(names)}" for why, names in reasons.items()]
    lines += [f"FAILED: {name}" for name in total.failed]
    seconds = round(sum(took.values()))
    parts = ", ".join(f"{part} {time:.0f} s" for part, time in took.items())
    lines += [f"{seconds // 60} min {seconds % 60} s on {builds.JOBS} cores: {parts}"]
    lines += [f"{total.passed} passed, {len(total.failed)} failed, {len(total.skipped)} skipped"]
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("half", choices=HALVES)
    parser.add_argument("--part", action="append", choices=PARTS, help="only this one")
    parser.add_argument("--phase", choices=builds.phases(), metavar="NAME", help="what concerns this phase")
    arguments = parser.parse_args()
    for end in (signal.SIGINT, signal.SIGTERM):  # ends what was started, though a shell had it ignored
        signal.signal(end, signal.default_int_handler)
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # else each script that a test starts is compiled anew
    total, took = Tally(), {}
    parts = [part for part in PARTS if part not in LEFT_OUT.get(arguments.half, ()) and not arguments.phase]
    for part in arguments.part or parts or ["builds", "tests"]:
        begin = time.monotonic()
        print(f"{part} …", flush=True)
        for suite, tally in sorted(PARTS[part](arguments.half, arguments.phase).items()):
            print(tally.line(suite), flush=True)
            total.add(tally)
        took[part] = time.monotonic() - begin
    print(told(total, took, 0 if arguments.half == "quick" else SLOWEST))
    return 1 if total.failed or not total.passed else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit("tests: interrupted")
