"""What an x86-64 program file says of itself: functions, stubs of imported ones, callers of a function.

Addresses are virtual addresses of the file (before it is moved in memory).
"""

from __future__ import annotations

import bisect
import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from elftools.common.exceptions import ELFError
from elftools.elf.elffile import ELFFile
from elftools.elf.relocation import RelocationSection
from elftools.elf.sections import SymbolTableSection
from iced_x86 import Decoder, FlowControl, OpKind

from study.core.cli import StudyError

_EXECUTABLE = 1  # p_flags and, shifted, sh_flags: System V ABI, Program Loading
# What pyelftools raises of a broken file.
_BROKEN = (ELFError, ValueError, LookupError, AttributeError, TypeError, ArithmeticError, MemoryError)
_CODE = ("STT_FUNC", "STT_LOOS", "STT_GNU_IFUNC")  # pyelftools knows GNU's indirect functions by number only


def source_name(symbol: str) -> str:
    """The name in the source, without gcc's .part.0, .constprop.0, .isra.0 and .cold."""
    return symbol.split(".")[0] or symbol


def is_part(symbol: str) -> bool:
    """Split off by the compiler: entering it is no call in the source."""
    return ".part" in symbol or ".cold" in symbol


@dataclass(frozen=True)
class Function:
    """`name` is the symbol's: gcc's clones and split-off parts have a suffix behind a dot. `file`: the source
    that a local symbol is of."""

    name: str
    start: int
    size: int
    file: str = ""

    @property
    def source_name(self) -> str:
        return source_name(self.name)

    @property
    def is_part(self) -> bool:
        return is_part(self.name)


@dataclass(frozen=True)
class Segment:
    """A part of the file that is loaded: `offset` in the file, `address`, `size` in bytes of the file."""

    offset: int
    address: int
    size: int
    data: bytes = b""
    executable: bool = True


@dataclass(frozen=True)
class Program:
    """An executable: its functions by address, segments, stubs (address → name of what is imported), where
    the functions of the phase begin, if that was asked for, and where the program itself does."""

    path: Path
    functions: list[Function]
    segments: list[Segment]
    imports: dict[int, str] = field(default_factory=dict)
    of_phase: frozenset[int] = frozenset()
    entry: int = 0

    @cached_property
    def _starts(self) -> list[int]:
        return [function.start for function in self.functions]

    @property
    def code(self) -> Segment:
        """QEMU's start_code is the lowest executable segment; its bytes begin at this offset of the file."""
        return min((s for s in self.segments if s.executable), key=lambda s: s.address)

    def address(self, offset: int) -> int | None:
        """The address (of the linker) at an offset in the file."""
        inside = (s for s in self.segments if s.offset <= offset < s.offset + s.size)
        return next((s.address + offset - s.offset for s in inside), None)

    def function_at(self, address: int) -> Function | None:
        """The function whose code has this address."""
        place = bisect.bisect_right(self._starts, address) - 1
        found = self.functions[place] if place >= 0 else None
        return found if found and address < found.start + found.size else None

    def find(self, name: str) -> Function:
        """By symbol. StudyError if there is none."""
        for function in self.functions:
            if function.name == name:
                return function
        raise StudyError(f"{self.path}: has no function {name}")

    def code_of(self, function: Function) -> bytes:
        for s in self.segments:
            if s.address <= function.start < s.address + len(s.data):
                return s.data[function.start - s.address :][: function.size]
        return b""

    def returns_of(self, name: str) -> list[int]:
        """Addresses behind the direct calls of a function: where it returns to."""
        entry, found = self.find(name).start, set()
        for function in self.functions:
            for instruction in Decoder(64, self.code_of(function), ip=function.start):
                if instruction.flow_control == FlowControl.CALL and instruction.near_branch_target == entry:
                    found.add(instruction.next_ip)
        if not found:
            raise StudyError(f"{self.path}: no direct call of {name}, so its end cannot be seen")
        return sorted(found)

    def conditional_entries(self) -> list[tuple[int, int, int]]:
        """Conditional jumps to a function's entry or a stub: addresses of jump, target and what is behind."""
        entries = {f.start for f in self.functions} | self.imports.keys()
        return [
            (one.ip, one.near_branch_target, one.next_ip)
            for function in self.functions
            for one in Decoder(64, self.code_of(function), ip=function.start)
            if one.flow_control == FlowControl.CONDITIONAL_BRANCH and one.near_branch_target in entries
        ]


