"""What bounds the hot code: Table 3 of the paper, a top-down split by the PMU where there is one, or a model.

The model takes the regions of the shipped code that samples fall into (innermost loops, and what is in no
loop, per function), and asks two static analysers what their instructions need:
llvm-mca (llvm.org/docs/CommandGuide/llvm-mca.html) simulates them repeated, for the cycles of one pass when
passes overlap (throughput bound), alone (latency bound), and what holds them up; OSACA (J. Laukemann et al.,
"Automated instruction stream throughput prediction for Intel and AMD microarchitectures", PMBS 2018) for
port pressure, critical path and loop-carried dependency.

It sees a region as a straight line, every load a hit in L1, every branch known and every instruction there
in time: no front end, no branch misses, no cache, nothing of what a call does inside or of what the line's
branches would leave out. Retiring, core and memory are therefore of the cycles that the model knows.
"""

from __future__ import annotations

import functools
import importlib
import itertools
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study import machine, paper, show
from study.cli import StudyError
from study.profiles import Profile
from study.registry import Scene, Spec
from study.show import Column
from study.symbols import Program, canonical

LEAST = 0.01  # of the frame: a region under it is not modelled
LEAST_OSACA = 0.05  # the same for OSACA, which takes seconds
PASSES = 100
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
    **dict.fromkeys(("Sapphire Rapids", "Emerald Rapids", "Granite Rapids"), _GOLDEN),
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
    **dict.fromkeys(("Sapphire Rapids", "Emerald Rapids", "Granite Rapids"), ("SPR", "ICX", "SKX")),
    "Zen": ("ZEN1",),
    "Zen 2": ("ZEN2", "ZEN1"),
    "Zen 3": ("ZEN3", "ZEN2", "ZEN1"),
    "Zen 4": ("ZEN4", "ZEN3", "ZEN2", "ZEN1"),
    "Zen 5": ("ZEN4", "ZEN3", "ZEN2", "ZEN1"),
}
# A processor that the tables do not have, by what it can do.
BY_FLAG = (("avx512f", "Cascade Lake"), ("avx2", "Haswell"), ("", "Sandy Bridge"))

Row = dict[str, Any]


# --- the code


@dataclass(frozen=True)
class Line:
    """One instruction as objdump writes it. `target`: of a jump inside the function, else None."""

    address: int
    mnemonic: str
    text: str
    target: int | None
    prefix: str = ""

    @property
    def is_call(self) -> bool:
        return self.mnemonic.startswith("call")

    @property
    def jumps(self) -> bool:
        return self.mnemonic.startswith("j")

    @property
    def ends_block(self) -> bool:
        return self.jumps or not self.goes_on

    @property
    def goes_on(self) -> bool:
        """Whether the next instruction may follow."""
        return self.mnemonic not in ("jmp", "ret", "retq", "jmpq", "hlt", "ud2")


_CODE = re.compile(
    r"^\s*([0-9a-f]+):\t(?:(?:notrack|bnd|data16|cs) )*((?:(?:lock|rep|repz|repnz) )?)(\S+)\s*(.*)$"
)
_TARGET = re.compile(r"^([0-9a-f]+) <")


def parse_objdump(text: str) -> list[Line]:
    """Instructions of `objdump -d --no-show-raw-insn`. StudyError if there are none."""
    found = []
    for line in text.splitlines():
        if not (match := _CODE.match(line)):
            continue
        mnemonic, rest = match[3], match[4].split("#")[0].strip()
        target = _TARGET.match(rest)
        jump = int(target[1], 16) if target and mnemonic.startswith("j") else None
        found.append(Line(int(match[1], 16), mnemonic, rest, jump, match[2]))
    if not found:
        raise StudyError(f"objdump: no instruction in {len(text)} characters")
    return found


def disassemble(binary: Path, start: int, size: int) -> list[Line]:
    command = ["objdump", "-d", "--no-show-raw-insn", "-M", "att"]
    limits = [f"--start-address={start:#x}", f"--stop-address={start + size:#x}"]
    try:
        done = subprocess.run([*command, *limits, str(binary)], capture_output=True, text=True)
    except OSError:
        raise StudyError("objdump is missing; binutils adds what bounds the hot loops (Table 3)") from None
    if done.returncode:
        raise StudyError(f"objdump: {(done.stderr.strip().splitlines() or ['failed'])[-1]}")
    return parse_objdump(done.stdout)


