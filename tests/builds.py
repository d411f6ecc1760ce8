"""What the tests build, in two halves: `quick`, what `make test` runs or reads, and the `rest` of it.

One make builds everything, with a make below it for each folder. ccache is used where it is installed.
Standard library only.
"""

from __future__ import annotations

import contextlib
import functools
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "scripts"))

from study.core import patches  # noqa: E402  (standard library only)

JOBS = len(os.sched_getaffinity(0))
# Folders, and what make needs to know. hard-*: what hard cases compare (stability/cases/builds.py).
SETTINGS = {
    "build": [],
    "build/clang": ["CC=clang"],
    "build/asan": ["SANITIZE=1"],
    "build/arm64": ["CC=aarch64-linux-gnu-gcc", "SANITIZERS=-Og"],  # in two thirds of the time of -O1
    "build/arm64-asan": ["CC=aarch64-linux-gnu-gcc", "SANITIZE=1"],
    "build/tsan": ["SANITIZE=thread"],
    "build/hard-fma": ["CC=gcc", "SANITIZERS=-mfma -ffp-contract=fast"],
}
BY_CLANG = ("baseline", "opt4", "opt6_wide")  # of each kind one
GROUPS_BY_CLANG = "opt11_ideal"  # its tree has every file that draws groups by vectors, opt12's kernels apart
RACED = ("opt8_streams", "opt9_convex", "opt10_scene", "packets")  # by test_threads
# Whose blocks test_blocks counts: scalar, without pointers, by hand, lanes, and the last, whose tree has the
# files of opt9 and opt10 as well; and what clang makes of two of them.
COUNTED = ("baseline", "opt2", "opt4", "opt6_wide", "opt11_ideal")
COUNTED_BY_CLANG = ("baseline", "opt4")
# Their counted calls are read for warnings alone: opt6 and opt11 run the same files.
READ = ("opt7_tiles", "opt8_streams", "opt9_convex", "opt10_scene")
LOUD = os.environ.get("V", "") not in ("", "0")  # whether commands are shown
CCACHE = Path("/usr/lib/ccache")  # Debian's: has a gcc and a clang that ask ccache first
# It is to keep what was compiled with a parsed header (compile.py) too.
PARSED = {"CCACHE_SLOPPINESS": "pch_defines,time_macros", "CCACHE_PCH_EXTSUM": "1"}
END = 5  # seconds that what was started has for its end before it is killed

# Programs of aarch64 that are run under an emulator (tests/arm64): where lanes are NEON's, sanitized too.
ARM64_WORDS = ("test_simd_4", "test_simd_8")
ARM64_TESTS = (*ARM64_WORDS, "test_dd", "test_interval", "test_bulb_8", "test_bvh", "test_fixed", "test_ball")
ARM64_TESTS += ("test_group_fields", "test_group_programs_8", "test_widest_cones_8")

# Programs by folder: {"build": ["opt1/render"]}.
Wanted = dict[str, list[str]]
# The same by the name of the test that each of them is: that they build without a warning.
Tests = dict[str, Wanted]


def run(command: Sequence[str | Path], log: Path | None = None, **environment: str) -> bool:
    """Whether the command ended well; `log` takes what it prints. If this program is ended, so is everything
    that the command started."""
    if LOUD:
        print("$", *(f"{key}={value}" for key, value in environment.items()), *command, flush=True)
    with log.open("w") if log else contextlib.nullcontext() as out:
        process = subprocess.Popen(
            command, cwd=ROOT, env=os.environ | environment, process_group=0, stdout=out, stderr=out
        )
    try:
        return process.wait() == 0
    except BaseException:
        for end in (signal.SIGTERM, signal.SIGKILL):
            with contextlib.suppress(ProcessLookupError, subprocess.TimeoutExpired):
                os.killpg(process.pid, end)
                process.wait(END)
        raise


