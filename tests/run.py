#!/usr/bin/env python3
"""Runs the tests, all or the steps named, and ends with the line 'N passed, N failed, N skipped'.

Every program of the tests writes JUnit XML into build/test-results; the sums are made from those. A step
that ends badly without saying which test failed counts as one failure. What builds comes first and uses every
core; then the tests in Python, in parts that each core takes as it gets free. Standard library only.
"""

from __future__ import annotations

import argparse
import contextvars
import itertools
import json
import os
import re
import subprocess
import sys
import threading
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "build" / "test-results"
JOBS = str(len(os.sched_getaffinity(0)))
# How every phase is built: folder, and what make needs to know. Conformance runs on the first and the third.
BUILDS = {
    "build": [],
    "build/clang": ["CC=clang"],
    "build/asan": ["SANITIZE=1"],
}

# As scripts/study/hard/builds.py has them made.
HARD_BUILDS = {
    "build/hard-fast": ["CC=gcc", "SANITIZERS=-ffast-math"],
    "build/hard-fma": ["CC=gcc", "SANITIZERS=-mfma -ffp-contract=fast"],
}


SYSTEMS = '"family": "systems"'  # in a phase.json: alternatives to the ladder

# Where a step's output goes; None: to the terminal, as it comes.
OUTPUT: contextvars.ContextVar[IO[str] | None] = contextvars.ContextVar("output", default=None)


@dataclass
class Tally:
    passed: int = 0
    failed: list[str] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        self.passed += other.passed
        self.failed += other.failed
        self.skipped += other.skipped


def run(*command: str | Path, **environment: str) -> bool:
    """Whether the command ended well; its output is the user's to read."""
    words = [str(word) for word in command]
    out = OUTPUT.get()
    print("$", *(f"{key}={value}" for key, value in environment.items()), *words, file=out, flush=True)
    where = {"stdout": out, "stderr": subprocess.STDOUT} if out else {}
    try:
        return subprocess.run(words, cwd=ROOT, env=os.environ | environment, **where).returncode == 0
    except FileNotFoundError as error:
        print(f"tests: {error.filename} is missing; run `scripts/setup.sh test`", file=out, flush=True)
        return False


def one(name: str, passed: bool) -> Tally:
    """The tally of something that counts as a single test."""
    return Tally(passed=1) if passed else Tally(failed=[name])


def read_results(path: Path, name: str, ended_well: bool, reason: str = "") -> Tally:
    """Counts of a JUnit XML file, and its failures' names. A crash that left no file is a failure.

    `reason`: of its skips, where the file has none.
    """
    tally = Tally()
    try:
        cases = list(ET.parse(path).getroot().iter("testcase"))
    except (OSError, ET.ParseError):
        return Tally(failed=[f"{name}: no results: it did not start, or crashed"])
    for case in cases:
        title = f"{name}: {case.get('classname', '')}::{case.get('name')}".replace(": ::", ": ")
        faults = [*case.iter("failure"), *case.iter("error")]
        skip = next(case.iter("skipped"), None)
        if faults:
            tally.failed.append(title)
        elif skip is not None:
            tally.skipped.append(f"{title}: {skip.get('message') or reason}")
        else:
            tally.passed += 1
    if not ended_well and not tally.failed:
        tally.failed.append(f"{name}: ended with a failure after its tests")
    return tally


def format_step() -> Iterator[Tally]:
    tools = Path(sys.executable).parent
    sources = [
        str(p)
        for folder in ("common", "phases", "tests/c", "tests/calibration")
        for p in (ROOT / folder).rglob("*.[ch]")
    ]
    yield one("clang-format", run(tools / "clang-format", "--dry-run", "-Werror", *sources))
    yield one("ruff check", run(tools / "ruff", "check", "."))
    yield one("ruff format", run(tools / "ruff", "format", "--check", "."))


def missing_isa(source: Path) -> str:
    """Instruction sets that a C test's first line, `// flags: -mavx2 …`, asks for and this CPU lacks."""
    have = next(line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("flags"))
    asked = re.findall(r"-m(\w+)", source.read_text().splitlines()[0])
    return ", ".join(flag for flag in asked if flag not in have.split())


