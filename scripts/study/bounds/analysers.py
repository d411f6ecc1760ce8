"""What two static analysers say of some assembly, each with the model that fits the processor best.

llvm-mca (llvm.org/docs/CommandGuide/llvm-mca.html) simulates it repeated, for the cycles of one pass when
passes overlap (throughput bound), alone (latency bound), and what holds it up; OSACA (J. Laukemann et al.,
"Automated instruction stream throughput prediction for Intel and AMD microarchitectures", PMBS 2018) for
port pressure, critical path and loop-carried dependency.
"""

from __future__ import annotations

import functools
import importlib.util
import re
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from study.bounds.schema import Mca, Osaca, Split
from study.core import machine, temporary
from study.core.cli import StudyError
from study.core.host import child

PASSES = 100
MCA_SECONDS = 120.0  # of one region; some inputs never end (a known fault of llvm-mca)
LCD_SECONDS = 10  # OSACA's search for the longest loop-carried dependency

# Per microarchitecture the models that fit, best first: llvm-mca's -mcpu with the first LLVM release in which
# that name has a model of its own (llvm/lib/Target/X86/X86.td), and OSACA's --arch.
_SKYLAKE = (("skylake", 6),)
_SERVER = (("skylake-avx512", 6),)
_ICE = (("icelake-server", 14), *_SERVER)
_GOLDEN = (("sapphirerapids", 17), *_ICE)
_ALDER = (("alderlake", 16), *_SKYLAKE)
_ZEN3 = (("znver3", 12), ("znver2", 9))
_ZEN4 = (("znver4", 16), *_ZEN3)
MCPU: dict[str, tuple[tuple[str, int], ...]] = {
    "Sandy Bridge": (("sandybridge", 6),),
    "Ivy Bridge": (("sandybridge", 6),),
    "Haswell": (("haswell", 6),),
    "Broadwell": (("broadwell", 6),),
    **dict.fromkeys(("Skylake", "Kaby Lake", "Comet Lake"), _SKYLAKE),
    **dict.fromkeys(("Cascade Lake", "Cooper Lake"), _SERVER),
    **dict.fromkeys(("Ice Lake", "Tiger Lake", "Rocket Lake"), _ICE),
    **dict.fromkeys(("Alder Lake", "Raptor Lake", "Meteor Lake", "Arrow Lake", "Lunar Lake"), _ALDER),
    **dict.fromkeys((*machine.AMX, machine.SOME_AMX), _GOLDEN),
    "Zen": (("znver1", 6),),
    "Zen 2": (("znver2", 9),),
    "Zen 3": _ZEN3,
    "Zen 4": _ZEN4,
    "Zen 5": _ZEN4,
}
# Names that mean the very core, not a relative of it.
OWN_MCPU = {
    "Ivy Bridge": "ivybridge",
    "Alder Lake": "alderlake",
    "Sapphire Rapids": "sapphirerapids",
    "Emerald Rapids": "sapphirerapids",
    "Tiger Lake": "icelake-server",
    "Rocket Lake": "icelake-server",
    "Raptor Lake": "alderlake",
    "Zen 5": "znver5",
}
OSACA_ARCH: dict[str, tuple[str, ...]] = {
    "Sandy Bridge": ("SNB",),
    "Ivy Bridge": ("IVB",),
    "Haswell": ("HSW",),
    "Broadwell": ("BDW",),
    **dict.fromkeys(("Skylake", "Kaby Lake", "Comet Lake"), ("SKX",)),
    **dict.fromkeys(("Cascade Lake", "Cooper Lake"), ("CSX", "SKX")),
    "Ice Lake": ("ICX", "ICL", "SKX"),
    **dict.fromkeys(("Tiger Lake", "Rocket Lake"), ("ICL", "SKX")),
    **dict.fromkeys(
        ("Alder Lake", "Raptor Lake", "Meteor Lake", "Arrow Lake", "Lunar Lake"), ("SPR", "ICX", "SKX")
    ),
    **dict.fromkeys((*machine.AMX, machine.SOME_AMX), ("SPR", "ICX", "SKX")),
    "Zen": ("ZEN1",),
    "Zen 2": ("ZEN2", "ZEN1"),
    "Zen 3": ("ZEN3", "ZEN2", "ZEN1"),
    "Zen 4": ("ZEN4", "ZEN3", "ZEN2", "ZEN1"),
    "Zen 5": ("ZEN4", "ZEN3", "ZEN2", "ZEN1"),
}
# A processor that the tables do not have, by what it can do.
BY_FLAG = (("avx512f", "Cascade Lake"), ("avx2", "Haswell"), ("", "Sandy Bridge"))