def blocks_of(lines: Sequence[Line]) -> dict[int, list[Line]]:
    """Basic blocks by their first address."""
    known = {line.address for line in lines}
    leaders = {lines[0].address} | {line.target for line in lines if line.target in known}
    leaders |= {after.address for line, after in itertools.pairwise(lines) if line.ends_block}
    found: dict[int, list[Line]] = {}
    for line in lines:
        if line.address in leaders:
            current = found.setdefault(line.address, [])
        current.append(line)
    return found


def loops_of(blocks: Mapping[int, Sequence[Line]]) -> dict[int, set[int]]:
    """Natural loops: header to the blocks of its body (A. V. Aho et al., Compilers, 2nd ed., 9.6.6)."""
    order = list(blocks)
    after: dict[int, list[int]] = {}
    for i, (start, lines) in enumerate(blocks.items()):
        last = lines[-1]
        after[start] = [last.target] if last.target in blocks else []
        if last.goes_on and i + 1 < len(order):
            after[start].append(order[i + 1])
    # A block that nothing else leads to is a case of a switch: the computed jumps lead there.
    reached = {order[0]}.union(*after.values())
    cases = [start for start in order if start not in reached]
    for start, lines in blocks.items():
        if lines[-1].jumps and lines[-1].text.startswith("*"):
            after[start] += cases
    before: dict[int, list[int]] = {start: [] for start in order}
    for start, several in after.items():
        for other in several:
            before[other].append(start)
    everything, entry = set(order), order[0]
    roots = {start for start in order if not before[start]} | {entry}
    dominators = {start: {start} if start in roots else everything for start in order}
    changed = True
    while changed:
        changed = False
        for start in order:
            if start in roots:
                continue
            now = set.intersection(*(dominators[other] for other in before[start])) | {start}
            if now != dominators[start]:
                dominators[start], changed = now, True
    loops: dict[int, set[int]] = {}
    for tail, several in after.items():
        for header in several:
            if header in dominators[tail]:
                body = loops.setdefault(header, {header})
                waiting = [tail]
                while waiting:
                    block = waiting.pop()
                    if block not in body:
                        body.add(block)
                        waiting += before[block]
    return loops


@dataclass
class Region:
    """The sampled code of one innermost loop, or of what is in none (`loop` False), in a function.

    `share`: of the frame.
    """

    function: str
    address: int
    loop: bool
    lines: list[Line]
    share: float

    @property
    def name(self) -> str:
        return f"{self.function}+{self.address:#x}" if self.loop else self.function


def regions(profile: Profile, built: Program) -> list[Region]:
    """Where the samples of a shipped build are, the hottest first. Blocks without any sample are left out."""
    weights: dict[int, dict[int, int]] = {}
    for address, weight in profile.addresses.items():
        if function := built.function(address):
            weights.setdefault(function[0], {})[address] = weight
    found = []
    for start, here in weights.items():
        _, size, name = next(f for f in built.functions if f[0] == start)
        if sum(here.values()) < LEAST * profile.weight:
            continue
        blocks = blocks_of(disassemble(built.path, start, size))
        loops = sorted(loops_of(blocks).items(), key=lambda item: len(item[1]))
        parts: dict[int | None, list[int]] = {}
        for block in blocks:
            header = next((h for h, body in loops if block in body), None)
            parts.setdefault(header, []).append(block)
        for header, members in parts.items():
            lines, weight = [], 0
            for block in members:
                inside = sum(here.get(line.address, 0) for line in blocks[block])
                if inside:
                    lines += blocks[block]
                    weight += inside
            if weight:
                offset = (header or start) - start
                share = weight / profile.weight
                found.append(Region(canonical(name), offset, header is not None, lines, share))
    return sorted(found, key=lambda region: -region.share)


