"""Functions of a program: by the ELF file's symbols, and by the source's where they were inlined (DWARF 5,
section 3.3.8, as addr2line reads it).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from elftools.common.exceptions import ELFError
from elftools.elf.elffile import ELFFile

from study.core import child
from study.core.cli import StudyError
from study.counting.decode import Disassembler

WRAPPER = 32  # bytes: a leaf of one or two instructions, such as a name for an intrinsic
# As addr2line writes it: a phase's own source, a derived phase's or an ablation's (build/NAME/source), and
# common/simd's, whose functions are compiled into the phase.
_PHASE_FILE = re.compile(r"(^|/)(phases/[^/]+|source|common/simd)/([^/]+/)?[^/]+\.[ch]:")


@dataclass(frozen=True)
class Program:
    """An ELF file's functions (start, size, name) by address, those of the phase apart, and its segments."""

    path: Path
    functions: list[tuple[int, int, str]]
    of_phase: frozenset[int]  # starts
    segments: list[tuple[int, int, int]]  # offset in the file, address, bytes

    def address(self, offset: int) -> int | None:
        """The address (of the linker) at an offset in the file."""
        return next((a + offset - o for o, a, n in self.segments if o <= offset < o + n), None)

    def function(self, address: int) -> tuple[int, int, str] | None:
        low, high = 0, len(self.functions)
        while low < high:
            middle = (low + high) // 2
            low, high = (middle + 1, high) if self.functions[middle][0] <= address else (low, middle)
        found = self.functions[low - 1] if low else None
        return found if found and address < found[0] + found[1] else None


def _symbols(path: Path) -> tuple[list[tuple[int, int, str, str]], list[tuple[int, int, int]]]:
    """(start, size, name, file it is local to) of the functions, and the segments. StudyError without any."""
    try:
        with path.open("rb") as file:
            elf = ELFFile(file)
            segments = [
                (s["p_offset"], s["p_vaddr"], s["p_filesz"])
                for s in elf.iter_segments()
                if s["p_type"] == "PT_LOAD"
            ]
            table, found, source = elf.get_section_by_name(".symtab"), [], ""
            for symbol in table.iter_symbols() if table else ():
                kind, bind = symbol["st_info"]["type"], symbol["st_info"]["bind"]
                if kind == "STT_FILE":
                    source = symbol.name
                elif kind == "STT_FUNC" and symbol["st_shndx"] != "SHN_UNDEF":
                    local = source if bind == "STB_LOCAL" else ""
                    found.append((symbol["st_value"], symbol["st_size"], symbol.name, local))
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror}") from None
    except ELFError as error:
        raise StudyError(f"{path}: no ELF file ({error})") from None
    if not found:
        raise StudyError(f"{path}: has no symbols (stripped?); remove it and build it again with make")
    return found, segments


def program(path: Path, phase_object: Path) -> Program:
    """Functions of `path`; those that are in `phase_object` too, by name and source file, are the phase's."""
    symbols, segments = _symbols(path)
    phase = {(name, local) for _, _, name, local in _symbols(phase_object)[0]}
    functions = sorted({(start, size, name) for start, size, name, _ in symbols if size})
    return Program(path, functions, frozenset(s[0] for s in symbols if (s[2], s[3]) in phase), segments)


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
    code, disassembler = built.path.read_bytes(), Disassembler()
    copies: dict[str, list[tuple[int, list[str]]]] = {}  # of each source file: bytes, and what is called
    for start, size, name in built.functions:
        offset = next((o + start - a for o, a, n in built.segments if a <= start < a + n), None)
        if start not in built.of_phase or offset is None:
            continue
        jumps = (one.target for one in disassembler.decode(code[offset : offset + size], start) if one.target)
        called = [found[2] if (found := built.function(to)) else "" for to in jumps]
        copies.setdefault(canonical(name), []).append((size, [canonical(other) for other in called]))
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
    are left out. Raises StudyError for other text.
    """
    chains: dict[int, list[str]] = {}
    chain: list[str] | None = None
    lines = iter(enumerate(text.splitlines(), 1))
    for number, line in lines:
        if line.startswith("0x"):
            try:
                chain = chains.setdefault(int(line, 16), [])
            except ValueError:
                raise StudyError(f"addr2line:{number}: no address: {line[:60]!r}") from None
            continue
        place = next(lines, None)
        if chain is None or place is None:
            raise StudyError(f"addr2line:{number}: cut off or of another form: {line[:60]!r}")
        if _PHASE_FILE.search(place[1]):
            chain.append(canonical(line))
    return chains