@functools.cache
def phases(file: str = "phase.json") -> list[str]:
    """Names of the phases whose tree has that file, the longest first: no core waits for the last of them."""
    trees = {name: patches.files(name) for name in patches.folders()}
    sizes = {
        name: sum(path.stat().st_size for path in tree.values())
        for name, tree in trees.items()
        if file in (*tree, "phase.json")
    }
    return sorted(sizes, key=lambda name: (-sizes[name], name))


@functools.cache
def of_family(family: str) -> set[str]:
    return {name for name in phases() if patches.about(name)["family"] == family}


def quick_tests() -> Tests:
    """Every phase by gcc, and the C tests, sanitized."""
    tests: Tests = {"ceilings by gcc": {"build": ["ceilings"]}, "C tests": {"build/asan": ["c-tests"]}}
    return tests | {f"{name} by gcc": by_gcc(name) for name in phases()}


def by_gcc(name: str) -> Wanted:
    return {"build": [f"{name}/render", f"{name}/probe"]}


def phase_tests(name: str) -> Tests:
    """Builds of one phase after an edit."""
    return {f"{name} by gcc": by_gcc(name), f"{name} read by clang": {"build/clang": [f"{name}/syntax/read"]}}


def rest_tests() -> Tests:
    """Every phase read by clang and sanitized, the counting programs, and what clang makes."""
    tests: Tests = {"common by clang": {"build/clang": ["ceilings"]}}
    for name in phases():
        tests[f"{name} read by clang"] = {"build/clang": [f"{name}/syntax/read"]}
        tests[f"{name} sanitized"] = {"build/asan": [f"{name}/render", f"{name}/probe"]}
    for name in (*BY_CLANG, GROUPS_BY_CLANG):
        tests[f"{name} by clang"] = {"build/clang": [f"{name}/render", f"{name}/probe"]}
    for name in phases("costs.def"):
        tests[f"{name} counted"] = {"build": [f"{name}/{'count/read' if name in READ else 'render-count'}"]}
    tests["ceilings sanitized"] = {"build/asan": ["ceilings"]}
    tests["C tests by clang"] = {"build/clang": [f"tests/{name}" for name in c_tests_by_clang()]}
    if not arm64_missing():
        tests |= {f"{name} for aarch64": {"build/arm64": [f"{name}/render"]} for name in phases()}
        for folder, names in (("build/arm64", ARM64_TESTS), ("build/arm64-asan", ARM64_WORDS)):
            tests[f"C tests in {folder}"] = {folder: [f"tests/{name}" for name in names]}
    return tests


def c_tests_by_clang() -> list[str]:
    """Tests of lanes, approximations and what phases compute; gcc's hold reading scenes and the like."""
    left = ("frame", "measure", "scene", "viewer")
    return sorted(p.stem for p in (ROOT / "tests/c").glob("*/test_*.c") if p.parent.name not in left)


@functools.cache
def arm64_missing() -> str:
    """What is not installed of cross-building and emulating aarch64; "" if everything is."""
    compiler = SETTINGS["build/arm64"][0].removeprefix("CC=")
    for tool in (compiler, "qemu-aarch64"):
        if not shutil.which(tool):
            return f"{tool} is not installed: tests/arm64/libraries.sh"
    for library in ("libjansson.so", "libOpenEXRCore.so", "libcmocka.so", "libz.so"):
        found = subprocess.run([compiler, f"-print-file-name={library}"], capture_output=True, text=True)
        if "/" not in found.stdout:
            return f"{library} for arm64 is not installed: tests/arm64/libraries.sh"
    return ""


def quick_needs() -> Wanted:
    """What several quick tests want built, so that no two of them make it at once. Of what does not build the
    test that wants it tells.
    """
    return {"build": ["truth/rays", *viewer()], "build/hard-fma": ["baseline/render"]}


def viewer() -> list[str]:
    """The viewer, where its library is: with a window if SDL2 is there too (common/viewer/viewer.mk)."""
    found = subprocess.run(["pkg-config", "--exists", "libpng"]).returncode == 0
    return ["viewer"] if found else []


