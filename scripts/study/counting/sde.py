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

from __future__ import annotations

import os
import re
import shutil
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from study.core import temporary
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.registry import Spec
from study.core.run import GENERAL, _arguments
from study.counting import backend, elf
from study.counting.counts import Counts, Measured
from study.counting.decode import arithmetic

TOOL = "sde64"
REGION = "phase_render"
_BITS = {"single": 32, "double": 64}
_REGISTER = {"xmm": 128, "ymm": 256, "zmm": 512}
_BEGIN = re.compile(r"#\s*EMIT_(?:DYNAMIC_STATS FOR TID\s+(\d+)\b|GLOBAL_DYNAMIC_STATS\b)")
_END = re.compile(r"#\s*END_(?:GLOBAL_)?DYNAMIC_STATS\b")
_COUNT = re.compile(r"(\*?[\w-]+)\s+(\d{1,20})")  # of 64 bits
_ELEMENTS = re.compile(r"\*elements_fp_(single|double)_(\d+)")
_MEMORY = re.compile(r"\*mem-(read|write)-(\d+)")
_ANY_WIDTH = re.compile(r"VFN?M(ADD|SUB)|VCMPP[SD]$")
_N = r"(\d{1,20})"
_MASKED = re.compile(rf"masked\s+mask\s+{_N}b\s+{_N}elem\s+{_N}b\s+fp\s+\|\s+{_N}\s+{_N}\s+[\d.]+")
_TAG = re.compile(r"<(thread-number|disassembly|computation-count|execution-counts)>\s+(.*?)\s+</\1>")