def split(mca: Mca) -> Split:
    """Retiring, and the rest divided by what llvm-mca blames: ports and registers are core bound."""
    retiring = min(1.0, mca.uops / mca.width / mca.throughput)
    blamed = mca.resources + mca.registers + mca.memory
    memory = (1 - retiring) * (mca.memory / blamed if blamed else 0.0)
    ports = (1 - retiring) * (mca.resources / blamed if blamed else 0.0)
    core = 1 - retiring - memory
    return Split(retiring=retiring, memory=memory, core=core, ports=ports, dependencies=core - ports)


def parse_mca(text: str, passes: int = PASSES) -> dict[str, float]:
    """Figures of llvm-mca's summary and bottleneck views. StudyError for other or cut-off text."""
    wanted = {
        "iterations": r"^Iterations:\s+(\d+)",
        "instructions": r"^Instructions:\s+(\d+)",
        "cycles": r"^Total Cycles:\s+(\d+)",
        "uops": r"^Total uOps:\s+(\d+)",
        "width": r"^Dispatch Width:\s+(\d+)",
        "block": r"^Block RThroughput:\s+([\d.]+)",
    }
    found = {}
    for name, pattern in wanted.items():
        match = re.search(pattern, text, re.MULTILINE)
        if not match:
            raise StudyError(f"llvm-mca: its output lacks {name}; it begins {text[:60]!r}")
        found[name] = float(match[1])
    if found["iterations"] != passes or not found["cycles"] or not found["width"]:
        raise StudyError(f"llvm-mca: {found['iterations']:.0f} iterations in place of {passes}")
    # Without a bottleneck there is no such view.
    for name, label in (
        ("resources", "Resource Pressure"),
        ("registers", "- Register Dependencies"),
        ("memory", "- Memory Dependencies"),
    ):
        match = re.search(rf"{label}\s+\[\s*([\d.]+)%\s*\]", text)
        found[name] = float(match[1]) / 100 if match else 0.0
    return found


@functools.cache
def mca_program() -> tuple[str, int] | None:
    """Path and release of the newest llvm-mca."""
    names = ["llvm-mca", *(f"llvm-mca-{release}" for release in range(40, 10, -1))]
    found = []
    for name in names:
        if path := shutil.which(name):
            said = child.run([path, "--version"], capture_output=True, text=True).stdout
            if release := re.search(r"LLVM version (\d+)", said):
                found.append((path, int(release[1])))
    return max(found, key=lambda one: one[1], default=None)


def mca_missing() -> str | None:
    return (
        None
        if mca_program()
        else "llvm-mca is missing; the package llvm adds cycles of the hot loops (Table 3)"
    )


def osaca_program() -> list[str] | None:
    """How it is called: as a module, since a script in a path with quotes does not start."""
    if importlib.util.find_spec("osaca"):
        return [sys.executable, "-m", "osaca"]
    return [found] if (found := shutil.which("osaca")) else None


def osaca_missing() -> str | None:
    return (
        None
        if osaca_program()
        else "osaca is missing; `make setup` adds port pressure and critical paths (Table 3)"
    )


@dataclass(frozen=True)
class Processor:
    """What is modelled: the microarchitecture, and whether that is this machine's name or a guess."""

    name: str
    known: bool


def this_processor(cpu: dict[str, Any] | None = None) -> Processor:
    cpu = machine.cpu() if cpu is None else cpu
    name = cpu.get("microarchitecture")
    if name in MCPU:
        return Processor(name, True)
    flags = cpu.get("flags", ())
    return Processor(next(like for flag, like in BY_FLAG if not flag or flag in flags), False)


def mcpu(processor: Processor, release: int) -> tuple[str, str | None]:
    """-mcpu for this LLVM, and a remark where it is not the processor's own."""
    several = MCPU[processor.name]
    chosen = next((name for name, first in several if first <= release), several[-1][0])
    own = OWN_MCPU.get(processor.name, several[0][0])
    if processor.known and chosen == own:
        return chosen, None
    what = f"{processor.name} has no model in LLVM {release}" if processor.known else "processor not known"
    return chosen, f"{what}: modelled as {chosen}"


