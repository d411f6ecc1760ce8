"""What an x86-64 instruction does, for counting: FLOPs by class, precision and width, and bytes.

What counts as a FLOP (the machine convention): ADD SUB MUL DIV SQRT RCP RSQRT MIN MAX, HADD and ADDSUB, one
per lane; FMA two per lane. Comparisons are told apart and count none; conversions, rounding, logic and
shuffles are no FLOPs. That is what Intel's SDE and FP_ARITH_INST_RETIRED count (Intel SDM vol. 3B, 20.3),
DPP left out. What does arithmetic in another way (_UNCOUNTED, DPP among it) is refused where it is executed.
Decoder: iced-x86.
"""

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

MNEMONICS = {value: name for name, value in vars(Mnemonic).items() if isinstance(value, int)}
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
_FMA = re.compile(r"VFN?M(?:ADDSUB|SUBADD|ADD|SUB)(?:132|213|231)?([PS])([SDH])")
_X87 = re.compile(r"F(ADD|SUBR?|MUL|DIVR?|SQRT|U?COMI?)(P|PP)?|FI(ADD|SUBR?|MUL|DIVR?|COM)P?")
# Arithmetic that is none of the classes: dot products, scaling, ranges, complex, 16-bit, x87's functions.
_UNCOUNTED = re.compile(
    r"V?DPP[SD]|V(SCALEF|RANGE|MINMAX|EXP2|RECIP28)[PS][SDH]|V4FN?MADD[PS]S|VFC?(MADD|MUL)C[PS]H|VDPB?F?(BF|PH)\w*"
    r"|TDP\w+|PF(ADD|SUBR?|MUL|MIN|MAX|RCP\w*|RSQ\w*|ACC|N?P?N?ACC)|FSIN|FCOS|FSINCOS|FPTAN|FPATAN|F2XM1|FYL2X(P1)?"
    r"|FSCALE|FPREM1?|FTST"
)
_READS = (OpAccess.READ, OpAccess.COND_READ, OpAccess.READ_WRITE, OpAccess.READ_COND_WRITE)
_WRITES = (OpAccess.WRITE, OpAccess.COND_WRITE, OpAccess.READ_WRITE, OpAccess.READ_COND_WRITE)
_DIRECT = (FlowControl.CALL, FlowControl.CONDITIONAL_BRANCH, FlowControl.UNCONDITIONAL_BRANCH)
_INFO = InstructionInfoFactory()


@dataclass(frozen=True)
class Decoded:
    """One instruction.

    `kind`: a key of schema.FLOPS, or None; `bits`: width of what it works on (the element's where scalar).
    `mask`: number of the k register that says which lanes count, or None. `load`, `store`: bytes that the
    core sees, all lanes. `repeat`: a string instruction whose bytes are per iteration, rcx of them. `target`:
    where a direct call or jump goes, else 0. `uncounted`: arithmetic of no kind, so that nothing true can be
    said of its FLOPs. `ends_block`: control leaves, or may leave, behind it.
    """

    address: int
    length: int
    mnemonic: str
    kind: str | None = None
    precision: str = ""
    bits: int = 0
    lanes: int = 0
    mask: int | None = None
    load: int = 0
    store: int = 0
    repeat: bool = False
    target: int = 0
    ends_block: bool = False
    uncounted: bool = False
    known: bool = True


@cache
def arithmetic(name: str) -> tuple[str, bool, int] | None:
    """Class, whether packed, bits of an element; None if the mnemonic is no floating-point arithmetic."""
    if match := _FMA.fullmatch(name):
        return "fma", match[1] == "P", _ELEMENT[match[2]]
    if match := _PLAIN.fullmatch(name):
        return _CLASS[match[1]], match[2] == "P", _ELEMENT[match[3]]
    if match := _X87.fullmatch(name):
        word = (match[1] or match[3]).removesuffix("R")
        return (_CLASS | {"SUB": "add"}).get(word, "compare"), False, 80
    return None


def decode(code: bytes, address: int = 0) -> list[Decoded]:
    """All instructions; an undecodable byte gives one with `known` False and stops."""
    found = []
    for instruction in Decoder(64, code, ip=address):
        found.append(_decoded(instruction))
        if not found[-1].known:
            break
    return found


def _decoded(instruction: Instruction) -> Decoded:
    name = MNEMONICS[instruction.mnemonic]
    if instruction.is_invalid:
        return Decoded(instruction.ip, instruction.len, name.lower(), known=False)
    flow, string = instruction.flow_control, instruction.is_string_instruction
    near = flow in _DIRECT and instruction.op0_kind == OpKind.NEAR_BRANCH64
    load, store = _bytes(instruction)
    kind, precision, bits, lanes = None, "", 0, 0
    if not string and (found := arithmetic(name)):
        kind, packed, element = found
        bits = _vector_bits(instruction) if packed else element
        precision, lanes = _PRECISION[element], bits // element
    return Decoded(
        address=instruction.ip,
        length=instruction.len,
        mnemonic=name.lower(),
        kind=kind,
        precision=precision,
        bits=bits,
        lanes=lanes,
        mask=instruction.op_mask - Register.K0 if instruction.op_mask != Register.NONE else None,
        load=load,
        store=store,
        repeat=string and (instruction.has_rep_prefix or instruction.has_repne_prefix),
        target=instruction.near_branch_target if near else 0,
        ends_block=flow != FlowControl.NEXT,
        uncounted=_UNCOUNTED.fullmatch(name) is not None,
    )


def _vector_bits(instruction: Instruction) -> int:
    """The widest vector register among the operands, 0 without one."""
    registers = (
        instruction.op_register(i)
        for i in range(instruction.op_count)
        if instruction.op_kind(i) == OpKind.REGISTER
    )
    return max((8 * RegisterExt.size(r) for r in registers if RegisterExt.is_vector_register(r)), default=0)


def _bytes(instruction: Instruction) -> tuple[int, int]:
    load = store = 0
    for memory in _INFO.info(instruction).used_memory():
        size = MemorySizeExt.size(memory.memory_size or instruction.memory_size)  # 0: one of rcx iterations
        if memory.vsib_size and RegisterExt.is_vector_register(memory.index):  # a gather: an element a lane
            size *= max(_vector_bits(instruction) // 8 // max(size, 1), 1)
        load += size if memory.access in _READS else 0
        store += size if memory.access in _WRITES else 0
    return load, store
