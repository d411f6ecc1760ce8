"""Counts by Intel's Software Development Emulator (SDE), where there is one: AVX-512 and masks as well.

    FLOPs = sum of n * elements_fp_{single,double}_n + lanes * FMA + computations under masks

An FMA shows once among the elements, so its lanes are added once more; a masked instruction shows in the
mask profile alone, by computations (active lanes). After Intel, "Calculating 'FLOP' using Intel SDE"
(article 672372), and IT4Innovations' Intel-SDE-FLOPS, whose reading of the files this follows. What counts:
ADD SUB MUL DIV SQRT RCP MIN MAX FMA DPP. The region is given by address (Intel, "Pintool Regions", article
660073). libm and libc called from it are inside the totals; SDE's files do not tell them apart here.

Not yet validated: written from that documentation, never run with an SDE. Its output says so.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path

from study.core import temporary
from study.core.cli import CANNOT_RUN, StudyError
from study.core.registry import Spec
from study.core.run import GENERAL, _arguments
from study.counting import backend, elf
from study.counting.counts import Counts, Measured

TOOL = "sde64"
REGION = "phase_render"
_BITS = {"single": 32, "double": 64}
_PRECISION = {"s": "single", "d": "double"}
_REGISTER = {"xmm": 128, "ymm": 256, "zmm": 512}
_BEGIN = re.compile(r"# EMIT_DYNAMIC_STATS FOR TID\s+(\d+)\s")
_COUNT = re.compile(r"(\*?[A-Za-z][\w-]*)\s+(\d+)")
_ELEMENTS = re.compile(r"\*elements_fp_(single|double)_(\d+)")
_MEMORY = re.compile(r"\*mem-(read|write)-(\d+)")
_FMA = re.compile(r"VFN?M(?:ADDSUB|SUBADD|ADD|SUB)(?:132|213|231)([PS])([SD])_([XYZ]MM)\w*", re.IGNORECASE)
_FMA_TEXT = re.compile(r"vfn?m(?:addsub|subadd|add|sub)(?:132|213|231)([ps])([sd])\s+(.*)")
_MASKED = re.compile(r"masked\s+mask\s+(\d+)b\s+(\d+)elem\s+(\d+)b\s+fp\s+\|\s+(\d+)\s+(\d+)\s+[\d.]+")
_TAG = re.compile(r"<(thread-number|disassembly|computation-count|execution-counts)>\s+(.*?)\s+</\1>")


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError(f"{path}: {getattr(error, 'strerror', None) or 'not text'}") from None


def read_mix(path: Path) -> Counts:
    """Of all threads, from sde-mix-out.txt; what is masked is not in it. StudyError with file and line."""
    lines, number, threads = _lines(path), 0, 0
    known: Counter[str] = Counter()
    while number < len(lines):
        if not _BEGIN.match(lines[number]):
            number += 1
            continue
        threads += 1
        start, seen = number, False
        number += 1
        while number < len(lines) and not lines[number].startswith("# END_DYNAMIC_STATS"):
            line = lines[number].strip()
            seen |= re.fullmatch(r"#\s+iform\s+count", line) is not None
            if line and not line.startswith("#"):
                match = _COUNT.fullmatch(line)
                if not match:
                    raise StudyError(f"{path}:{number + 1}: not a name and a count: {line[:60]!r}")
                known[match[1]] += int(match[2])
            number += 1
        if number == len(lines):
            raise StudyError(f"{path}:{number}: cut off inside the section that begins in line {start + 1}")
        if not seen:
            raise StudyError(f"{path}:{start + 1}: no table of iforms; run {TOOL} with -iform 1")
    if not threads:
        raise StudyError(f"{path}:{len(lines)}: no '# EMIT_DYNAMIC_STATS' section; run {TOOL} with -mix")
    if not known["*total"]:
        raise StudyError(f"{path}: no instruction was counted: was {REGION} reached?")
    return _of_mix(path, known)


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
        elif (match := _FMA.fullmatch(name)) and "_MASK" not in name:  # EVEX: in the mask profile
            precision = _PRECISION[match[2].lower()]
            bits = _BITS[precision] if match[1] in "sS" else _REGISTER[match[3].lower()]
            _turn_fma(path, counts, precision, bits, bits // _BITS[precision] * n)
    return counts


def _turn_fma(path: Path, counts: Counts, precision: str, bits: int, lanes: int) -> None:
    """Lanes that were counted as any operation are those of an FMA: two FLOPs each."""
    counts.lanes["any", precision, bits] -= lanes
    counts.lanes["fma", precision, bits] += lanes


def add_masks(counts: Counts, path: Path) -> None:
    """Adds what ran under masks, and AVX-512's FMA, from sde-dyn-mask-profile.txt."""
    thread, table, details = 0, False, False
    found: dict[str, str] = {}
    threads = 0
    for number, raw in enumerate(_lines(path), 1):
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
                _add_details(counts, found, where, path)
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


def _add_details(counts: Counts, found: dict[str, str], where: str, path: Path) -> None:
    match = _FMA_TEXT.match(found.get("disassembly", ""))
    if not match:
        return
    computed = found.get("computation-count", "")
    register = re.match(r"([xyz]mm)\d+", match[3])
    if not computed.isdigit() or not register:
        raise StudyError(f"{where}: an FMA without <computation-count> or register")
    precision = _PRECISION[match[2]]
    bits = _BITS[precision] if match[1] == "s" else _REGISTER[register[1]]
    _turn_fma(path, counts, precision, bits, int(computed))


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
            done = subprocess.run(
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
