"""What an x86-64 program file says of itself: functions, by its symbols and by the source's where they were
inlined (DWARF 5, section 3.3.8, as addr2line reads it), and where one returns to.

Addresses are virtual addresses of the file (before it is moved in memory).
"""

import bisect
import contextlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from elftools.common.exceptions import ELFError
from elftools.elf.elffile import ELFFile
from elftools.elf.sections import SymbolTableSection

from study.core.cli import StudyError
from study.core.host import child

WRAPPER = 32  # bytes: a leaf of one or two instructions, such as a name for an intrinsic
# As addr2line writes it: a phase's own source, a derived phase's or an ablation's (build/NAME/source), and
# that of common/simd and common/packet, whose functions are compiled into the phase.
_PHASE_FILE = re.compile(
    r"(^|/)((?:phases|systems)/[^/]+|truth|source|common/simd|common/packet)/([^/]+/)?[^/]+\.[ch]:"
)
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
    exported: bool = False

    @property
    def source_name(self) -> str:
        return source_name(self.name)


@dataclass(frozen=True)
class Segment:
    """A part of the file that is loaded: `offset` in the file, `address`, `size` in bytes of the file."""

    offset: int
    address: int
    size: int
    data: bytes = b""


@dataclass(frozen=True)
class Program:
    """An executable: its functions by address, segments, where the functions of the phase begin, if that was
    asked for, and where the program itself does."""

    path: Path
    functions: list[Function]
    segments: list[Segment]
    of_phase: frozenset[int] = frozenset()
    entry: int = 0

    @cached_property
    def _starts(self) -> list[int]:
        return [function.start for function in self.functions]

    def address(self, offset: int) -> int | None:
        """The address (of the linker) at an offset in the file."""
        inside = (s for s in self.segments if s.offset <= offset < s.offset + s.size)
        return next((s.address + offset - s.offset for s in inside), None)

    def function_at(self, address: int) -> Function | None:
        place = bisect.bisect_right(self._starts, address) - 1
        found = self.functions[place] if place >= 0 else None
        return found if found and address < found.start + found.size else None

    def find(self, name: str) -> Function:
        found = next((function for function in self.functions if function.name == name), None)
        if found is None:
            raise StudyError(f"{self.path}: has no function {name}")
        return found

    def code_of(self, function: Function) -> bytes:
        for s in self.segments:
            if s.address <= function.start < s.address + len(s.data):
                return s.data[function.start - s.address :][: function.size]
        return b""

    def returns_of(self, name: str) -> list[int]:
        """Addresses behind the direct calls of a function: where it returns to."""
        from iced_x86 import Decoder, FlowControl  # has no wheel for arm64

        entry = self.find(name).start
        return sorted(
            one.next_ip
            for function in self.functions
            for one in Decoder(64, self.code_of(function), ip=function.start)
            if one.flow_control == FlowControl.CALL and one.near_branch_target == entry
        )


@contextlib.contextmanager
def _opened(path: Path | str) -> Iterator[ELFFile]:
    """StudyError for a file that is none of x86-64."""
    try:
        with Path(path).open("rb") as file:
            elf = ELFFile(file)
            if elf.get_machine_arch() != "x64":
                raise StudyError(f"{path}: is for {elf.get_machine_arch()}; x86-64 is required")
            yield elf
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror}") from None
    except ELFError:
        raise StudyError(f"{path}: not a whole ELF file; an x86-64 Linux program is required") from None