def assembly(lines: Iterable[Line]) -> str:
    """The instructions for an analyser: jumps to one label, without calls, returns and padding. Pushes and
    pops become the stores and loads that they are: cores keep the stack pointer aside, the analysers make
    a chain of it (A. Fog, The microarchitecture of Intel, AMD and VIA CPUs: stack engine).
    """
    text = [".Lhere:"]
    for line in lines:
        if line.is_call or line.mnemonic.startswith(("ret", "nop", "endbr", "xchg", "leave")):
            continue
        if line.jumps:
            if line.target is not None or not line.text.startswith("*"):
                text.append(f"\t{line.mnemonic}\t.Lhere")
            continue
        if line.mnemonic in ("push", "pushq", "pop", "popq"):
            register = line.text if line.text.startswith("%") else "%r11"
            if register != line.text:
                text.append(f"\tmovq\t{line.text}, {register}")
            ends = (register, "-8(%rsp)") if line.mnemonic.startswith("push") else ("-8(%rsp)", register)
            text.append(f"\tmovq\t{', '.join(ends)}")
            continue
        text.append(f"\t{line.prefix}{line.mnemonic}\t{line.text}".rstrip())
    return "\n".join(text) + "\n"


# --- the models


@dataclass(frozen=True)
class Mca:
    """llvm-mca's view of one pass: cycles when passes overlap and alone, and what holds cycles up (shares of
    all cycles in which the pressure of resources or dependencies grows)."""

    throughput: float
    latency: float
    block_throughput: float
    uops: float
    width: int
    resources: float
    registers: float
    memory: float

    @property
    def split(self) -> dict[str, float]:
        """Retiring, and the rest divided by what llvm-mca blames: ports and registers are core bound."""
        retiring = min(1.0, self.uops / self.width / self.throughput)
        blamed = self.resources + self.registers + self.memory
        memory = (1 - retiring) * (self.memory / blamed if blamed else 0.0)
        ports = (1 - retiring) * (self.resources / blamed if blamed else 0.0)
        return {
            "retiring": retiring,
            "memory": memory,
            "core": 1 - retiring - memory,
            "ports": ports,
            "dependencies": 1 - retiring - memory - ports,
        }


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
            said = subprocess.run([path, "--version"], capture_output=True, text=True).stdout
            if release := re.search(r"LLVM version (\d+)", said):
                found.append((path, int(release[1])))
    return max(found, key=lambda one: one[1], default=None)


def mca_missing() -> str | None:
    return (
        None
        if mca_program()
        else "llvm-mca is missing; the package llvm adds cycles of the hot loops (Table 3)"
    )


def osaca_program() -> str | None:
    beside = Path(sys.executable).with_name("osaca")
    return str(beside) if beside.exists() else shutil.which("osaca")


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


def this_processor(cpu: Row | None = None) -> Processor:
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
        done = subprocess.run([path[0], *options], input=text, capture_output=True, text=True)
        if done.returncode:
            lines = [line for line in done.stderr.splitlines() if "error" in line]
            raise StudyError(f"llvm-mca: {(lines or ['failed'])[0]}")
        figures.append(parse_mca(done.stdout, passes))
    many, one = figures
    return Mca(
        many["cycles"] / PASSES,
        one["cycles"],
        many["block"],
        many["uops"] / PASSES,
        int(many["width"]),
        many["resources"],
        many["registers"],
        many["memory"],
    )


@dataclass(frozen=True)
class Osaca:
    """OSACA's view of one pass in cycles. `unknown`: instructions that its tables lack, which count as
    nothing, so that every figure is a lower bound. `loop_carried` None: not found in LCD_SECONDS."""

    arch: str
    throughput: float
    port: str
    critical_path: float
    loop_carried: float | None
    instructions: int
    unknown: int


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
    worst = max(pressure, key=pressure.__getitem__)
    instructions = len(re.findall(r"^  Instruction: (?!null)\S", text, re.MULTILINE))
    unknown = len(re.findall(r"^  Flags: \[[^\]]*tp_unk", text, re.MULTILINE))
    late = re.search(r"^Warnings: .*LCDWarning", text, re.MULTILINE | re.DOTALL)
    loop_carried = None if late else float(carried[1])
    return Osaca(arch, pressure[worst], worst, float(path[1]), loop_carried, instructions, unknown)


