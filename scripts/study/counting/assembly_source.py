"""Compiler output (gcc or clang -S, AT&T syntax) as basic blocks, and that text with symbols or counters.

Counters are statements that change no register, no flag and no byte of the stack, the red zone below rsp
included: rax is kept in a thread-local slot, and the sum made by lea, which writes no flag. Where the block
itself overwrites every flag before it reads one, a single inc does the same. (Intel SDM vol. 1, appendix A:
which instructions write flags; System V ABI for AMD64, 3.2.2: the red zone; Drepper, ELF Handling For
Thread-Local Storage: tpoff.)
"""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, field
from pathlib import Path

from elftools.elf.constants import SH_FLAGS
from elftools.elf.elffile import ELFFile
from elftools.elf.sections import SymbolTableSection
from iced_x86 import Decoder, RflagsBits

from study.core.cli import StudyError
from study.counting.decode import MNEMONICS, Decoded, decode

MARKER = "stepwise_block_"
_PREFIXES = re.compile(r"lock|repn?[ez]?|notrack|bnd|data(16|32)|addr32|rex64|rex\.\w+|[c-g]s|ss|\{\w+\}")
_AFTER_PREFIX = re.compile(r"\b(repn?[ez]?|lock)\s*;")
_UNCONDITIONAL = re.compile(r"jmpq?|l?retq?|ud2|hlt|iretq?|ljmp")
_ENDS = re.compile(r"j\w+|loop\w*|l?callq?|l?retq?|ljmp|xbegin|syscall|sysenter|int\d?|ud2|hlt|iretq?")
_ALIGN = (".p2align", ".align", ".balign", ".nops")
_REFERRING = (".long", ".quad", ".4byte", ".8byte", ".int", ".value", ".short", ".2byte", ".word")
_BYTES = (*_REFERRING, ".byte", ".ascii", ".string", ".zero", ".skip")
_LABEL = re.compile(r'\s*("[^"]*"|[\w.$@]+)\s*:(?!:)')
_NAME = re.compile(r"[\w.$]+")


@dataclass
class Statement:
    """One label, directive, instruction or comment. `words`: mnemonic and operands without prefixes."""

    text: str
    line: int
    kind: str
    name: str = ""
    rest: str = ""


@dataclass
class Block:
    """Straight-line code, entered at its start alone. `at`: the statement its counter stands before.

    `lines`: statements of its instructions; none for a block that counts a passage only.
    `callee`: of the direct call at its end, or of the jump that stands for one; `conditional`: the jump is
    taken as often as this block runs and the block of the next number does not.
    """

    function: str
    section: str
    at: int
    entry: bool = False
    lines: list[int] = field(default_factory=list)
    callee: str | None = None
    conditional: bool = False
    offset: int = 0
    code: bytes = b""
    decoded: list[Decoded] = field(default_factory=list)


@dataclass
class _Place:
    """Where the reader is in a section.

    `waiting`: why the next instruction begins a block: "entry" of a function; "behind" a branch or label
    that control passes; "passed", by a conditional jump out of the function; "target" of jumps only; "dead",
    behind an unconditional jump. Empty if it does not.
    """

    function: str = ""
    waiting: str = "dead"
    block: Block | None = None


def statements(text: str) -> list[Statement]:
    """The file's statements in order. clang writes rep;movsq: one instruction, nothing between."""
    found: list[Statement] = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("#"):  # #APP and #NO_APP say something to the assembler
            found.append(Statement(line, number, "comment"))
            continue
        while match := _LABEL.match(line):
            found.append(Statement(match[0], number, "label", match[1].strip('"')))
            line = line[match.end() :]
        if '"' not in line:
            line = line.partition("#")[0]
        several = [line] if line.lstrip().startswith(".") else _AFTER_PREFIX.sub(r"\1 ", line).split(";")
        for part in several:
            if part.strip():
                name, rest = [*part.split(None, 1), ""][:2]
                kind = "directive" if name.startswith(".") else "instruction"
                found.append(Statement(part, number, kind, name, rest.strip()))
    return found