def c_step() -> Iterator[Tally]:
    for compiler, folder in {"gcc": "build/asan", "clang": "build/asan-clang"}.items():
        settings = [f"CC={compiler}", f"BUILD={folder}", "SANITIZE=1"]
        if not run("make", "-s", f"-j{JOBS}", *settings, "c-tests"):
            yield Tally(failed=[f"C tests with {compiler}: do not build"])
            continue
        for source in sorted((ROOT / "tests/c").glob("test_*.c")):
            if lacking := missing_isa(source):
                yield Tally(skipped=[f"{source.stem} ({compiler}): the CPU lacks {lacking}"])
                continue
            results = RESULTS / f"{source.stem}-{compiler}.xml"
            results.unlink(missing_ok=True)  # cmocka does not replace a file
            program = ROOT / folder / "tests" / source.stem
            print(f"$ {folder}/tests/{source.stem}", flush=True)
            environment = os.environ | {"CMOCKA_MESSAGE_OUTPUT": "xml", "CMOCKA_XML_FILE": str(results)}
            done = subprocess.run([program], stdout=subprocess.PIPE, text=True, env=environment)
            print(done.stdout, end="", flush=True)
            reason = next(iter(re.findall("^skipped: (.*)", done.stdout, re.MULTILINE)), "")
            tally = read_results(results, f"{source.stem} ({compiler})", done.returncode == 0, reason)
            if tally.failed and results.is_file():
                print(results.read_text(errors="replace"))
            yield tally


def phases_with(file: str) -> list[str]:
    """Names of the phases that have that file, the longest first: no core waits for the last of them."""
    folders = [path.parent for path in (ROOT / "phases").glob(f"*/{file}")]
    sizes = {folder.name: sum(path.stat().st_size for path in folder.glob("*.[ch]")) for folder in folders}
    return sorted(sizes, key=lambda name: (-sizes[name], name))


def embeds(phase: str) -> bool:
    """Whether it compiles itself where it runs: what is counted is its parent's code again (test_blocks)."""
    return "embedded" in json.loads((ROOT / "phases" / phase / "phase.json").read_text())


def systems() -> set[str]:
    """Names of the phases beside the ladder: counted with gcc alone, the rest by tests of their own."""
    return {
        path.parent.name for path in (ROOT / "phases").glob("*/phase.json") if SYSTEMS in path.read_text()
    }


def builds_step() -> Iterator[Tally]:
    phases, beside = phases_with("phase.json"), systems()
    for folder, settings in BUILDS.items():
        yield one(
            f"{folder}/ceilings --check",
            run("make", "-s", f"BUILD={folder}", *settings, f"{folder}/ceilings")
            and run(f"{folder}/ceilings", "--check"),
        )
        make = ["make", "-s", "-k", f"-j{JOBS}", f"BUILD={folder}", *settings]
        counting = [] if "SANITIZE=1" in settings else phases_with("costs.def")  # none is run with sanitizers
        counting = [name for name in counting if folder == "build" or name not in beside]
        targets = {
            phase: [f"{folder}/{phase}/render", f"{folder}/{phase}/probe"]
            + [f"{folder}/{phase}/render-count"] * (phase in counting)
            for phase in phases
        }
        if run(*make, *itertools.chain(*targets.values())):
            yield Tally(passed=len(phases))
        else:  # which of them
            for phase in phases:
                yield one(f"{folder}/{phase} does not build", run(*make, *targets[phase]))


def prepare_step() -> Iterator[Tally]:
    """What several tests want built, by as many jobs as there are cores: no two of them make it at once.

    What does not build is told by the test that wants it.
    """
    ladder = [name for name in phases_with("costs.def") if name not in systems()]
    patches = [
        f"{path.parts[-3]}+{path.stem}" for path in sorted((ROOT / "phases").glob("*/ablations/*.patch"))
    ]
    variants, profiled = ("render-blocks", "render-blocks-calls"), ("baseline", "opt2", "opt3", "opt4")
    wanted = {
        "build": [
            *(f"{name}/{target}" for name in ladder for target in (*variants, "render-ftz")),
            *(f"{name}/{target}" for name in profiled for target in ("render-lines", "render-calls")),
            *(f"{name}/{target}" for name in patches for target in ("render", "render-count", variants[1])),
            *("calibration/calibrate", "calibration/calibrate-blocks", "common/qemu_plugin.so", "truth/rays"),
            *("functions/bench", "rsqrt", "opt2@opt3/render", "packets/hits"),
        ],
        "build/clang": [
            *(f"{name}/{target}" for name in ladder if not embeds(name) for target in variants),
            "calibration/calibrate-blocks",
        ],
    }
    for folder in HARD_BUILDS:
        wanted[folder] = [f"{name}/render" for name in ladder if not embeds(name)]
    for folder, targets in wanted.items():
        settings = (BUILDS | HARD_BUILDS)[folder]
        run(
            *("make", "-s", "-k", f"-j{JOBS}", f"BUILD={folder}", *settings),
            *(f"{folder}/{target}" for target in targets),
        )
    yield Tally()