def run_osaca(text: str, arch: str, quick: bool = False) -> Osaca:
    """OSACA of some assembly; `quick` without the search for loop-carried dependencies."""
    path = osaca_program()
    if path is None:
        raise StudyError(str(osaca_missing()))
    with tempfile.TemporaryDirectory() as folder:
        source, out = Path(folder) / "region.s", Path(folder) / "region.yaml"
        source.write_text(text, encoding="utf-8")
        options = ["--arch", arch, "--syntax", "ATT", "--ignore-unknown", "--yaml-out", str(out)]
        options += ["--fixed", "--lcd-timeout", "0"] if quick else ["--lcd-timeout", str(LCD_SECONDS)]
        done = subprocess.run([path, *options, str(source)], capture_output=True, text=True)
        if done.returncode or not out.exists():
            raise StudyError(f"osaca: {(done.stderr.strip().splitlines() or ['failed'])[-1]}")
        return parse_osaca(out.read_text(encoding="utf-8"), arch)


def osaca_arch(text: str, archs: Sequence[str]) -> str:
    """The first of `archs` whose tables have the most of the instructions: newer tables lack common ones."""
    unknown = {}
    for arch in archs:
        unknown[arch] = run_osaca(text, arch, quick=True).unknown if len(archs) > 1 else 0
        if unknown[arch] == 0:
            break
    return min(unknown, key=unknown.__getitem__)


# --- Table 3


PMU_NAMES = {
    "retiring": "retiring",
    "bad speculation": "bad_speculation",
    "front-end bound": "front_end",
    "back-end bound": "back_end",
    "memory bound": "memory",
    "core bound": "core",
}


def topdown(spec: Spec, scene: Scene, height: int, width: int | None = None) -> Row | None:
    """The split by the PMU where there is one (study.pmu): shares of the pipeline's slots; `remark` of it."""
    try:
        pmu = importlib.import_module("study.pmu")
    except ImportError:
        return None
    if not pmu.available()[0]:
        return None
    wide, high = scene.size(height, width)
    reading = pmu.read_frame(spec, scene.path, high, wide)
    if not reading.topdown:
        return None
    split = {PMU_NAMES[key]: share for key, share in reading.topdown.items() if key in PMU_NAMES}
    return {"split": split, "remark": f"PMU: {reading.remark}"}


def _modelled_regions(
    profile: Profile, built: Program, cpu: str | None, archs: Sequence[str], say: Callable[[str], None]
) -> list[Row]:
    """The regions that hold time, by llvm-mca for `cpu` (None: not) and by OSACA with one of `archs`."""
    rows, arch = [], None
    for region in regions(profile, built):
        if region.share < LEAST:
            break
        text = assembly(region.lines)
        row: Row = {
            "region": region.name,
            "function": region.function,
            "loop": region.loop,
            "share": region.share,
            "instructions": sum(line.startswith("\t") for line in text.splitlines()),
            "calls": sum(line.is_call for line in region.lines),
        }
        try:
            if cpu and row["instructions"]:
                mca = run_mca(text, cpu)
                row["mca"] = {**vars(mca), "split": mca.split}
            if archs and row["instructions"] and region.share >= LEAST_OSACA:
                arch = arch or osaca_arch(text, archs)
                row["osaca"] = vars(run_osaca(text, arch))
        except StudyError as error:
            say(f"{profile.spec} {region.name}: {error}")
        rows.append(row)
    return rows