def _without_prefixes(one: Statement) -> tuple[str, str]:
    """Mnemonic and operands; an empty mnemonic for a prefix that stands alone."""
    name, rest = one.name.lower(), one.rest
    while _PREFIXES.fullmatch(name):
        name, rest = [*rest.split(None, 1), "", ""][:2]
        name = name.lower()
    return name, rest


class Source:
    """One assembly file: its statements and its basic blocks, ids from `first` on."""

    def __init__(self, path: Path, first: int) -> None:
        self.path, self.first = path, first
        try:
            self.statements = statements(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError) as error:
            raise StudyError(f"{path}: {getattr(error, 'strerror', None) or 'not text'}") from None
        self.blocks: list[Block] = []
        self.aliases: dict[str, str] = {}
        self._scan()
        self._read()
        for block, behind in zip(self.blocks, [*self.blocks[1:], None], strict=False):
            if block.conditional and (behind is None or behind.section != block.section):
                raise self._refuse(self.statements[block.at], "a conditional jump at a section's end")

    def _refuse(self, one: Statement, why: str) -> StudyError:
        return StudyError(f"{self.path}:{one.line}: {why}: {one.text.strip()!r} cannot be counted")

    def _scan(self) -> None:
        """Functions, and labels that something refers to: the others begin no block."""
        self._functions, referred = set(), set()
        self._labels = {one.name for one in self.statements if one.kind == "label"}
        for one in self.statements:
            if one.name == ".type" and re.search("[@%]function$", one.rest):
                self._functions.add(one.rest.split(",")[0].strip().strip('"'))
            elif one.name == ".set":
                name, _, value = (word.strip() for word in one.rest.partition(","))
                self.aliases[name] = value
            if one.kind == "instruction" or one.name in (*_REFERRING, ".set"):
                referred.update(_NAME.findall(one.rest))
        self._referred = referred

    def _read(self) -> None:
        places: dict[str, _Place] = {}
        section, executable = ".text", {".text"}
        for i, one in enumerate(self.statements):
            if one.name in (".text", ".data", ".bss"):
                section = one.name
            elif one.name == ".section":
                words = [word.strip().strip('"') for word in one.rest.split(",")]
                section = words[0]
                if section.startswith(".text") or (len(words) > 1 and "x" in words[1]):
                    executable.add(section)
            elif one.name in (".pushsection", ".popsection", ".previous", ".subsection"):
                raise self._refuse(one, "a section of inline assembly")
            elif section in executable and one.kind != "comment":
                self._statement(i, one, section, places.setdefault(section, _Place()))

    def _begin(self, i: int, section: str, place: _Place) -> Block:
        block = Block(place.function, section, i, entry=place.waiting == "entry")
        self.blocks.append(block)
        place.block, place.waiting = block, ""
        return block

    def _statement(self, i: int, one: Statement, section: str, place: _Place) -> None:
        if one.kind == "directive":
            if one.name in _BYTES and place.waiting not in ("dead", "target"):
                raise self._refuse(one, "bytes written by hand")
            # Padding is executed where control falls into it: it gets a block of its own.
            if one.name in _ALIGN and place.waiting in ("entry", "passed", "behind"):
                self._begin(i, section, place)
                place.waiting = "behind"
        elif one.kind == "label":
            if place.waiting in ("entry", "passed") and self._is_target(one.name):
                self._begin(i, section, place)  # a jump to this label is no entry
            if one.name in self._functions:
                place.function, place.waiting = one.name, "entry"
            elif self._is_target(one.name):
                place.waiting = "target" if place.waiting in ("dead", "target") else "behind"
        else:
            self._instruction(i, one, section, place)

    def _is_target(self, label: str) -> bool:
        return not label.startswith(".L") or label in self._referred

    def _instruction(self, i: int, one: Statement, section: str, place: _Place) -> None:
        if not place.function:
            raise self._refuse(
                one, "code outside any function (`.type NAME, @function` and a label make one)"
            )
        block = place.block if place.block is not None and not place.waiting else None
        if block is None:
            block = self._begin(i, section, place)
        name, operands = _without_prefixes(one)
        if not name:
            raise self._refuse(one, "a prefix without an instruction")
        block.lines.append(i)
        if not _ENDS.fullmatch(name):
            return
        if re.match(r"\.(\s*[-+]|\s*$)", operands):
            raise self._refuse(one, "a jump by distance, not to a label")
        target = operands.split("@")[0].strip().strip('"')
        is_call = "call" in name
        place.waiting = "dead" if _UNCONDITIONAL.fullmatch(name) else "behind"
        # A jump to a function, here or elsewhere, is a call of it as the last thing done.
        named = _NAME.fullmatch(target) and not target.startswith(".L") and not target[0].isdigit()
        if named and (is_call or target in self._functions or target not in self._labels):
            block.callee = target
            if not is_call and not _UNCONDITIONAL.fullmatch(name):
                block.conditional, place.waiting = True, "passed"

    def marked(self) -> str:
        before: dict[int, list[str]] = {}
        for number, block in enumerate(self.blocks, self.first):
            before.setdefault(block.at, []).append(f"{MARKER}{number}:")
        return self._text(before, {})

    def _text(self, before: dict[int, list[str]], behind: dict[int, list[str]]) -> str:
        out = []
        for i, one in enumerate(self.statements):
            out += before.get(i, [])
            out.append(one.text)
            out += behind.get(i, [])
        return "\n".join(out) + "\n"

    def locate(self, obj: Path) -> None:
        """Each block's bytes out of the assembled text, decoded and held against its statements."""
        places: dict[int, list[tuple[int, int]]] = {}
        with obj.open("rb") as file:
            sections = list(ELFFile(file).iter_sections())
            code = {i: s.data() for i, s in enumerate(sections) if s.header.sh_flags & SH_FLAGS.SHF_EXECINSTR}
            for table in (s for s in sections if isinstance(s, SymbolTableSection)):
                for symbol in (s for s in table.iter_symbols() if s.name.startswith(MARKER)):
                    n = int(symbol.name.removeprefix(MARKER)) - self.first
                    places.setdefault(symbol.entry.st_shndx, []).append((symbol.entry.st_value, n))
        for index, starts in places.items():
            starts.sort()
            ends = [start for start, _ in starts[1:]] + [len(code[index])]
            for (start, n), end in zip(starts, ends, strict=True):
                self._decode(self.blocks[n], start, code[index][start:end])

    def _decode(self, block: Block, start: int, code: bytes) -> None:
        decoded = decode(code, start)
        ends = [i for i, one in enumerate(decoded, 1) if not one.known or one.ends_block]
        decoded, expected = decoded[: ends[0]] if ends else decoded, len(block.lines)
        extra = decoded[expected:]
        padding = all(one.known and one.mnemonic == "nop" for one in extra)
        if len(decoded) < expected or not padding or any(not one.known for one in decoded):
            line = self.statements[block.at].line
            raise StudyError(
                f"{self.path}:{line}: {len(decoded)} instructions decoded where the assembly has {expected}: "
                "bytes written by hand, or a jump that is none in the text, cannot be counted"
            )
        block.offset, block.decoded = start, decoded
        block.code = code[: sum(one.length for one in decoded)]

    def counted(self, counters: Counters) -> str:
        """The text with counters; `counters` says which are whose."""
        before: dict[int, list[str]] = {}
        behind: dict[int, list[str]] = {}
        for number, block in enumerate(self.blocks, self.first):
            step = count(number, bool(block.lines) and overwrites_flags(block.code, block.offset))
            if block.lines and block.decoded[0].mnemonic == "endbr64":
                behind.setdefault(block.lines[0], []).extend(step)  # must be the first instruction
            else:
                before.setdefault(block.at, []).extend(step)
            for place, one in enumerate(block.decoded[: len(block.lines)]):
                i = block.lines[place]
                if one.mask is not None and one.kind:
                    slot = counters.masked[number, place]
                    before.setdefault(i, []).extend(count_lanes(slot, one.mask, one.lanes))
                if one.repeat:
                    slot = counters.repeated[number, place]
                    before.setdefault(i, []).extend(count_rcx(slot, 1))
                    behind.setdefault(i, []).extend(count_rcx(slot, -1))
        return self._text(before, behind)


