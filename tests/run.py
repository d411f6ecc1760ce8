#!/usr/bin/env python3
"""Runs the tests, all or the steps named, and ends with the line 'N passed, N failed, N skipped'.

Every program of the tests writes JUnit XML into build/test-results; the sums are made from those. A step
that ends badly without saying which test failed counts as one failure. What builds comes first and uses every
core; then the tests in parts, AT_ONCE of them at a time. Standard library only.
"""

from __future__ import annotations

import argparse
import contextvars
import functools
import os
import re
import shutil
import subprocess
import sys
import threading
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "scripts"))

from study.core import patches  # noqa: E402  (standard library only)

RESULTS = ROOT / "build" / "test-results"
JOBS = str(len(os.sched_getaffinity(0)))
# One more than there are cores: many tests start processes that pin themselves to a core, others wait. With
# as many parts as cores, these stood still for a quarter of the time (/proc/stat, 2 cores).
AT_ONCE = int(JOBS) + 1
# How every phase is built: folder, and what make needs to know. Conformance runs on the first and the third.
BUILDS = {
    "build": [],
    "build/clang": ["CC=clang"],
    "build/asan": ["SANITIZE=1"],
}
# Built for single steps: the C tests by clang, and what hard cases compare (stability/cases/builds.py).
SETTINGS = BUILDS | {
    "build/asan-clang": ["CC=clang", "SANITIZE=1"],
    "build/hard-fast": ["CC=gcc", "SANITIZERS=-ffast-math"],
    "build/hard-fma": ["CC=gcc", "SANITIZERS=-mfma -ffp-contract=fast"],
}
C_BUILDS = {"gcc": "build/asan", "clang": "build/asan-clang"}

SYSTEMS = '"family": "systems"'  # in a phase.json: alternatives to the ladder

# Where a step's output goes; None: to the terminal, as it comes.
OUTPUT: contextvars.ContextVar[IO[str] | None] = contextvars.ContextVar("output", default=None)


@dataclass
class Tally:
    passed: int = 0
    failed: list[str] = field(default_factory=list)
    skipped: list[tuple[str, str]] = field(default_factory=list)  # name, reason

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
            tally.skipped.append((title, skip.get("message") or reason))
        else:
            tally.passed += 1
    if not ended_well and not tally.failed:
        tally.failed.append(f"{name}: ended with a failure after its tests")
    return tally


def format_tally() -> Tally:
    tools, total = Path(sys.executable).parent, Tally()
    sources = [
        str(p)
        for folder in ("common", "phases", "tests/c", "tests/calibration", "tests/emulate")
        for p in (ROOT / folder).rglob("*.[ch]")
    ]
    total.add(one("clang-format", run(tools / "clang-format", "--dry-run", "-Werror", *sources)))
    total.add(one("ruff check", run(tools / "ruff", "check", ".")))
    total.add(one("ruff format", run(tools / "ruff", "format", "--check", ".")))
    return total


def missing_isa(source: Path) -> str:
    """Instruction sets that a C test's first line, `// flags: -mavx2 …`, asks for and this CPU lacks."""
    have = next(line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("flags"))
    asked = re.findall(r"-m(\w+)", source.read_text().splitlines()[0])
    return ", ".join(flag for flag in asked if flag not in have.split())


def c_tally(source: Path, compiler: str) -> Tally:
    """One C test's program."""
    name, out = f"{source.stem} ({compiler})", OUTPUT.get()
    if lacking := missing_isa(source):
        return Tally(skipped=[(name, f"the CPU lacks {lacking}")])
    results = RESULTS / f"{source.stem}-{compiler}.xml"
    results.unlink(missing_ok=True)  # cmocka does not replace a file
    target = f"{C_BUILDS[compiler]}/tests/{source.stem}"
    settings = [*SETTINGS[C_BUILDS[compiler]], f"BUILD={C_BUILDS[compiler]}"]
    if not run("make", "-s", *settings, target):  # an old program may be there: make must agree
        return Tally(failed=[f"{name}: does not build"])
    print(f"$ {target}", file=out, flush=True)
    environment = os.environ | {"CMOCKA_MESSAGE_OUTPUT": "xml", "CMOCKA_XML_FILE": str(results)}
    done = subprocess.run([ROOT / target], stdout=subprocess.PIPE, stderr=out, text=True, env=environment)
    print(done.stdout, end="", file=out, flush=True)
    reason = next(iter(re.findall("^skipped: (.*)", done.stdout, re.MULTILINE)), "")
    tally = read_results(results, name, done.returncode == 0, reason)
    if tally.failed and results.is_file():
        print(results.read_text(errors="replace"), file=out)
    return tally


def phases_with(file: str) -> list[str]:
    """Names of the phases whose tree has that file, the longest first: no core waits for the last of them."""
    names = [path.parent.name for path in (ROOT / "phases").glob("*/phase.json")]
    trees = {name: patches.files(name) for name in names}
    sizes = {
        name: sum(path.stat().st_size for path in tree.values())
        for name, tree in trees.items()
        if file in tree or file == "phase.json"
    }
    return sorted(sizes, key=lambda name: (-sizes[name], name))


