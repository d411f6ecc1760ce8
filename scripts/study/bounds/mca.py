"""What llvm-mca says of some assembly (llvm.org/docs/CommandGuide/llvm-mca.html), by its model of this CPU.

It simulates the code repeated, for the cycles of one pass when passes overlap (throughput bound), alone
(latency bound), and what holds it up.
"""

import functools
import re
import shutil
from dataclasses import dataclass

from study.bounds.schema import Mca, Split
from study.core import machine
from study.core.cli import StudyError
from study.core.host import child

PASSES = 100
SECONDS = 120.0  # of one region; some inputs never end (a known fault of llvm-mca)
MISSING = "llvm-mca is missing; the package llvm adds cycles of the hot loops (Table 3)"
# A processor that LLVM does not know, by what it can do.
BY_FLAG = (("avx512f", "skylake-avx512"), ("avx2", "haswell"), ("", "sandybridge"))
_SUMMARY = {
    "iterations": r"^Iterations:\s+(\d+)",
    "cycles": r"^Total Cycles:\s+(\d+)",
    "uops": r"^Total uOps:\s+(\d+)",
    "width": r"^Dispatch Width:\s+(\d+)",
    "block": r"^Block RThroughput:\s+([\d.]+)",
}
_BLAMED = {
    "resources": "Resource Pressure",
    "registers": "- Register Dependencies",
    "memory": "- Memory Dependencies",
}


@dataclass(frozen=True)
class Figures:
    """Figures of one simulation; the last three: share of the cycles in which their pressure grows."""

    iterations: float
    cycles: float
    uops: float
    width: float
    block: float
    resources: float
    registers: float
    memory: float


@dataclass(frozen=True)
class Model:
    """The newest llvm-mca and the processor that it simulates; `guessed`: LLVM does not know this one."""

    path: str
    release: int
    cpu: str
    guessed: bool = False

    @property
    def name(self) -> str:
        return f"llvm-mca {self.release} -mcpu={self.cpu}"


@functools.cache
def model() -> Model | None:
    """None without llvm-mca."""
    found = []
    for name in ("llvm-mca", *(f"llvm-mca-{release}" for release in range(40, 10, -1))):
        if path := shutil.which(name):
            said = child.run([path, "--version"], capture_output=True, text=True).stdout
            if release := re.search(r"LLVM version (\d+)", said):
                host = re.search(r"Host CPU: (\S+)", said)
                found.append(Model(path, int(release[1]), host[1] if host else "generic"))
    newest = max(found, key=lambda one: one.release, default=None)
    if newest is None or not newest.cpu.startswith(("generic", "x86-64", "(")):
        return newest
    flags = machine.cpu().flags
    like = next(like for flag, like in BY_FLAG if not flag or flag in flags)
    return Model(newest.path, newest.release, like, guessed=True)


def parse(text: str, passes: int = PASSES) -> Figures:
    """The summary and bottleneck views. StudyError for other or cut-off text."""
    found = {}
    for name, pattern in _SUMMARY.items():
        match = re.search(pattern, text, re.MULTILINE)
        if not match:
            raise StudyError(f"llvm-mca: its output lacks {name}; it begins {text[:60]!r}")
        found[name] = float(match[1])
    for name, label in _BLAMED.items():  # without a bottleneck there is no such view
        match = re.search(rf"{label}\s+\[\s*([\d.]+)%\s*\]", text)
        found[name] = float(match[1]) / 100 if match else 0.0
    made = Figures(**found)
    if made.iterations != passes or not made.cycles or not made.width:
        raise StudyError(f"llvm-mca: {made.iterations:.0f} iterations in place of {passes}")
    return made


def split(one: Mca) -> Split:
    """Retiring, and the rest divided by what is blamed: ports and registers are core bound."""
    retiring = min(1.0, one.uops / one.width / one.throughput)
    blamed = one.resources + one.registers + one.memory
    memory, ports = (
        (1 - retiring) * (part / blamed if blamed else 0.0) for part in (one.memory, one.resources)
    )
    core = 1 - retiring - memory
    return Split(retiring=retiring, memory=memory, core=core, ports=ports, dependencies=core - ports)


def run(text: str, model: Model) -> Mca:
    """Figures of some assembly, repeated and alone. Raises StudyError with llvm-mca's own words."""
    views = ["-bottleneck-analysis", "-instruction-info=false", "-resource-pressure=false"]
    command = [model.path, f"-mcpu={model.cpu}", *views, "-mtriple=x86_64-linux-gnu"]
    figures = []
    for passes in (PASSES, 1):
        once = [*command, f"-iterations={passes}"]
        done = child.run(once, input=text, capture_output=True, text=True, timeout=SECONDS)
        if done.returncode:
            lines = [line for line in done.stderr.splitlines() if "error" in line]
            raise StudyError(f"llvm-mca: {(lines or ['failed'])[0]}")
        figures.append(parse(done.stdout, passes))
    many, one = figures
    made = Mca(
        throughput=many.cycles / PASSES,
        latency=one.cycles,
        block_throughput=many.block,
        uops=many.uops / PASSES,
        width=int(many.width),
        resources=many.resources,
        registers=many.registers,
        memory=many.memory,
    )
    made.split = split(made)
    return made