@dataclass
class Counters:
    """Numbers of the counters: blocks first, then masked instructions, then repeated ones."""

    blocks: int
    masked: dict[tuple[int, int], int]
    repeated: dict[tuple[int, int], int]

    @classmethod
    def of(cls, sources: list[Source]) -> Counters:
        blocks = [
            (number, block) for source in sources for number, block in enumerate(source.blocks, source.first)
        ]
        each = [
            ((number, place), one)
            for number, block in blocks
            for place, one in enumerate(block.decoded[: len(block.lines)])
        ]
        masked = [key for key, one in each if one.mask is not None and one.kind]
        repeated = [key for key, one in each if one.repeat]
        numbers = itertools.count(len(blocks))
        return cls(
            len(blocks), {key: next(numbers) for key in masked}, {key: next(numbers) for key in repeated}
        )


_OSZAP = RflagsBits.OF | RflagsBits.SF | RflagsBits.ZF | RflagsBits.AF | RflagsBits.PF
# With a count of zero these leave the flags as they are: never taken for having overwritten them.
_MAY_KEEP_FLAGS = re.compile(r"SHLD?|SHRD?|SAL|SAR|RO[LR]|RC[LR]|(CMPS|SCAS)[BWDQ]")


def _slot(number: int) -> str:
    return f"%fs:stepwise_counters@tpoff+{8 * number}"