def run_mca(text: str, mcpu: str) -> Mca:
    """llvm-mca of some assembly, repeated and alone. Raises StudyError with its own last line."""
    path = mca_program()
    if path is None:
        raise StudyError(str(mca_missing()))
    figures = []
    for passes in (PASSES, 1):
        options = [
            f"-mcpu={mcpu}",
            f"-iterations={passes}",
            "-bottleneck-analysis",
            "-instruction-info=false",
        ]
        options += ["-resource-pressure=false", "-mtriple=x86_64-linux-gnu"]
        done = child.run([path[0], *options], input=text, capture_output=True, text=True, timeout=MCA_SECONDS)
        if done.returncode:
            lines = [line for line in done.stderr.splitlines() if "error" in line]
            raise StudyError(f"llvm-mca: {(lines or ['failed'])[0]}")
        figures.append(parse_mca(done.stdout, passes))
    many, one = figures
    made = Mca(
        throughput=many["cycles"] / PASSES,
        latency=one["cycles"],
        block_throughput=many["block"],
        uops=many["uops"] / PASSES,
        width=int(many["width"]),
        resources=many["resources"],
        registers=many["registers"],
        memory=many["memory"],
    )
    made.split = split(made)
    return made


def parse_osaca(text: str, arch: str) -> Osaca:
    """OSACA's --yaml-out. StudyError for other or cut-off text."""
    summary = re.search(r"^Summary:\s*\n(.*)^Target:", text, re.MULTILINE | re.DOTALL)
    if not summary:
        raise StudyError(f"osaca: its output lacks the summary; it begins {text[:60]!r}")
    flat = " ".join(summary[1].split())
    ports = re.search(r"PortPressure: \{(.*?)\}", flat)
    path, carried = re.search(r"CriticalPath: ([\d.]+)", flat), re.search(r"LCD: ([\d.]+)", flat)
    if not (ports and path and carried):
        raise StudyError("osaca: its summary lacks PortPressure, CriticalPath or LCD")
    pressure = {name: float(value) for name, value in re.findall(r"'?(\w+)'?: ([\d.]+)", ports[1])}
    if not pressure:
        raise StudyError("osaca: its summary has no port")
    worst = max(pressure, key=pressure.__getitem__)
    instructions = len(re.findall(r"^  Instruction: (?!null)\S", text, re.MULTILINE))
    unknown = len(re.findall(r"^  Flags: \[[^\]]*tp_unk", text, re.MULTILINE))
    late = re.search(r"^Warnings: .*LCDWarning", text, re.MULTILINE | re.DOTALL)
    loop_carried = None if late else float(carried[1])
    return Osaca(
        arch=arch,
        throughput=pressure[worst],
        port=worst,
        critical_path=float(path[1]),
        loop_carried=loop_carried,
        instructions=instructions,
        unknown=unknown,
    )


def run_osaca(text: str, arch: str, quick: bool = False) -> Osaca:
    """OSACA of some assembly; `quick` without the search for loop-carried dependencies."""
    program = osaca_program()
    if program is None:
        raise StudyError(str(osaca_missing()))
    with temporary.folder() as folder:
        source, out = folder / "region.s", folder / "region.yaml"
        source.write_text(text, encoding="utf-8")
        options = ["--arch", arch, "--syntax", "ATT", "--ignore-unknown", "--yaml-out", str(out)]
        options += ["--fixed", "--lcd-timeout", "0"] if quick else ["--lcd-timeout", str(LCD_SECONDS)]
        done = child.run([*program, *options, str(source)], capture_output=True, text=True)
        if done.returncode or not out.exists():
            raise StudyError(f"osaca: {(done.stderr.strip().splitlines() or ['failed'])[-1]}")
        return parse_osaca(out.read_text(encoding="utf-8", errors="replace"), arch)


def osaca_arch(text: str, archs: Sequence[str]) -> str:
    """The first of `archs` whose tables have the most of the instructions: newer tables lack common ones."""
    unknown = {}
    for arch in archs:
        unknown[arch] = run_osaca(text, arch, quick=True).unknown if len(archs) > 1 else 0
        if unknown[arch] == 0:
            break
    return min(unknown, key=unknown.__getitem__)