def rest_needs() -> Wanted:
    """The same of the other tests: of the paper's steps, which declare FLOPs, what their declaration is held
    against; of an ablation whose head says why it declares none (`costs:`) the picture alone."""
    systems = of_family("systems")
    counting = [name for name in phases("costs.def") if name not in systems]
    declared = [name for name in counting if "variants" not in patches.about(name)]
    steps = {
        f"{name}+{path.stem}": name in declared and not re.search("^costs:", path.read_text(), re.MULTILINE)
        for name, folder in patches.folders().items()
        for path in sorted(folder.glob("ablations/*.patch"))
    }
    blocks = ("render-blocks", "render-blocks-calls")
    return {
        "build": [
            *(f"{name}/{blocks[0]}" for name in sorted({*COUNTED, *declared})),
            *(f"{name}/{blocks[1]}" for name in sorted({*COUNTED[:-1], *declared})),
            *(f"{name}/render-lines" for name in ("baseline", "opt2", "opt4")),
            *(f"{name}/render-calls" for name in ("opt2", "opt3", "opt4")),
            *(f"{name}/render" for name in steps),
            *(f"{name}/{t}" for name, told in steps.items() if told for t in ("render-count", blocks[1])),
            *("calibration/calibrate", "calibration/calibrate-blocks", "common/stepper"),
            *("functions/bench", "opt2@opt3/render", "packets/hits", "tests/test_upper_halves"),
            *(f"fuzz/{path.stem}" for path in sorted((ROOT / "tests" / "fuzz").glob("*.c"))),
        ],
        "build/tsan": [f"{name}/render" for name in RACED],
        "build/hard-fma": [f"{name}/render" for name in BY_CLANG],
        "build/clang": [
            *(f"{name}/{target}" for name in COUNTED_BY_CLANG for target in blocks),
            "calibration/calibrate-blocks",
        ],
    }


def together(every: Iterable[Wanted]) -> Wanted:
    found: Wanted = {}
    for wanted in every:
        for folder, targets in wanted.items():
            found.setdefault(folder, []).extend(targets)
    return found


def path_of(folder: str, target: str) -> str:
    return target if target == "c-tests" else f"{folder}/{target}"  # that one is a rule's name, no file


def programs(wanted: Wanted) -> list[str]:
    """Where everything that is wanted is once it is built."""
    return [str(ROOT / path_of(folder, target)) for folder, targets in wanted.items() for target in targets]


def environment() -> dict[str, str]:
    """Environment of the builds and of the tests, which compile the same sources again in copies of the
    project: ccache is asked first, and ablations have what runs here alone (phase_info.py)."""
    cached = {"PATH": f"{CCACHE}:{os.environ['PATH']}", **PARSED} if CCACHE.is_dir() else {}
    return {"STEPWISE_WIDEST": "opt6_wide+awake", **cached}  # drawn in both widths: test_lane_widths


def make(wanted: Wanted, results: Path) -> bool:
    """Whether all of it is built: by one make that has a make for each folder. They share its jobs, and no
    core waits for the end of a folder.
    """
    rules = [
        f"all: {folder}\n.PHONY: {folder}\n{folder}:\n\t+@$(MAKE) -f Makefile {'' if LOUD else '-s '}-k "
        + " ".join(
            f"'{word}'"
            for word in [f"BUILD={folder}", *SETTINGS[folder], *(path_of(folder, t) for t in targets)]
        )
        for folder, targets in wanted.items()
    ]
    results.mkdir(parents=True, exist_ok=True)
    file = results / "builds.mk"
    file.write_text("\n\n".join(rules) + "\n")
    return run(["make", *([] if LOUD else ["-s"]), "-k", f"-j{JOBS}", "-f", file], **environment())


def build(tests: Tests, needs: Wanted, results: Path) -> list[str]:
    """Builds all of it, and returns the names of the tests that failed."""
    good = make(together([*tests.values(), needs]), results)
    for folder in SETTINGS:  # parsed headers (rules.mk): 24 MB each, and hardly of use any more
        shutil.rmtree(ROOT / folder / "common/parsed", ignore_errors=True)
    return [name for name, wanted in tests.items() if not (good or make(wanted, results))]
