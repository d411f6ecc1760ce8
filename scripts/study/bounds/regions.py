"""Regions of a program's code that samples fall into: innermost loops, and what is in none, by function."""

from __future__ import annotations

import itertools
import re
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from study.bounds.profiles import Profile
from study.core.cli import StudyError
from study.counting.symbols import Program, canonical

LEAST = 0.01  # of the frame: a region under it is left out


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
