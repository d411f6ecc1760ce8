"""Functions of a program: by the ELF file's symbols, and by the source's where they were inlined (DWARF 5,
section 3.3.8, as addr2line reads it).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from study.core.host import child
from study.counting.decode import decode
from study.counting.elf import Program

WRAPPER = 32  # bytes: a leaf of one or two instructions, such as a name for an intrinsic
# As addr2line writes it: a phase's own source, a derived phase's or an ablation's (build/NAME/source), and
# common/simd's, whose functions are compiled into the phase.
_PHASE_FILE = re.compile(r"(^|/)((?:phases|systems)/[^/]+|truth|source|common/simd)/([^/]+/)?[^/]+\.[ch]:")


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