@contextlib.contextmanager
def _opened(path: Path | str) -> Iterator[ELFFile]:
    """StudyError for a file that is none of x86-64, or that its reader stumbles over."""
    try:
        with Path(path).open("rb") as file:
            elf = ELFFile(file)
            if elf.get_machine_arch() != "x64":
                raise StudyError(f"{path}: is for {elf.get_machine_arch()}; x86-64 is required")
            yield elf
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror}") from None
    except _BROKEN:
        raise StudyError(f"{path}: not a whole ELF file; an x86-64 Linux program is required") from None


def read(path: Path | str, phase_object: Path | str | None = None) -> Program:
    """A program with symbols. Functions that are in `phase_object` too, by name and source file, are the
    phase's. Raises StudyError for a foreign file or a stripped one."""
    with _opened(path) as elf:
        segments = [
            Segment(s["p_offset"], s["p_vaddr"], s["p_filesz"], s.data(), bool(s["p_flags"] & _EXECUTABLE))
            for s in elf.iter_segments("PT_LOAD")
        ]
        symbols = [function for function, _ in _symbols(elf, ".symtab")]
        made = Program(Path(path), _functions(elf), segments, _stubs(elf), entry=elf["e_entry"])
    if not made.functions:
        raise StudyError(f"{path}: has no symbols; link it without -s and do not strip it")
    if phase_object is None:
        return made
    with _opened(phase_object) as elf:
        phase = {(function.name, function.file) for function, _ in _symbols(elf, ".symtab")}
    of_phase = frozenset(one.start for one in symbols if (one.name, one.file) in phase)
    return replace(made, of_phase=of_phase)


def _symbols(elf: ELFFile, section: str) -> list[tuple[Function, bool]]:
    """Functions defined in the file, and whether they are exported to all."""
    table = elf.get_section_by_name(section)
    found: list[tuple[Function, bool]] = []
    source = ""
    for s in table.iter_symbols() if isinstance(table, SymbolTableSection) else ():
        kind, bind = s["st_info"]["type"], s["st_info"]["bind"]
        if kind == "STT_FILE":
            source = s.name
        elif kind in _CODE and s["st_shndx"] != "SHN_UNDEF" and s["st_size"]:
            file = source if bind == "STB_LOCAL" else ""
            found.append((Function(s.name, s["st_value"], s["st_size"], file), bind == "STB_GLOBAL"))
    return found


def _functions(elf: ELFFile) -> list[Function]:
    """By address; of several names for one place the exported one."""
    found: dict[int, Function] = {}
    for function, is_global in _symbols(elf, ".symtab"):
        if function.start not in found or is_global:
            found[function.start] = function
    return [found[start] for start in sorted(found)]


def exported(path: Path | str) -> set[str]:
    """Names of the functions that a library offers; empty if it cannot be read."""
    try:
        with Path(path).open("rb") as file:
            return {function.name for function, _ in _symbols(ELFFile(file), ".dynsym")}
    except (OSError, *_BROKEN):
        return set()


def _stubs(elf: ELFFile) -> dict[int, str]:
    """Address of each stub of the procedure linkage table to the name of what it jumps to."""
    slots: dict[int, str] = {}
    for section in elf.iter_sections():
        if isinstance(section, RelocationSection) and section["sh_link"]:
            symbols = elf.get_section(section["sh_link"])
            if isinstance(symbols, SymbolTableSection):
                for relocation in section.iter_relocations():
                    name = symbols.get_symbol(relocation["r_info_sym"]).name
                    if name:
                        slots[relocation["r_offset"]] = name
    found = {}
    for name in (".plt", ".plt.sec", ".plt.got"):
        section = elf.get_section_by_name(name)
        if section is None:
            continue
        step = section["sh_entsize"] or 16
        for instruction in Decoder(64, section.data(), ip=section["sh_addr"]):
            indirect = instruction.flow_control == FlowControl.INDIRECT_BRANCH
            if indirect and instruction.op0_kind == OpKind.MEMORY and instruction.is_ip_rel_memory_operand:
                slot = slots.get(instruction.ip_rel_memory_address)
                if slot:
                    offset = instruction.ip - section["sh_addr"]
                    found[section["sh_addr"] + offset // step * step] = slot
    return found