def parts(folder: str, count: int = 1) -> list[list[Path]]:
    """The folder's test files in groups of about as many lines, the longest file first in its group."""
    groups: list[list[Path]] = [[] for _ in range(count)]
    files = {path: path.stat().st_size for path in sorted((ROOT / folder).glob("test_*.py"))}
    for path in sorted(files, key=files.__getitem__, reverse=True):
        min(groups, key=lambda group: sum(files[one] for one in group)).append(path)
    return [group for group in groups if group]


@dataclass
class Part:
    """Test files that one pytest runs, and which environment it adds."""

    step: str
    number: int
    files: list[Path]
    environment: dict[str, str]

    def tally(self) -> Tally:
        results = RESULTS / f"{self.step}-{self.number}.xml"
        results.unlink(missing_ok=True)
        command = [sys.executable, "-m", "pytest", "-q", f"--junitxml={results}", *self.files]
        return read_results(results, self.step, run(*command, **self.environment))


STEPS: dict[str, Callable[[], Iterator[Tally]]] = {
    "format": format_step,
    "c": c_step,
    "builds": builds_step,
    "prepare": prepare_step,
}
# Steps of pytest: folder, into how many parts, environment. Long ones first: a part begins when a core is
# free.
PYTEST: dict[str, tuple[str, int, dict[str, str]]] = {
    "conformance": ("tests/conformance", 1, {}),
    "conformance-asan": ("tests/conformance", 1, {"STEPWISE_BUILD": "build/asan"}),
    "hard": ("tests/hard", 2, {}),
    "py": ("tests/py", 10, {}),
}


def perform(step: str, total: Tally) -> None:
    """One step after the other: each uses every core itself."""
    print(f"== {step}", flush=True)
    begin = time.monotonic()
    for tally in STEPS[step]():
        total.add(tally)
    print(f"== {step}: {time.monotonic() - begin:.0f} s", flush=True)


def perform_parts(steps: list[str], total: Tally) -> None:
    """The parts of these steps, as many at once as there are cores; a part's output comes when it ends."""
    waiting = [
        Part(step, i, files, environment)
        for step, (folder, count, environment) in PYTEST.items()
        if step in steps
        for i, files in enumerate(parts(folder, count), 1)
    ]
    turn, took = threading.Lock(), dict.fromkeys(steps, 0.0)

    def work() -> None:
        while True:
            with turn:
                if not waiting:
                    return
                part = waiting.pop(0)
            log = RESULTS / f"{part.step}-{part.number}.log"
            begin = time.monotonic()
            try:
                with log.open("w") as out:
                    OUTPUT.set(out)  # of this thread alone
                    tally = part.tally()
            except Exception as error:  # counted: else a thread ends and its tests are missing
                tally = Tally(failed=[f"{part.step}: {error!r}"])
            with turn:
                total.add(tally)
                took[part.step] += time.monotonic() - begin
                said = log.read_text(errors="replace") if log.exists() else ""
                print(f"== {log.stem}\n{said}", end="", flush=True)

    threads = [threading.Thread(target=work) for _ in range(int(JOBS))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for step, seconds in took.items():
        print(f"== {step}: {seconds:.0f} s of one core", flush=True)


def main() -> int:
    known = [*STEPS, *PYTEST]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("steps", nargs="*", metavar="STEP", help=f"of {', '.join(known)}; default: all")
    steps = parser.parse_args().steps or known
    if unknown := [step for step in steps if step not in known]:
        parser.error(f"no step {unknown[0]!r}; there are {', '.join(known)}")
    RESULTS.mkdir(parents=True, exist_ok=True)
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # else each script that a test starts is compiled anew
    total = Tally()
    for step in STEPS:
        if step in steps:
            perform(step, total)
    if pytests := [step for step in PYTEST if step in steps]:
        perform_parts(pytests, total)
    for title in total.skipped:
        print(f"skipped: {title}")
    for title in total.failed:
        print(f"FAILED: {title}")
    print(f"{total.passed} passed, {len(total.failed)} failed, {len(total.skipped)} skipped")
    nothing = not total.passed and steps != ["prepare"]  # which tests nothing
    return 1 if total.failed or nothing else 0


if __name__ == "__main__":
    sys.exit(main())