def model(
    profile: Profile,
    built: Program,
    instructions: Mapping[str, int] | None = None,
    say: Callable[[str], None] = lambda line: None,
    processor: Processor | None = None,
    osaca: bool = True,
) -> Row:
    """The modelled split of a shipped build's samples, and its hot regions.

    `instructions`: of one frame by function of the program, counted; without them no time is predicted.
    `osaca` False leaves it out (it takes seconds a region). Missing tools are said and left out.
    """
    processor = processor or this_processor()
    for lacking in (mca_missing(), osaca_missing() if osaca else None):
        if lacking:
            say(lacking)
    cpu, remark = None, None
    if found := mca_program():
        cpu, remark = mcpu(processor, found[1])
    archs = OSACA_ARCH[processor.name] if osaca and osaca_missing() is None else []
    rows = _modelled_regions(profile, built, cpu, archs, say)
    modelled = [row for row in rows if "mca" in row]
    covered = sum(row["share"] for row in modelled)
    split = (
        {
            name: sum(row["share"] * row["mca"]["split"][name] for row in modelled) / covered
            for name in ("retiring", "memory", "core", "ports", "dependencies")
        }
        if covered
        else None
    )
    return {
        "phase": profile.phase,
        "flags_from": profile.flags_from,
        "scene": profile.scene,
        "width": profile.width,
        "height": profile.height,
        "by": "model",
        "processor": processor.name,
        "model": f"llvm-mca {found[1]} -mcpu={cpu}" if found else None,
        "remark": remark,
        "covered": covered,
        "split": split,
        "cpu_ns": profile.cpu_ns,
        "samples": profile.samples,
        **_prediction(profile, modelled, instructions),
        "regions": _measured(profile, rows, instructions),
    }


def _rate(rows: Iterable[Row], bound: str) -> float:
    """Instructions per cycle of regions together, where each has its share of the time."""
    rows = list(rows)
    share = sum(row["share"] for row in rows)
    return sum(row["share"] * row["instructions"] / row["mca"][bound] for row in rows) / share


def _prediction(profile: Profile, rows: Sequence[Row], counted: Mapping[str, int] | None) -> Row:
    """Cycles of the modelled functions by the model and as measured, and instructions per cycle. Counted
    instructions are needed for both; functions whose regions were modelled to under nine tenths are left out.
    """
    if not counted:
        return {"compared": None}
    cycles = {"throughput": 0.0, "latency": 0.0, "measured": 0.0}
    share = 0.0
    for function in dict.fromkeys(row["function"] for row in rows):
        here = [row for row in rows if row["function"] == function]
        if function not in counted or not counted[function]:
            continue
        mine = sum(row["share"] for row in here)
        for bound in ("throughput", "latency"):
            cycles[bound] += counted[function] / _rate(here, bound)
        cycles["measured"] += mine * profile.core_cycles
        share += mine
    if not share:
        return {"compared": None}
    return {"compared": {"share": share, **cycles}}


def _measured(profile: Profile, rows: Sequence[Row], counted: Mapping[str, int] | None) -> list[Row]:
    """Adds to each region the measured cycles of a pass: its function's cycles per counted instruction times
    its instructions. Right where the function's regions run at one rate; left out without counts.
    """
    made = []
    for row in rows:
        mine = sum(other["share"] for other in rows if other["function"] == row["function"])
        count = (counted or {}).get(row["function"])
        cycles = mine * profile.core_cycles / count * row["instructions"] if count else None
        made.append(row | {"measured": cycles})
    return made


def rows(record: Row) -> list[Row]:
    """Table 3 from a run's hotspots.json: ours per phase, then the paper's two."""
    made = []
    for one in record.get("bounds", []):
        compared, spec = one.get("compared") or {}, Spec(one["phase"], one["flags_from"])
        made.append(
            {
                "what": f"{spec}, {one['scene']}, {one['width']}×{one['height']}",
                "by": "PMU" if one["by"] == "pmu" else f"model: {one['model'] or 'none'}",
                "milliseconds": one["cpu_ns"] / 1e6,
                "covered": one.get("covered"),
                **{f"{name}_share": value for name, value in (one["split"] or {}).items()},
                "predicted_over_measured": compared["throughput"] / compared["measured"]
                if compared
                else None,
                "latency_over_measured": compared["latency"] / compared["measured"] if compared else None,
            }
        )
    table = paper.read("bounds")
    names = {"front-end bound": "front_end", "memory bound": "memory", "core bound": "core"}
    for stage, group in table[table["source"].str.startswith("Table 3")].groupby("stage", sort=False):
        values = group.set_index("what")["value"]
        cells = {
            f"{names.get(what, what)}_share": value / 100
            for what, value in values.items()
            if what != "runtime"
        }
        made.append(
            {"what": f"the paper: {stage}", "by": "VTune", "milliseconds": 1000 * values["runtime"], **cells}
        )
    return made


