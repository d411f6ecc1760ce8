"""What an x86-64 instruction does, for counting: FLOPs by class, precision and width, bytes, its kind.

What counts as a FLOP (the machine convention): ADD SUB MUL DIV SQRT RCP RSQRT MIN MAX, HADD and ADDSUB, one
per lane; FMA two per lane. Comparisons are told apart and count none; conversions, rounding, logic and
shuffles are no FLOPs. That is what Intel's SDE and FP_ARITH_INST_RETIRED count (Intel SDM vol. 3B, 20.3),
DPP left out. What does arithmetic in another way (_UNCOUNTED, DPP among it) is refused where it is executed.
Decoder: iced-x86.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

from iced_x86 import (
    Decoder,
    FlowControl,
    Instruction,
    InstructionInfoFactory,
    MemorySizeExt,
    Mnemonic,
    OpAccess,
    OpKind,
    Register,
    RegisterExt,
)

CLASSES = ("add", "mul", "fma", "div", "sqrt", "rsqrt", "minmax", "compare")
FLOPS = {"add": 1, "mul": 1, "fma": 2, "div": 1, "sqrt": 1, "rsqrt": 1, "minmax": 1, "compare": 0, "any": 1}
MIX = (
    "fp arithmetic",
    "fp compare",
    "convert",
    "logic, shuffle, blend",
    "vector integer",
    "mask",
    "vector move",
    "move",
    "integer",
    "branch",
    "call, return",
    "stack",
    "other",
)

_ELEMENT = {"S": 32, "D": 64, "H": 16}
_PRECISION = {32: "single", 64: "double", 16: "half", 80: "extended"}
_CLASS = {
    **dict.fromkeys(("ADD", "SUB", "HADD", "HSUB", "ADDSUB"), "add"),
    **dict.fromkeys(("MIN", "MAX"), "minmax"),
    **dict.fromkeys(("RCP", "RSQRT", "RCP14", "RSQRT14", "RCP28", "RSQRT28"), "rsqrt"),
    **dict.fromkeys(("CMP", "UCOMI", "COMI"), "compare"),
    **{"MUL": "mul", "DIV": "div", "SQRT": "sqrt"},
}
_PLAIN = re.compile(rf"V?({'|'.join(sorted(_CLASS, key=len, reverse=True))})([PS])([SDH])")
_SCALAR_COPY = re.compile(r"V?MOVS([SD])")
_COPY = re.compile(r"V?MOV(AP|UP|S)[SD]|V?MOVDQ[AU]")
_SUM = re.compile(r"V?ADD[PS][SDH]")
_FMA = re.compile(r"VFN?M(?:ADDSUB|SUBADD|ADD|SUB)(?:132|213|231)?([PS])([SDH])")
_X87 = re.compile(r"F(ADD|SUBR?|MUL|DIVR?|SQRT|U?COMI?)(P|PP)?|FI(ADD|SUBR?|MUL|DIVR?|COM)P?")
# Arithmetic that is none of the classes: dot products, scaling, ranges, complex, 16-bit, x87's functions.
_UNCOUNTED = re.compile(
    r"V?DPP[SD]|V(SCALEF|RANGE|MINMAX|EXP2|RECIP28)[PS][SDH]|V4FN?MADD[PS]S|VFC?(MADD|MUL)C[PS]H|VDPB?F?(BF|PH)\w*"
    r"|TDP\w+|PF(ADD|SUBR?|MUL|MIN|MAX|RCP\w*|RSQ\w*|ACC|N?P?N?ACC)|FSIN|FCOS|FSINCOS|FPTAN|FPATAN|F2XM1|FYL2X(P1)?"
    r"|FSCALE|FPREM1?|FTST"
)
_CONVERT = re.compile(r"V?CVT.*|CDQE?|CWDE?|CQO|V?ROUND.*|VRNDSCALE.*|VREDUCE.*")
_SHUFFLE = re.compile(
    r"V?(P?(AND|ANDN|OR|XOR)(PS|PD|[DQ])?|P?BLEND.*|P?SHUF.*|P?UNPCK.*|PERM.*|INSERT.*|EXTRACT.*|BROADCAST.*|PBROADCAST.*"
    r"|PINSR.*|PEXTR.*|MOVMSKP[SD]|PMOVMSKB|TESTP[SD]|PTEST|PALIGNR|ALIGN[DQ]|COMPRESS.*|EXPAND.*|PTERNLOG.*|MOVS[LH]DUP"
    r"|MOVDDUP|MOVHLPS|MOVLHPS)|VZERO.*"
)
_MOVE = re.compile(
    r"V?(MOV(AP|UP|NTP|HP|LP)[SD]|MOVS[SD]|MOVDQ.*|MOV[DQ]|LDDQU|MASKMOV.*|P?GATHER.*|P?SCATTER.*|MOVNT.*)"
)
_MASK = re.compile(r"K[A-Z]+[BWDQ]+")
_NAMES = {value: name for name, value in vars(Mnemonic).items() if isinstance(value, int)}
# Bytes read and written by one iteration of a repeated string instruction, in elements of its own size.
_STRING = {"MOVS": (1, 1), "STOS": (0, 1), "LODS": (1, 0), "CMPS": (2, 0), "SCAS": (1, 0)}
_STRING_ELEMENT = {"B": 1, "W": 2, "D": 4, "Q": 8}
_READS = (OpAccess.READ, OpAccess.COND_READ, OpAccess.READ_WRITE, OpAccess.READ_COND_WRITE)
_WRITES = (OpAccess.WRITE, OpAccess.COND_WRITE, OpAccess.READ_WRITE, OpAccess.READ_COND_WRITE)


@dataclass(frozen=True)
class Decoded:
    """One instruction.

    `kind`: one of CLASSES, or None; `bits`: width of what it works on (the element's where scalar). `mask`:
    number of the k register that says which lanes count, or None. `load`, `store`: bytes that the core sees,
    all lanes. `repeat`: a string instruction whose bytes are per iteration, rcx of them. `target`: where a
    direct call or jump goes, else 0. `doubling`: a sum x + x, as which compilers write 2·x. `uncounted`:
    arithmetic that is not of CLASSES, so that nothing true can be said of its FLOPs. `ends_block`: control
    leaves, or may leave, behind it.
    """

    address: int
    length: int
    mnemonic: str
    mix: str
    kind: str | None = None
    precision: str | None = None
    bits: int = 0
    lanes: int = 0
    mask: int | None = None
    load: int = 0
    store: int = 0
    repeat: bool = False
    target: int = 0
    is_call: bool = False
    ends_block: bool = False
    doubling: bool = False
    uncounted: bool = False
    known: bool = True

    @property
    def flops(self) -> int:
        """By the machine convention, with all lanes active."""
        return FLOPS[self.kind] * self.lanes if self.kind else 0


@cache
def arithmetic(name: str) -> tuple[str, bool, int] | None:
    """Class, whether packed, bits of an element; None if the mnemonic is no floating-point arithmetic."""
    if match := _FMA.fullmatch(name):
        return "fma", match[1] == "P", _ELEMENT[match[2]]
    if match := _PLAIN.fullmatch(name):
        return _CLASS[match[1]], match[2] == "P", _ELEMENT[match[3]]
    if match := _X87.fullmatch(name):
        word = (match[1] or match[3]).removesuffix("R")
        kind = {"ADD": "add", "SUB": "add", "MUL": "mul", "DIV": "div", "SQRT": "sqrt"}.get(word, "compare")
        return kind, False, 80
    return None


@cache
def _mix(name: str, flow: int, vector: bool, stack: bool) -> str:
    if flow in (FlowControl.CALL, FlowControl.INDIRECT_CALL, FlowControl.RETURN):
        return "call, return"
    if flow != FlowControl.NEXT:
        return "branch" if flow not in (FlowControl.INTERRUPT, FlowControl.EXCEPTION) else "other"
    if _MASK.fullmatch(name):
        return "mask"
    if vector or name.startswith(("CVT", "VCVT", "VZERO")):
        for pattern, place in (
            (_CONVERT, "convert"),
            (_SHUFFLE, "logic, shuffle, blend"),
            (_MOVE, "vector move"),
        ):
            if pattern.fullmatch(name):
                return place
        return "vector integer" if name.startswith(("P", "VP")) else "other"
    if stack:
        return "stack"
    if name.startswith(("MOV", "CMOV", "XCHG", "STOS", "LODS")):
        return "move"
    return "other" if name.startswith(("F", "LFENCE", "RDTSC", "ENDBR", "SYSCALL", "CPUID")) else "integer"


def _vector_bits(instruction: Instruction) -> int:
    """The widest vector register among the operands, 0 without one."""
    widest = 0
    for i in range(instruction.op_count):
        if instruction.op_kind(i) == OpKind.REGISTER:
            register = instruction.op_register(i)
            if RegisterExt.is_vector_register(register):
                widest = max(widest, RegisterExt.size(register) * 8)
    return widest


class _Value:
    """Held in one or more places, the same in its lower `bits`."""

    def __init__(self) -> None:
        self.bits = 512


class _Values:
    """Which vector registers and words on the stack are known to hold the same, along straight-line code."""

    def __init__(self, info: InstructionInfoFactory) -> None:
        self._info = info
        self.forget()

    def forget(self) -> None:
        """Control may have come from elsewhere."""
        self._held: dict[tuple, _Value] = {}

    def _place(self, instruction: Instruction, i: int) -> tuple | None:
        """A vector register, or a word at rsp plus a constant; None: anything else."""
        if instruction.op_kind(i) == OpKind.REGISTER:
            register = instruction.op_register(i)
            return (
                (RegisterExt.full_register(register),) if RegisterExt.is_vector_register(register) else None
            )
        plain = instruction.memory_base == Register.RSP and instruction.memory_index == Register.NONE
        if instruction.op_kind(i) == OpKind.MEMORY and plain:
            return Register.RSP, instruction.memory_displacement
        return None

    def _value(self, place: tuple) -> _Value:
        return self._held.setdefault(place, _Value())

    def is_doubling(self, instruction: Instruction, bits: int) -> bool:
        """Whether the two that a sum adds, its last two operands, are known to be the same in those bits."""
        last = instruction.op_count - 1
        a, b = (self._place(instruction, i) for i in (last - 1, last))
        if a is None or b is None:
            return False
        return a == b or (self._value(a) is self._value(b) and self._value(a).bits >= bits)

    def follow(self, instruction: Instruction, name: str) -> None:
        """What is known behind the instruction."""
        moved = None
        if _COPY.fullmatch(name) and instruction.op_count == 2:
            to, source = self._place(instruction, 0), self._place(instruction, 1)
            if to is not None and source is not None:
                moved = to, self._value(source)
                scalar = _SCALAR_COPY.fullmatch(name)
                width = _ELEMENT[scalar[1]] if scalar else _vector_bits(instruction)
                moved[1].bits = min(moved[1].bits, width)
        used = self._info.info(instruction)
        written = {
            RegisterExt.full_register(one.register) for one in used.used_registers() if one.access in _WRITES
        }
        if Register.RSP in written or any(one.access in _WRITES for one in used.used_memory()):
            self._held = {place: value for place, value in self._held.items() if len(place) == 1}
        for register in written:
            self._held.pop((register,), None)
        if moved:
            self._held[moved[0]] = moved[1]
        if instruction.flow_control != FlowControl.NEXT:
            self.forget()


class Disassembler:
    """Decodes bytes at an address. Keep one: setting it up is what costs."""

    def __init__(self) -> None:
        self._info = InstructionInfoFactory()

    def decode(self, code: bytes, address: int = 0) -> list[Decoded]:
        """All instructions; an undecodable byte gives one with `known` False and stops."""
        found, values = [], _Values(self._info)
        for instruction in Decoder(64, code, ip=address):
            found.append(self._one(instruction, values))
            values.follow(instruction, _NAMES[instruction.mnemonic])
            if not found[-1].known:
                break
        return found

    def _one(self, instruction: Instruction, values: _Values) -> Decoded:
        name = _NAMES[instruction.mnemonic]
        place = {"address": instruction.ip, "length": instruction.len, "mnemonic": name.lower()}
        if instruction.is_invalid:
            return Decoded(**place, mix="other", known=False)
        width = _vector_bits(instruction)
        load, store = self._bytes(instruction)
        flow = instruction.flow_control
        string = instruction.is_string_instruction
        direct = flow in (FlowControl.CALL, FlowControl.CONDITIONAL_BRANCH, FlowControl.UNCONDITIONAL_BRANCH)
        mask = instruction.op_mask - Register.K0 if instruction.op_mask != Register.NONE else None
        rest = {
            "mask": mask,
            "load": load,
            "store": store,
            "repeat": string and (instruction.has_rep_prefix or instruction.has_repne_prefix),
            "target": instruction.near_branch_target
            if direct and instruction.op0_kind == OpKind.NEAR_BRANCH64
            else 0,
            "is_call": flow in (FlowControl.CALL, FlowControl.INDIRECT_CALL),
            "ends_block": flow != FlowControl.NEXT,
        }
        found = None if string else arithmetic(name)
        if found:
            kind, packed, element = found
            bits = width if packed else element
            rest |= {"kind": kind, "precision": _PRECISION[element], "bits": bits, "lanes": bits // element}
            rest["doubling"] = _SUM.fullmatch(name) is not None and values.is_doubling(instruction, bits)
            mix = "fp compare" if kind == "compare" else "fp arithmetic"
        else:
            mix = _mix(name, flow, width > 0, instruction.is_stack_instruction)
            rest["uncounted"] = _UNCOUNTED.fullmatch(name) is not None
        return Decoded(**place, mix=mix, **rest)

    def _bytes(self, instruction: Instruction) -> tuple[int, int]:
        load = store = 0
        if instruction.is_string_instruction:
            name = _NAMES[instruction.mnemonic]
            size = _STRING_ELEMENT.get(name[-1], 0)
            return tuple(size * n for n in _STRING.get(name[:-1], (0, 0)))  # type: ignore[return-value]
        for memory in self._info.info(instruction).used_memory():
            size = MemorySizeExt.size(memory.memory_size)
            if memory.vsib_size and RegisterExt.is_vector_register(memory.index):
                size *= max(_vector_bits(instruction) // 8 // max(size, 1), 1)
            load += size if memory.access in _READS else 0
            store += size if memory.access in _WRITES else 0
        return load, store
