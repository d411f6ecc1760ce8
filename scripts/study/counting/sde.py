"""Counts by Intel's Software Development Emulator (SDE), where there is one: AVX-512 and masks as well.

    FLOPs = sum of n * elements_fp_{single,double}_n + lanes * FMA + computations under masks

An FMA shows once among the elements, so its lanes are added once more; a comparison shows there as well and
is no FLOP. Both are told by their iforms. A masked instruction shows in the mask profile alone, by
computations (active lanes); x87 is not among the elements. After Intel, "Calculating 'FLOP' using Intel SDE"
(article 672372), and IT4Innovations' Intel-SDE-FLOPS. The region is given by address (Intel, "Pintool
Regions", article 660073). libm and libc called from it are inside the totals.

The reader of -mix was held against a public file of SDE 9.24; the mask profile is read as documented. The
back end was never run with an SDE here: its output says "not yet validated".
"""

import os
import re
import shutil
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from study.core import temporary
from study.core.cli import CANNOT_RUN, StudyError
from study.core.registry import Scene, Spec
from study.counting import backend, elf
from study.counting.backend import REGION
from study.counting.counts import Counts
from study.counting.decode import arithmetic
from study.counting.schema import Measurement

TOOL = "sde64"
_BITS = {"single": 32, "double": 64}
_REGISTER = {"xmm": 128, "ymm": 256, "zmm": 512}
_SECTION = re.compile(
    r"^#\s*EMIT_(?:DYNAMIC_STATS FOR TID\s+(\d+)\b|GLOBAL_DYNAMIC_STATS\b)(.*?)"
    r"(^#\s*END_(?:GLOBAL_)?DYNAMIC_STATS\b|\Z)",
    re.DOTALL | re.MULTILINE,
)
_IFORMS = re.compile(r"^#\s*iform\s+count\s*$", re.MULTILINE)
_COUNT = re.compile(r"^\s*(\*?[\w-]+)[ \t]+(\d+)\s*$", re.MULTILINE)
_ELEMENTS = re.compile(r"\*elements_fp_(single|double)_(\d+)")
_MEMORY = re.compile(r"\*mem-(read|write)-(\d+)")
_ANY_WIDTH = re.compile(r"VFN?M(ADD|SUB)|VCMPP[SD]$")
_MASKED = re.compile(r"\bmasked\s+mask\s+(\d+)b\s+\d+elem\s+(32|64)b\s+fp\s+\|\s+\d+\s+(\d+)\s+[\d.]+")
_DETAILS = re.compile(r"<instruction-details>(.*?)</instruction-details>", re.DOTALL)
_TAG = re.compile(r"<(disassembly|computation-count)>\s+(.*?)\s+</\1>")


@dataclass
class Section:
    """Names and counts of a thread, or of the whole program (`thread` None). `whole`: its end was there."""

    thread: int | None
    iforms: bool = False
    whole: bool = False
    known: Counter[str] = field(default_factory=Counter)

    @property
    def total(self) -> int:
        return self.known["*total"]


def _text(path: Path) -> str:
    """StudyError if there is none. Names of images and functions may be in any encoding."""
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror}") from None


def sections(path: Path) -> list[Section]:
    """Those of sde-mix-out.txt. What it says of blocks, functions and images is passed over."""
    found = []
    for match in _SECTION.finditer(_text(path)):
        made = Section(int(match[1]) if match[1] else None, bool(_IFORMS.search(match[2])), bool(match[3]))
        for name, n in _COUNT.findall(match[2]):
            made.known[name] += int(n)
        found.append(made)
    return found


def read_mix(path: Path) -> Counts:
    """Counts of all threads, of sde-mix-out.txt; what is masked is not in it. StudyError for another form."""
    found = sections(path)
    known: Counter[str] = Counter()
    for one in found:
        if one.thread is None:
            continue
        unknown = [name for name in one.known if _ANY_WIDTH.match(name) and not one.iforms]
        if unknown:
            raise StudyError(f"{path}: {unknown[0]} of unknown width; run {TOOL} with -iform 1")
        known += one.known
    totals = [one.total for one in found if one.thread is None and one.whole]
    # An empty one may stand before that of the whole program.
    if not totals or not known["*total"] or known["*total"] != totals[-1]:
        whole = totals[-1] if totals else "not there"
        raise StudyError(
            f"{path}: the threads' *total add up to {known['*total']}, the whole program's is {whole}: "
            f"cut off, not of {TOOL} -mix, or {REGION} was not reached"
        )
    counts = Counts(instructions=known["*total"])
    for name, n in known.items():
        if match := _ELEMENTS.fullmatch(name):
            counts.lanes["any", match[1], int(match[2]) * _BITS[match[1]]] += int(match[2]) * n
        elif match := _MEMORY.fullmatch(name):
            if match[1] == "read":
                counts.load += int(match[2]) * n
            else:
                counts.store += int(match[2]) * n
        elif "_MASK" not in name and name != "CMPSD":  # EVEX: in the mask profile; the string instruction
            opcode, _, operands = name.partition("_")
            register = re.search("[XYZ]MM", operands)  # none: an opcode of SSE, or all in memory
            _tell_apart(counts, opcode, n, _REGISTER[register[0].lower()] if register else 128)
    return counts