def embeds(phase: str) -> bool:
    """Whether it compiles itself where it runs: what is counted is its parent's code again (test_blocks)."""
    return "embedded" in patches.about(phase)


def systems() -> set[str]:
    """Names of the phases beside the ladder: counted with gcc alone, the rest by tests of their own."""
    return {
        path.parent.name for path in (ROOT / "phases").glob("*/phase.json") if SYSTEMS in path.read_text()
    }


def of_phases() -> dict[str, dict[str, list[str]]]:
    """What is built of each phase, and counts as a test: folder, phase, targets.

    Counting programs are run as gcc makes them; clang reads their sources, and both read those of variants
    that this CPU does not run (rules.mk), which clang does not build.
    """
    phases, counting, beside = phases_with("phase.json"), phases_with("costs.def"), systems()
    made: dict[str, dict[str, list[str]]] = {}
    for folder in BUILDS:
        targets = ["render", "probe"] + (["read"] if folder == "build/clang" else [])
        made[folder] = {phase: list(targets) for phase in phases}
        for phase in counting:
            if folder == "build":
                made[folder][phase] += ["render-count", "count/read"]
            elif folder == "build/clang" and phase not in beside:
                made[folder][phase] += ["count/read"]
    return made


def for_tests() -> dict[str, list[str]]:
    """What several tests want built, so that no two of them make it at once. Of what does not build the test
    that wants it tells.
    """
    ladder = [name for name in phases_with("costs.def") if name not in systems()]
    # What test_ablations runs of them: no counting program of one whose head says why no costs are declared
    # (the compilers read those sources there).
    patches = {
        f"{path.parts[-3]}+{path.stem}": re.search("^costs:", path.read_text(), re.MULTILINE) is None
        for path in sorted((ROOT / "phases").glob("*/ablations/*.patch"))
    }
    variants, profiled = ("render-blocks", "render-blocks-calls"), ("baseline", "opt2", "opt3", "opt4")
    by_parent = [name for name in ladder if not embeds(name)]
    return {
        "build": [
            *(f"{name}/{target}" for name in ladder for target in (*variants, "render-ftz")),
            *(f"{name}/{target}" for name in profiled for target in ("render-lines", "render-calls")),
            *(f"{name}/render" for name in patches),
            *(f"{name}/{t}" for name, told in patches.items() if told for t in ("render-count", variants[1])),
            *("calibration/calibrate", "calibration/calibrate-blocks", "common/qemu_plugin.so", "truth/rays"),
            *("functions/bench", "rsqrt", "opt2@opt3/render", "packets/hits"),
            "tests/test_upper_halves",
        ],
        "build/clang": [
            *(f"{name}/{variants[0]}" for name in by_parent),
            *(f"{name}/{variants[1]}" for name in ("baseline", "opt4", "opt9_convex")),  # as test_blocks.py
            "calibration/calibrate-blocks",
        ],
        "build/hard-fast": [f"{name}/render" for name in by_parent],
        "build/hard-fma": [f"{name}/render" for name in by_parent],
    }


def make_all(wanted: dict[str, list[str]]) -> bool:
    """Everything, by one make that has a make for each folder: they share its jobs, and no core waits for the
    end of a folder.
    """
    path = RESULTS / "builds.mk"
    rules = [
        f"all: {folder}\n.PHONY: {folder}\n{folder}:\n\t+@$(MAKE) -f Makefile -s -k "
        + " ".join(f"'{word}'" for word in [f"BUILD={folder}", *SETTINGS[folder], *targets])
        for folder, targets in wanted.items()
    ]
    path.write_text("\n\n".join(rules) + "\n")
    return run("make", "-s", "-k", f"-j{JOBS}", "-f", path)


def builds(steps: list[str]) -> Tally:
    """All that these steps test or want. Each phase in each folder of BUILDS is a test; so are ceilings."""
    wanted: dict[str, list[str]] = {}
    phases = of_phases() if "builds" in steps else {}
    if phases:
        wanted = {
            folder: [f"{folder}/ceilings", *(f"{folder}/{name}/{t}" for name in made for t in made[name])]
            for folder, made in phases.items()
        }
        for folder, targets in for_tests().items():
            wanted.setdefault(folder, []).extend(f"{folder}/{target}" for target in targets)
    if "c" in steps:
        for folder in C_BUILDS.values():
            wanted.setdefault(folder, []).append("c-tests")
    if not wanted:
        return Tally()
    total, good = Tally(), make_all(wanted)
    for folder in wanted:  # parsed headers (rules.mk): 24 MB each, and hardly of use any more
        shutil.rmtree(ROOT / folder / "common/parsed", ignore_errors=True)
    for folder, made in phases.items():
        make = ["make", "-s", "-k", f"-j{JOBS}", f"BUILD={folder}", *SETTINGS[folder]]
        if good:
            total.passed += len(made)
        else:  # which of them
            for phase, targets in made.items():
                built = run(*make, *(f"{folder}/{phase}/{target}" for target in targets))
                total.add(one(f"{folder}/{phase} does not build", built))
        checked = run(*make, f"{folder}/ceilings") and run(f"{folder}/ceilings", "--check")
        total.add(one(f"{folder}/ceilings --check", checked))
    return total


