"""Counters of what runs, as statements of assembly that change no register, no flag and no byte of the stack.

The red zone below rsp included: rax is kept in a thread-local slot, and the sum made by lea, which writes no
flag. Where the block itself overwrites every flag before it reads one, a single inc does the same. (Intel SDM
vol. 1, appendix A: which instructions write flags; System V ABI for AMD64, 3.2.2: the red zone; Drepper, ELF
Handling For Thread-Local Storage: tpoff.)
"""

from __future__ import annotations

import re

from iced_x86 import Decoder, RflagsBits

from study.counting.decode import MNEMONICS

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