def _lines(path: Path, option: str) -> list[str]:
    """StudyError if there is no such text. Names of images and functions may be in any encoding."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror}; run {TOOL} with {option}") from None
    if "\0" in text:
        raise StudyError(f"{path}: not text; run {TOOL} with {option}")
    return text.splitlines()


@dataclass
class Section:
    """Names and counts of a thread, or of the whole program (`thread` None); `line`: where it begins."""

    thread: int | None
    line: int
    iforms: bool = False
    known: Counter[str] = field(default_factory=Counter)


def sections(path: Path) -> list[Section]:
    """Of sde-mix-out.txt. What it says of blocks, functions and images is passed over. StudyError."""
    found: list[Section] = []
    inside: Section | None = None
    for number, raw in enumerate(_lines(path, "-mix"), 1):
        line = raw.strip()
        if match := _BEGIN.match(line):
            inside = Section(int(match[1]) if match[1] else None, number)
            found.append(inside)
        elif _END.match(line):
            inside = None
        elif inside and (not line or line.startswith("#")):
            inside.iforms |= re.fullmatch(r"#\s*iform\s+count", line) is not None
        elif inside:
            if not (match := _COUNT.fullmatch(line)):
                raise StudyError(f"{path}:{number}: not a name and a count: {line[:60]!r}")
            inside.known[match[1]] += int(match[2])
    if inside:
        raise StudyError(f"{path}:{number}: cut off inside the section that begins in line {inside.line}")
    if not any(one.thread is not None for one in found):
        raise StudyError(f"{path}: no '# EMIT_DYNAMIC_STATS FOR TID' section; run {TOOL} with -mix")
    return found


def read_mix(path: Path) -> Counts:
    """Of all threads, from sde-mix-out.txt; what is masked is not in it. StudyError with file and line."""
    found = sections(path)
    known: Counter[str] = Counter()
    for one in found:
        if one.thread is not None:
            _widths_known(path, one)
            known += one.known
    totals = [one.known["*total"] for one in found if one.thread is None]
    if not totals:
        raise StudyError(f"{path}: cut off: the whole program's '# EMIT_GLOBAL_DYNAMIC_STATS' is not there")
    if known["*total"] != totals[-1]:  # an empty one may stand before it
        raise StudyError(
            f"{path}: the threads' *total add up to {known['*total']}, the whole program's is {totals[-1]}"
        )
    if not known["*total"]:
        raise StudyError(f"{path}: no instruction was counted: was {REGION} reached?")
    return _of_mix(path, known)


def _widths_known(path: Path, section: Section) -> None:
    """StudyError for opcodes without iforms, if one of them may be of any width."""
    for name, n in section.known.items():
        if n and not section.iforms and _ANY_WIDTH.match(name):
            raise StudyError(
                f"{path}:{section.line}: {n} {name} of unknown width: no table of iforms; "
                f"run {TOOL} with -iform 1"
            )


def _of_mix(path: Path, known: Counter[str]) -> Counts:
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
    thread, table, details = 0, False, False
    found: dict[str, str] = {}
    threads = 0
    for number, raw in enumerate(_lines(path, "-dyn_mask_profile"), 1):
        line = raw.strip()
        where = f"{path}:{number}"
        if line in ("<thread>", "</thread>"):
            if (thread != 0) == (line == "<thread>") or table or details:
                raise StudyError(f"{where}: {line} out of place")
            thread = number if line == "<thread>" else 0
            threads += thread != 0
        elif line in ("<summarytable>", "</summarytable>"):
            if not thread or table == (line == "<summarytable>"):
                raise StudyError(f"{where}: {line} out of place")
            table = not table
        elif line in ("<instruction-details>", "</instruction-details>"):
            if not thread or table or details == (line == "<instruction-details>"):
                raise StudyError(f"{where}: {line} out of place")
            if details:
                _add_details(counts, found, where)
            details, found = not details, {}
        elif table and line.startswith("masked") and " fp " in line:
            match = _MASKED.fullmatch(line)
            if not match:
                raise StudyError(f"{where}: not a row of the summary: {line[:60]!r}")
            bits, _, element, _, computed = map(int, match.groups())
            if element not in _BITS.values():
                raise StudyError(f"{where}: elements of {element} bits; 32 or 64 are known")
            precision = "single" if element == 32 else "double"
            counts.lanes["any", precision, bits] += computed
        elif details and (match := _TAG.fullmatch(line)):
            found[match[1]] = match[2]
    if thread or not threads:
        raise StudyError(f"{path}: {'cut off inside <thread>' if thread else 'no <thread> section'}")


def _add_details(counts: Counts, found: dict[str, str], where: str) -> None:
    opcode, _, operands = found.get("disassembly", "").partition(" ")
    kind, _, element = arithmetic(opcode.upper()) or ("", False, 0)
    if kind not in ("fma", "compare") or element not in _BITS.values():
        return
    computed = found.get("computation-count", "")
    registers = [_REGISTER[name] for name in re.findall(r"([xyz]mm)\d", operands)]
    if not re.fullmatch(_N, computed, re.ASCII) or not registers:
        name = "an FMA" if kind == "fma" else "a comparison"
        raise StudyError(f"{where}: {name} without <computation-count> or register")
    _tell_apart(counts, opcode, 0, max(registers), int(computed))


def read(mix: Path, masks: Path) -> Counts:
    """Both files of one run. StudyError with file and line; also if more FMA than operations were counted."""
    counts = read_mix(mix)
    add_masks(counts, masks)
    for (kind, precision, bits), lanes in counts.lanes.items():
        if lanes < 0:
            raise StudyError(
                f"{mix}, {masks}: more FMA than operations in {precision}, {bits} bits ({kind} {lanes}): "
                "not of one run, or another form than the documented one"
            )
    counts.lanes = +counts.lanes
    return counts


def tool() -> Path:
    """SDE_HOME/sde64, or sde64 on PATH. StudyError if there is none."""
    home = os.environ.get("SDE_HOME")
    found = Path(home) / TOOL if home else None
    if found and os.access(found, os.X_OK):
        return found
    if path := shutil.which(TOOL):
        return Path(path)
    where = f"{home}/{TOOL} or on PATH" if home else "on PATH or in SDE_HOME"
    raise StudyError(f"{TOOL} is not {where}: Intel SDE would count AVX-512 and masks", CANNOT_RUN)


def available() -> str | None:
    """None if there is an SDE, else why not, in one line."""
    try:
        tool()
    except StudyError as error:
        return str(error)
    return None


def count(arguments: list[str], region: str = REGION) -> tuple[Counts, str]:
    """Runs a program under SDE: counts of the region on all threads, and its standard output."""
    program = elf.read(arguments[0])
    program.find(region)
    ends = program.returns_of(region)
    if len(ends) != 1:
        raise StudyError(f"{program.path}: {len(ends)} calls of {region}; SDE stops at one address only")
    with temporary.folder(prefix="stepwise-sde-") as folder:
        mix, masks = folder / "sde-mix-out.txt", folder / "sde-dyn-mask-profile.txt"
        control = f"start:address:{region},stop:address:{program.path.name}+{ends[0]:#x}"
        command = [str(tool()), "-iform", "1", "-mix", "-omix", str(mix)]
        command += ["-dyn_mask_profile", "-odyn_mask_profile", str(masks), "-control", control, "--"]
        try:
            done = child.run(
                [*command, *arguments],
                capture_output=True,
                text=True,
                errors="replace",
                cwd=folder,
                env=os.environ | GENERAL,
            )
        except OSError as error:
            raise StudyError(f"{command[0]}: {error.strerror}", CANNOT_RUN) from None
        if done.returncode:
            raise backend.failed(done, program.path.name, "SDE")
        return read(mix, masks), done.stdout


def measure(
    spec: Spec | str, scene_path: Path | str, height: int, width: int | None = None, *, target: str = "render"
) -> Measured:
    """One picture. `total` holds libm and libc too, `functions` is empty; `calibrated` is None."""
    tool()
    spec = Spec.parse(spec) if isinstance(spec, str) else spec
    arguments = [*_arguments(spec, Path(scene_path).resolve(), height, width, target=target), "--json"]
    total, output = count(arguments)
    header = backend.header_of(output, arguments[0], "SDE")
    known = {"variant": backend.variant(target), "outside": None, "calibrated": None}
    return Measured("sde", total=total, functions={}, **known, **header)