def region_rows(record: Row) -> list[Row]:
    """The hot regions of every phase, flat."""
    made = []
    for one in record.get("bounds", []):
        for row in one.get("regions", []):
            mca, osaca = row.get("mca") or {}, row.get("osaca") or {}
            flat = {f"mca_{k}": v for k, v in mca.items() if k != "split"}
            flat |= {f"split_{k}": v for k, v in mca.get("split", {}).items()}
            flat |= {f"osaca_{k}": v for k, v in osaca.items()}
            rest = {k: v for k, v in row.items() if k not in ("mca", "osaca")}
            made.append({"phase": one["phase"], "scene": one["scene"], **rest, **flat})
    return made


def _percent(name: str) -> Callable[[Row], str]:
    return lambda row: show.NOTHING if row.get(name) is None else f"{100 * row[name]:.0f}\u00a0%"


COLUMNS = [
    Column("", "what", show.word("what")),
    Column("", "by", show.word("by")),
    Column("", "ms a frame", show.plain("milliseconds", 4)),
    Column("split", "front end", _percent("front_end_share")),
    Column("split", "bad speculation", _percent("bad_speculation_share")),
    Column("split", "back end (memory and core)", _percent("back_end_share")),
    Column("split", "memory", _percent("memory_share")),
    Column("split", "core", _percent("core_share")),
    Column("split", "retiring", _percent("retiring_share")),
    Column("of core, by the model", "ports", _percent("ports_share")),
    Column("of core, by the model", "dependencies", _percent("dependencies_share")),
    Column("model", "of the frame", _percent("covered")),
    Column("model", "cycles over measured, passes overlapping", show.plain("predicted_over_measured", 2)),
    Column("model", "one after the other", show.plain("latency_over_measured", 2)),
]


ABOUT = """A model is no measurement: it takes every load as a hit in L1, every branch as foreseen and every
instruction as there in time, so that front end, bad speculation and cache misses are not in it, and its
split is of the cycles that it knows. It follows a region as a straight line through all blocks that hold
samples, without the calls, so a switch looks like one chain of its cases. “Core” is waiting for ports and
for results. “Over measured”: predicted cycles of the counted instructions over sampled cycles, when passes
overlap fully, and when each waits for the one before.
"""


def _osaca(row: Row) -> str:
    if "osaca_arch" not in row:
        return show.NOTHING
    lacking = f", {row['osaca_unknown']} instructions unknown" if row["osaca_unknown"] else ""
    return f"{row['osaca_arch']}{lacking}"


REGIONS = [
    Column("", "scene", show.word("scene")),
    Column("", "phase", show.word("phase")),
    Column("", "region", lambda r: f"{r['region']} ({'loop' if r['loop'] else 'no loop'})"),
    Column("", "of the frame", _percent("share")),
    Column("", "instructions", show.whole("instructions")),
    Column("", "calls left out", lambda r: str(r["calls"]) if r["calls"] else show.NOTHING),
    Column("cycles a pass, llvm-mca", "overlapping", show.plain("mca_throughput", 3)),
    Column("cycles a pass, llvm-mca", "alone", show.plain("mca_latency", 3)),
    Column("cycles a pass, OSACA", "busiest port", show.plain("osaca_throughput", 3)),
    Column("cycles a pass, OSACA", "critical path", show.plain("osaca_critical_path", 3)),
    Column(
        "cycles a pass, OSACA",
        "loop-carried",
        lambda r: show.number(r.get("osaca_loop_carried") if r["loop"] else None),
    ),
    Column("cycles a pass, OSACA", "tables of", _osaca),
    Column("cycles a pass", "measured", show.plain("measured", 3)),
    Column("held up by", "ports", _percent("split_ports")),
    Column("held up by", "dependencies", _percent("split_dependencies")),
    Column("held up by", "memory", _percent("split_memory")),
]