def _tell_apart(counts: Counts, opcode: str, times: int, register: int, computed: int | None = None) -> None:
    """Takes FMA and comparisons out of what was counted as any operation, and adds x87, which is not in it.

    `register`: bits of the widest operand; `computed`: active lanes, where they are known.
    """
    kind, packed, element = arithmetic(opcode.upper()) or ("", False, 0)
    if element == 80:
        counts.lanes[kind, "extended", 80] += times
    elif kind in ("fma", "compare") and element in _BITS.values():
        bits = register if packed else element
        lanes = bits // element * times if computed is None else computed
        precision = "single" if element == 32 else "double"
        counts.lanes["any", precision, bits] -= lanes
        counts.lanes[kind, precision, bits] += lanes


def add_masks(counts: Counts, path: Path) -> None:
    """Adds what ran under masks, and AVX-512's FMA, from sde-dyn-mask-profile.txt."""
    text = _text(path)
    if not text.count("<thread>") == text.count("</thread>") > 0:
        raise StudyError(f"{path}: no whole <thread> section; run {TOOL} with -dyn_mask_profile")
    for bits, element, computed in _MASKED.findall(text):
        counts.lanes["any", "single" if element == "32" else "double", int(bits)] += int(computed)
    for details in _DETAILS.findall(text):
        tags = dict(_TAG.findall(details))
        opcode, _, operands = tags.get("disassembly", "").partition(" ")
        registers = [_REGISTER[name] for name in re.findall(r"([xyz]mm)\d", operands)]
        if registers and (arithmetic(opcode.upper()) or ("",))[0] in ("fma", "compare"):
            _tell_apart(counts, opcode, 0, max(registers), int(tags["computation-count"]))


def read(mix: Path, masks: Path) -> Counts:
    """Both files of one run. StudyError with the file, also if more FMA than operations were counted."""
    counts = read_mix(mix)
    add_masks(counts, masks)
    if less := {kind: lanes for kind, lanes in counts.lanes.items() if lanes < 0}:
        raise StudyError(f"{mix}, {masks}: more FMA than operations ({less}): not of one run")
    counts.lanes = +counts.lanes
    return counts


def tool() -> str | None:
    """SDE_HOME/sde64, or sde64 on PATH."""
    home = os.environ.get("SDE_HOME")
    return shutil.which(TOOL, path=home) or shutil.which(TOOL) if home else shutil.which(TOOL)


def missing() -> str | None:
    return (
        None if tool() else f"{TOOL} is not on PATH or in SDE_HOME: Intel SDE would count AVX-512 and masks"
    )


def measure(spec: Spec, scene: Scene, height: int, variant: str = "shipped") -> Measurement:
    """One picture. `total` holds libm and libc too, `functions` is empty; `calibrated` is None."""
    if lacking := missing():
        raise StudyError(lacking, CANNOT_RUN)
    arguments = backend.command(spec, scene, height, variant)
    program = elf.read(arguments[0])
    ends = program.returns_of(REGION)
    if len(ends) != 1:
        raise StudyError(f"{program.path}: {len(ends)} calls of {REGION}; SDE stops at one address only")
    with temporary.folder(prefix="stepwise-sde-") as folder:
        mix, masks = folder / "sde-mix-out.txt", folder / "sde-dyn-mask-profile.txt"
        control = f"start:address:{REGION},stop:address:{program.path.name}+{ends[0]:#x}"
        command = [str(tool()), "-iform", "1", "-mix", "-omix", str(mix)]
        command += ["-dyn_mask_profile", "-odyn_mask_profile", str(masks), "-control", control, "--"]
        done = backend.run([*command, *arguments], program.path.name, "SDE", cwd=folder)
        return backend.measurement("sde", variant, done.stdout, read(mix, masks))