_RAX, _RCX = "%fs:stepwise_saved@tpoff", "%fs:stepwise_saved@tpoff+8"


def count(number: int, flags_free: bool) -> list[str]:
    if flags_free:
        return [f"\tincq\t{_slot(number)}"]
    return [
        f"\tmovq\t%rax, {_RAX}",
        f"\tmovq\t{_slot(number)}, %rax",
        "\tleaq\t1(%rax), %rax",
        f"\tmovq\t%rax, {_slot(number)}",
        f"\tmovq\t{_RAX}, %rax",
    ]


def count_lanes(number: int, mask: int, lanes: int) -> list[str]:
    """Adds the active lanes. Flags travel through ah and al: lahf all but OF, seto that one."""
    move = f"\tkmovw\t%k{mask}, %ecx" if lanes <= 16 else f"\tkmovd\t%k{mask}, %ecx"
    return [
        f"\tmovq\t%rax, {_RAX}",
        f"\tmovq\t%rcx, {_RCX}",
        "\tlahf",
        "\tseto\t%al",
        move,
        f"\tandl\t${(1 << lanes) - 1:#x}, %ecx",
        "\tpopcntl\t%ecx, %ecx",
        f"\taddq\t%rcx, {_slot(number)}",
        "\taddb\t$127, %al",  # overflows if al is 1
        "\tsahf",
        f"\tmovq\t{_RCX}, %rcx",
        f"\tmovq\t{_RAX}, %rax",
    ]


def count_rcx(number: int, sign: int) -> list[str]:
    """Adds rcx before a repeated instruction, takes off what is left behind it: its iterations."""
    step = [f"\tmovq\t%rax, {_RAX}", f"\tmovq\t{_slot(number)}, %rax"]
    if sign > 0:
        step.append("\tleaq\t(%rax,%rcx), %rax")
    else:
        step += ["\tnotq\t%rcx", "\tleaq\t1(%rax,%rcx), %rax", "\tnotq\t%rcx"]
    return [*step, f"\tmovq\t%rax, {_slot(number)}", f"\tmovq\t{_RAX}, %rax"]


def overwrites_flags(code: bytes, offset: int) -> bool:
    """Whether each flag that inc writes is overwritten in a block before anything reads it."""
    waiting = _OSZAP
    for instruction in Decoder(64, code, ip=offset):
        if instruction.rflags_read & waiting:
            return False
        if not _MAY_KEEP_FLAGS.fullmatch(MNEMONICS[instruction.mnemonic]):
            waiting &= ~instruction.rflags_modified
        if not waiting:
            return True
    return False
