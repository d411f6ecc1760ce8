"""Regions of a program's code that samples fall into: innermost loops, and what is in none, by function."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import networkx as nx
from iced_x86 import Decoder, FlowControl, Formatter, FormatterSyntax, OpKind

from study.bounds.profiles import Sampled
from study.counting.elf import Function, Program, canonical

_SYNTAX = Formatter(FormatterSyntax.GAS)
_JUMPS = (FlowControl.CONDITIONAL_BRANCH, FlowControl.UNCONDITIONAL_BRANCH, FlowControl.INDIRECT_BRANCH)
ROOT = -1  # of the control flow: no block's address
LEAST = 0.01  # of the frame: a region under it is left out


@dataclass(frozen=True)
class Line:
    """One instruction in AT&T syntax. `target`: of a direct jump, else None."""

    address: int
    mnemonic: str
    text: str = ""
    target: int | None = None
    flow: int = FlowControl.NEXT

    @property
    def is_call(self) -> bool:
        return self.flow in (FlowControl.CALL, FlowControl.INDIRECT_CALL)

    @property
    def jumps(self) -> bool:
        return self.flow in _JUMPS

    @property
    def ends_block(self) -> bool:
        return self.jumps or not self.goes_on

    @property
    def goes_on(self) -> bool:
        """Whether the next instruction may follow."""
        return self.flow in (FlowControl.NEXT, FlowControl.CONDITIONAL_BRANCH) or self.is_call


def disassemble(code: bytes, start: int) -> list[Line]:
    """Instructions at an address, as far as they are known."""
    found = []
    for one in Decoder(64, code, ip=start):
        if one.is_invalid:
            break
        mnemonic, text = _SYNTAX.format_mnemonic(one), _SYNTAX.format_all_operands(one)
        direct = one.flow_control in _JUMPS and one.op0_kind == OpKind.NEAR_BRANCH64
        target = one.near_branch_target if direct else None
        found.append(Line(one.ip, mnemonic, text, target, one.flow_control))
    return found


def blocks_of(lines: Sequence[Line]) -> dict[int, list[Line]]:
    known = {line.address for line in lines}
    leaders = {lines[0].address} | {line.target for line in lines if line.target in known}
    leaders |= {after.address for line, after in itertools.pairwise(lines) if line.ends_block}
    found: dict[int, list[Line]] = {}
    for line in lines:
        if line.address in leaders:
            current = found.setdefault(line.address, [])
        current.append(line)
    return found


def flow(blocks: Mapping[int, Sequence[Line]]) -> nx.DiGraph:
    """The control flow between basic blocks; ROOT leads to the entry and to blocks that nothing leads to."""
    order = list(blocks)
    graph = nx.DiGraph()
    graph.add_nodes_from(order)
    for start, behind in itertools.zip_longest(order, order[1:]):
        last = blocks[start][-1]
        if last.target in blocks:
            graph.add_edge(start, last.target)
        if last.goes_on and behind is not None:
            graph.add_edge(start, behind)
    # A block that nothing else leads to is a case of a switch: the computed jumps lead there.
    cases = [start for start in order[1:] if not graph.in_degree(start)]
    for start in order:
        if blocks[start][-1].flow == FlowControl.INDIRECT_BRANCH:
            graph.add_edges_from((start, case) for case in cases)
    graph.add_edges_from((ROOT, start) for start in order if start == order[0] or not graph.in_degree(start))
    return graph


def loops_of(blocks: Mapping[int, Sequence[Line]]) -> dict[int, set[int]]:
    """Natural loops: header to the blocks of its body (A. V. Aho et al., Compilers, 2nd ed., 9.6.6)."""
    graph = flow(blocks)
    tree = nx.DiGraph((above, block) for block, above in nx.immediate_dominators(graph, ROOT).items())
    loops: dict[int, set[int]] = {}
    for tail, header in list(graph.edges):
        if tail in tree and (header == tail or header in nx.ancestors(tree, tail)):
            without = graph.subgraph(graph.nodes - {header})
            body = set() if tail == header else nx.ancestors(without, tail) | {tail}
            loops.setdefault(header, {header}).update(body - {ROOT})
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


def regions(sampled: Sampled, built: Program) -> list[Region]:
    """Where the samples of a shipped build are, the hottest first. Blocks without any sample are left out."""
    weights: dict[Function, dict[int, int]] = {}
    whole = sampled.profile.weight
    for address, weight in sampled.addresses.items():
        if function := built.function_at(address):
            weights.setdefault(function, {})[address] = weight
    found = []
    for function, here in weights.items():
        start, name = function.start, function.name
        if sum(here.values()) < LEAST * whole:
            continue
        blocks = blocks_of(disassemble(built.code_of(function), start))
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
                share = weight / whole
                found.append(Region(canonical(name), offset, header is not None, lines, share))
    return sorted(found, key=lambda region: -region.share)


def assembly(lines: Iterable[Line]) -> str:
    """The instructions for an analyser: jumps to one label, without calls, returns and padding. Pushes and
    pops become the stores and loads that they are: cores keep the stack pointer aside, the analysers make
    a chain of it (A. Fog, The microarchitecture of Intel, AMD and VIA CPUs: stack engine).
    """
    text = [".Lhere:"]
    for line in lines:
        if line.flow == FlowControl.CONDITIONAL_BRANCH or (line.jumps and line.target is not None):
            text.append(f"\t{line.mnemonic}\t.Lhere")
        elif line.flow != FlowControl.NEXT or line.mnemonic.startswith(("nop", "endbr", "xchg", "leave")):
            continue
        elif line.mnemonic in ("push", "pop"):
            register = line.text if line.text.startswith("%") else "%r11"
            if register != line.text:
                text.append(f"\tmovq\t{line.text}, {register}")
            ends = (register, "-8(%rsp)") if line.mnemonic == "push" else ("-8(%rsp)", register)
            text.append(f"\tmovq\t{', '.join(ends)}")
        else:
            text.append(f"\t{line.mnemonic}\t{line.text}".rstrip())
    return "\n".join(text) + "\n"