def read(path: Path | str, phase_object: Path | str | None = None) -> Program:
    """A program with symbols. Functions that are in `phase_object` too, by name and source file, are the
    phase's. Raises StudyError for a foreign file or a stripped one."""
    with _opened(path) as elf:
        segments = [
            Segment(s.header.p_offset, s.header.p_vaddr, s.header.p_filesz, s.data())
            for s in elf.iter_segments("PT_LOAD")
        ]
        symbols, entry = list(_functions(elf)), elf.header.e_entry
    if not symbols:
        raise StudyError(f"{path}: has no symbols; link it without -s and do not strip it")
    # By address; of several names for one place the exported one.
    at = {one.start: one for one in sorted(symbols, key=lambda one: one.exported)}
    made = Program(Path(path), [at[start] for start in sorted(at)], segments, entry=entry)
    if phase_object is None:
        return made
    with _opened(phase_object) as elf:
        phase = {(one.name, one.file) for one in _functions(elf)}
    return replace(made, of_phase=frozenset(s.start for s in symbols if (s.name, s.file) in phase))


def _functions(elf: ELFFile) -> Iterator[Function]:
    table, source = elf.get_section_by_name(".symtab"), ""
    for s in table.iter_symbols() if isinstance(table, SymbolTableSection) else ():
        about, kind, bind = s.entry, s.entry.st_info.type, s.entry.st_info.bind
        if kind == "STT_FILE":
            source = s.name
        elif kind in _CODE and about.st_shndx != "SHN_UNDEF" and about.st_size:
            file = source if bind == "STB_LOCAL" else ""
            yield Function(s.name, about.st_value, about.st_size, file, bind == "STB_GLOBAL")


def canonical(name: str, library: bool = False) -> str:
    """A symbol as the source has it: without versions, clones and, in libm, the choice of instruction set."""
    name = re.sub(r"@.*|\.(constprop|isra|part|cold|lto_priv|localalias)(\.\d+)*", "", name)
    if library:
        name = re.sub(r"_(fma4?|avx2?|avx512\w*|sse2|sse41|sse4_1|c)$", "", name)
        name = re.sub(r"^_+(ieee754_)?", "", name)
    return name


def wrappers(built: Program) -> set[str]:
    """Functions that are only a name for an instruction or two, where each is a function: they call nothing,
    or one such function. Inlined ones count to whoever uses them: a line of a table for them would say as
    much as one for `+`.
    """
    from study.counting.decode import decode  # its decoder has no wheel for arm64

    copies: dict[str, list[tuple[int, list[str]]]] = {}  # of each source file: bytes, and what is called
    for one in built.functions:
        if one.start not in built.of_phase:
            continue
        jumps = (jump.target for jump in decode(built.code_of(one), one.start) if jump.target)
        called = [built.function_at(target) for target in jumps]
        names = [canonical(other.name) if other else "" for other in called]
        copies.setdefault(canonical(one.name), []).append((one.size, names))
    leaves = {
        name for name, some in copies.items() if all(size <= WRAPPER and not calls for size, calls in some)
    }
    around = {
        name
        for name, some in copies.items()
        if all(size <= 2 * WRAPPER and len(calls) == 1 and calls[0] in leaves for size, calls in some)
    }
    return {name for name in leaves | around if not name.startswith("phase_")}


def inlined(binary: Path, addresses: Sequence[int]) -> dict[int, list[str]]:
    """Per address the phase's functions whose code it is, innermost first; none where addr2line fails."""
    chains: dict[int, list[str]] = {}
    if not addresses:
        return chains
    text = "\n".join(f"{address:#x}" for address in addresses)
    try:
        command = ["addr2line", "-a", "-f", "-i", "-e", str(binary)]
        done = child.run(command, input=text, capture_output=True, text=True)
    except OSError:
        return chains
    return parse_addr2line(done.stdout) if done.returncode == 0 else chains


def parse_addr2line(text: str) -> dict[int, list[str]]:
    """Output of `addr2line -a -f -i`: an address, then pairs of function and place. Headers of the compiler
    are left out.
    """
    chains: dict[int, list[str]] = {}
    lines = iter(text.splitlines())
    for line in lines:
        if line.startswith("0x"):
            chain = chains.setdefault(int(line, 16), [])
        elif _PHASE_FILE.search(next(lines)):
            chain.append(canonical(line))
    return chains
