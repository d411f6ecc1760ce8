"""A phase under AddressSanitizer and UndefinedBehaviorSanitizer: what they say, and what to do about it.

Each plane of the frame stands between memory that traps (common/frame/frame.c), which sees what ASan cannot.
A program that has not ended in time is asked where it is by a signal at which ASan tells its stack.
"""

import os
import re
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

from study.core import run
from study.core.build import build
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child, sandbox
from study.core.registry import ROOT, Scene, Spec, find_phase

FOLDER = "build/judge"
SETTINGS = ("SANITIZE=1", "WARNINGS=-w")  # the sanitizers' code has warnings that the phase has not
LINES = 24  # of their text, at most
SECONDS, TELLING = 90.0, 10.0  # of a picture on an idle machine; and for the stack of one that has not ended
MB = 1 << 20
TOLD = {
    "ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=0"
    f":max_allocation_size_mb={sandbox.MEMORY // MB}:hard_rss_limit_mb={sandbox.MEMORY // MB}",
    "UBSAN_OPTIONS": "print_stacktrace=1",
    run.UNTIMED: "1",
} | run.GENERAL
SMALL = (61, 23)  # pixels: a row is no whole number of packets, and a plane no whole number of cache lines
BEGIN = re.compile(
    r"ERROR: AddressSanitizer|runtime error:|^AddressSanitizer:(?!DEADLY)|hard rss limit", re.MULTILINE
)
FOREIGN = re.compile(r"^ +#.*(?:\((?:/|build/)| \.\./)")  # frames of libraries
PLACE = re.compile(r"((?:phases|systems|build/[\w@+]+/source)/[\w./]+\.[ch]:\d+)")
ADVICE = {  # by the first pattern that their text has: the key of a hint, and the hint
    "room": (
        "allocation-size-too-big|out-of-memory|rss limit|calloc-overflow",
        f"It asks for more memory than {sandbox.MEMORY // sandbox.GB} GB. Which numbers make that size?",
    ),
    "undefined": (
        "runtime error:",
        "C does not say what that line does, so each compiler may do another thing. Print the values"
        " that the line above names.",
    ),
    "plane": (
        "use-after-poison|SEGV",
        "It goes beside a plane of the frame, or where no memory is. A plane has width · height pixels,"
        " and the last packet of a row may hold fewer than it has lanes.",
    ),
    "array": (
        "overflow|underflow|out-of-bounds",
        "It goes over an array's end. How many elements has it, and which is the last index of that line?",
    ),
    "freed": ("use-after|double-free|bad-free|alloc-dealloc", "It uses memory that is no longer its own."),
    "late": (
        "(?!)",  # no text has it
        "Does that loop end? Or has a write to a wrong place changed what it waits for?",
    ),
    "ends": (
        "",
        "It must return to the driver from each function of common/phase.h: no exit, no endless loop.",
    ),
}


@dataclass(frozen=True)
class Fault:
    """`kind`: a key of ADVICE; `said`: what and where, in a line; `text`: the sanitizer's own."""

    kind: str
    said: str
    text: str = ""


def fault_of(stderr: str, ended: str, late: bool = False) -> Fault:
    """The fault of a program that has failed; `ended`: how, where no sanitizer tells or its time was over."""
    text = stderr.replace(f"{ROOT}/", "")
    begin = BEGIN.search(text)
    if not begin:
        said = text.strip().splitlines()[-1:]
        return Fault("late" if late else "ends", ": ".join([ended, *said]))
    lines = text[text.rfind("\n", 0, begin.start()) + 1 :].splitlines()
    end = next((i for i, line in enumerate(lines) if line.startswith("SUMMARY")), len(lines))
    lines = [line for line in lines[: end + 1] if line.strip("= ") and not FOREIGN.search(line)][:LINES]
    what = re.search(r"(?:AddressSanitizer|runtime error): (.+?)(?= on address| \(pc|$)", lines[0])
    where = PLACE.search("\n".join(lines))
    late = late and "AddressSanitizer: FPE" in lines[0]
    kind = next(key for key, (pattern, _) in ADVICE.items() if re.search(pattern, "\n".join(lines)))
    said = [ended if late else what[1] if what else lines[0], *([where[1]] if where else [])]
    return Fault("late" if late else kind, ", ".join(said), "\n".join(lines))


def looked(spec: Spec, scene: Scene, height: int, threads: int = 1) -> Fault | None:
    """What is wrong with its memory, in two frames of a small picture with all planes and in one of this
    height. Raises StudyError where the sanitizers are missing."""
    try:
        program = build(spec, "render", FOLDER, SETTINGS)
    except StudyError as error:
        raise StudyError(
            f"the sanitizers' build fails, though the other does not: {error}", CANNOT_RUN
        ) from None
    asked: list[tuple[tuple[int, int], list[str]]] = [
        (SMALL, ["--reps", "2", "--aov"]),
        (scene.size(height), []),
    ]
    if find_phase(spec.phase).display:
        asked.append((SMALL, ["--display"]))
    for (width, high), words in asked:
        sized = ["-w", str(width), "-n", str(high), "--threads", str(threads)]
        command = [str(program), str(scene.path), *sized, *words, "--json"]
        if fault := _run(command):
            again = " ".join(command).replace(f"{ROOT}/", "")
            return Fault(fault.kind, fault.said, f"{fault.text}\nAgain: {again}".strip())
    return None


def _run(command: list[str]) -> Fault | None:
    name, begin = Path(command[0]).parent.name, time.monotonic()
    limit = child.seconds(SECONDS) * max(1.0, os.getloadavg()[0] / len(run.USABLE))  # of what others leave
    asked = ["timeout", "--foreground", "--signal=FPE", f"--kill-after={TELLING}", str(limit), *command]
    with sandbox.unlimited_memory():
        done = child.run(
            asked,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            cwd=ROOT,
            env=os.environ | TOLD,
            timeout=limit + 2 * TELLING,
        )
    if done.returncode in (0, run.UNSUPPORTED, run.NO_ISA):
        return None  # what it does not draw, and that it cannot run here, others say
    if time.monotonic() - begin >= limit:
        return fault_of(
            done.stderr, f"{name}: no end after {limit:.3g} s ({child.LIMIT} allows more)", late=True
        )
    return fault_of(done.stderr, f"{name}: status {done.returncode}")