def parts(folder: str, count: int = 1) -> list[list[Path]]:
    """The folder's test files in groups of about as many lines, the longest file first in its group."""
    groups: list[list[Path]] = [[] for _ in range(count)]
    files = {path: path.stat().st_size for path in sorted((ROOT / folder).glob("test_*.py"))}
    for path in sorted(files, key=files.__getitem__, reverse=True):
        min(groups, key=lambda group: sum(files[one] for one in group)).append(path)
    return [group for group in groups if group]


@dataclass
class Part:
    """What is done one after another of a step."""

    step: str
    name: str
    tally: Callable[[], Tally]


def pytest_part(step: str, number: int, files: list[Path], environment: dict[str, str]) -> Part:
    """Test files that one pytest runs, and which environment it adds."""
    name = f"{step}-{number}"

    def tally() -> Tally:
        results = RESULTS / f"{name}.xml"
        results.unlink(missing_ok=True)
        command = [sys.executable, "-m", "pytest", "-q", f"--junitxml={results}", *files]
        return read_results(results, step, run(*command, **environment))

    return Part(step, name, tally)


# Steps of pytest: folder, into how many parts, environment.
PYTEST: dict[str, tuple[str, int, dict[str, str]]] = {
    "conformance": ("tests/conformance", 1, {}),
    "conformance-asan": ("tests/conformance", 1, {"STEPWISE_BUILD": "build/asan"}),
    "py": ("tests/py", 10, {}),
    "hard": ("tests/hard", 2, {}),
}
STEPS = ("builds", "format", *PYTEST, "c")


def parts_of(step: str) -> list[Part]:
    if step == "format":
        return [Part(step, step, format_tally)]
    if step == "c":
        sources = sorted((ROOT / "tests/c").glob("*/test_*.c"))
        return [
            Part(step, f"{source.stem}-{compiler}", functools.partial(c_tally, source, compiler))
            for compiler in C_BUILDS
            for source in sources
        ]
    folder, count, environment = PYTEST[step]
    return [pytest_part(step, i, files, environment) for i, files in enumerate(parts(folder, count), 1)]


def perform(steps: list[str], total: Tally) -> dict[str, float]:
    """The parts of these steps, AT_ONCE of them at a time; a part's output comes when it ends.

    The long ones come first. Returns each step's seconds, its parts' one after another.
    """
    waiting = [part for step in STEPS[1:] if step in steps for part in parts_of(step)]
    turn, took = threading.Lock(), {part.step: 0.0 for part in waiting}

    def work() -> None:
        while True:
            with turn:
                if not waiting:
                    return
                part = waiting.pop(0)
            log = RESULTS / f"{part.name}.log"
            begin = time.monotonic()
            try:
                with log.open("w") as out:
                    OUTPUT.set(out)  # of this thread alone
                    tally = part.tally()
            except Exception as error:  # counted: else a thread ends and its tests are missing
                tally = Tally(failed=[f"{part.step}: {error!r}"])
            seconds = time.monotonic() - begin
            with turn:
                total.add(tally)
                took[part.step] += seconds
                said = log.read_text(errors="replace") if log.exists() else ""
                print(f"== {part.name}: {seconds:.0f} s\n{said}", end="", flush=True)

    threads = [threading.Thread(target=work) for _ in range(AT_ONCE)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return took


def told(total: Tally, took: list[str], seconds: float) -> str:
    """The end of a run: what was skipped, by reason; what failed; how long it took; the sums."""
    reasons: dict[str, list[str]] = {}
    for name, reason in total.skipped:
        reasons.setdefault(reason, []).append(name)
    lines = [f"skipped {len(names)}: {why}: {', '.join(names)}" for why, names in reasons.items()]
    lines += [f"FAILED: {name}" for name in total.failed]
    lines += [f"{seconds // 60:.0f} min {seconds % 60:.0f} s on {JOBS} cores: {', '.join(took)}"]
    lines += [f"{total.passed} passed, {len(total.failed)} failed, {len(total.skipped)} skipped"]
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("steps", nargs="*", metavar="STEP", help=f"of {', '.join(STEPS)}; default: all")
    steps = parser.parse_args().steps or list(STEPS)
    if unknown := [step for step in steps if step not in STEPS]:
        parser.error(f"no step {unknown[0]!r}; there are {', '.join(STEPS)}")
    RESULTS.mkdir(parents=True, exist_ok=True)
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # else each script that a test starts is compiled anew
    begin = time.monotonic()
    print("== builds", flush=True)
    total = builds(steps)
    took = [f"builds {time.monotonic() - begin:.0f} s"]
    print(f"== {took[-1]}", flush=True)
    seconds_of = perform(steps, total)
    took += [f"{step} {seconds:.0f} s of {AT_ONCE} at once" for step, seconds in seconds_of.items()]
    print(told(total, took, time.monotonic() - begin))
    return 1 if total.failed or not total.passed else 0


if __name__ == "__main__":
    sys.exit(main())
