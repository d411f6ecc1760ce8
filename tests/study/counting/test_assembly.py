"""Assembly as basic blocks, and instructions decoded; what is expected is told from the text."""

from pathlib import Path

import pytest

from study.core.cli import StudyError
from study.counting import assembly, blocks
from study.counting.assembly_source import Source, overwrites_flags
from study.counting.counts import Counts
from study.counting.decode import decode

HEAD = "\t.text\n\t.globl f\n\t.type f, @function\n"


def read(tmp_path: Path, text: str) -> Source:
    path = tmp_path / "f.s"
    path.write_text(HEAD + text)
    return Source(path, 0)


def located(tmp_path: Path, text: str) -> Source:
    source = read(tmp_path, text)
    source.locate(assembly._assemble(["gcc"], source.marked(), tmp_path, "plain"))
    return source


def shapes(source: Source) -> list[tuple[str, bool, int]]:
    """Function, whether an entry, instructions of each block."""
    return [(b.function, b.entry, len(b.lines)) for b in source.blocks]


def test_blocks_begin_at_targets_and_behind_branches(tmp_path):
    source = read(
        tmp_path,
        "f:\n.LFB0:\n\tmovl %edi, %eax\n\tcmpl $3, %edi\n\tja .L2\n\tnotrack jmp *.L4(,%rdi,8)\n"
        "\t.section .rodata\n.L4:\n\t.quad .L5\n\t.quad .L2\n\t.text\n"
        ".L5:\n\tcall g@PLT\n\tnop\n.L7:\n\tnop\n.L2:\n\trep ret\n.LFE0:\n",
    )
    # .L4 is data and .L7 nobody's target; behind the call begins a block
    assert shapes(source) == [
        ("f", True, 3),
        ("f", False, 1),
        ("f", False, 1),
        ("f", False, 2),
        ("f", False, 1),
    ]
    assert [b.callee for b in source.blocks] == [None, None, "g", None, None]


def test_a_loop_at_the_entry_is_no_call(tmp_path):
    source = read(tmp_path, "f:\n.L2:\n\tdecl %edi\n\tjnz .L2\n\tret\n")
    assert shapes(source) == [("f", True, 0), ("f", False, 2), ("f", False, 1)]


def test_a_conditional_call_at_the_end_is_counted_by_what_goes_on(tmp_path):
    source = read(tmp_path, "f:\n\ttestl %edi, %edi\n\tje g\n.L3:\n\tdecl %edi\n\tjne .L3\n\tjmp g\n")
    assert shapes(source) == [("f", True, 2), ("f", False, 0), ("f", False, 2), ("f", False, 1)]
    assert [(b.callee, b.conditional) for b in source.blocks] == [
        ("g", True),
        (None, False),
        (None, False),
        ("g", False),
    ]


def test_padding_that_is_executed_is_counted(tmp_path):
    source = read(
        tmp_path,
        "f:\n\ttestl %edi, %edi\n\tje .L2\n\t.p2align 4\n.L3:\n\tdecl %edi\n\tjne .L3\n.L2:\n\tret\n",
    )
    obj = assembly._assemble(["gcc"], source.marked(), tmp_path, "plain")
    source.locate(obj)
    # test and jump have 4 bytes: 12 of padding to the loop
    assert len(source.blocks[1].code) == 12
    assert {one.mnemonic for one in source.blocks[1].decoded} == {"nop"}
    assert [len(b.lines) for b in source.blocks] == [2, 0, 2, 1]


def test_cold_parts_belong_to_their_function(tmp_path):
    source = read(
        tmp_path,
        "f:\n\ttestl %edi, %edi\n\tje .L2\n\tret\n"
        '\t.section .text.unlikely,"ax",@progbits\n\t.type f.cold, @function\nf.cold:\n.L2:\n\tcall abort\n',
    )
    cold = [b for b in source.blocks if b.section == ".text.unlikely"]
    assert {blocks.source_name(b.function) for b in cold} == {"f"}
    assert all(blocks.is_part(b.function) for b in cold)


@pytest.mark.parametrize(
    "text, flags_free",
    [
        ("\tcmpl $1, %edi\n\tje .L9\n", True),
        ("\tje .L9\n", False),  # reads what came in
        ("\tmovl %edi, %eax\n\tret\n", False),  # never writes them
        ("\tadcl $0, %edi\n\tret\n", True),  # inc leaves the carry alone, and the rest is overwritten
        ("\tsetz %al\n\tcmpl $1, %edi\n\tret\n", False),
        ("\tshll %cl, %edi\n\tjs .L9\n", False),  # by zero: flags as before
    ],
)
def test_one_instruction_counts_only_where_flags_are_dead(tmp_path, text, flags_free):
    source = located(tmp_path, f"f:\n{text}.L9:\n\tret\n")
    assert overwrites_flags(source.blocks[0].code, source.blocks[0].offset) is flags_free


def test_a_prefix_stays_with_its_instruction(tmp_path):
    """clang writes rep;movsq: between the two a counter would be repeated, and the copy would not."""
    source = read(tmp_path, "f:\n\trep;movsq (%rsi), %es:(%rdi)\n\tret\n")
    assert shapes(source) == [("f", True, 2)]
    source.locate(assembly._assemble(["gcc"], source.marked(), tmp_path, "plain"))
    assert [one.repeat for one in source.blocks[0].decoded] == [True, False]


@pytest.mark.parametrize(
    "text",
    [
        "f:\n\tjmp .+4\n",  # by distance, not to a label
        "\tnop\n",  # outside any function
        "f:\n\trep\n\t.data\n",
        "f:\n\tnop\n\t.pushsection .data\n\t.popsection\n\tret\n",
        "f:\n\tnop\n\t.byte 0xeb, 0\n\tret\n",  # bytes written by hand
    ],
)
def test_what_cannot_be_counted_is_refused(tmp_path, text):
    with pytest.raises(StudyError, match=r"f\.s:\d+: "):
        located(tmp_path, text)


def test_data_between_functions_is_no_code(tmp_path):
    source = located(tmp_path, "f:\n\tjmp *.L4(,%rdi,8)\n.L4:\n\t.quad .L5\n.L5:\n\tret\n")
    assert [[one.mnemonic for one in b.decoded] for b in source.blocks] == [["jmp"], ["ret"]]


def test_an_alias_is_the_function_it_stands_for(tmp_path):
    (tmp_path / "f.s").write_text(HEAD + "f:\n\tcall h\n\tret\n\t.type g, @function\ng:\n\tret\n\t.set h,g\n")
    assembly.instrument(["gcc"], [tmp_path / "f.s"], tmp_path / "out")
    table = blocks.read_table(tmp_path / "out/table.json")
    assert table.raw.calls == [(0, "g", None)]
    assert [(b.function, b.entry) for b in table.raw.blocks] == [("f", True), ("f", False), ("g", True)]


def test_what_cannot_be_assembled_leaves_nothing_that_looks_whole(tmp_path):
    """A loop instruction reaches 127 bytes, which the counters exceed."""
    (tmp_path / "f.s").write_text(HEAD + "f:\n.L2:\n" + "\tcall g\n" * 20 + "\tloop .L2\n\tret\n")
    with pytest.raises(StudyError, match=r"counted/f\.s"):
        assembly.instrument(["gcc"], [tmp_path / "f.s"], tmp_path / "out")
    assert not (tmp_path / "out" / "table.json").exists()


def test_a_part_split_off_is_its_function_and_no_call():
    """f does its rest in f.part.0; g calls a copy of f made for it."""
    symbols = ["f", "f.part.0", "g", "f.constprop.1"]
    made = [assembly.Block(symbol, True, "f.s", ".text", 0, "c3") for symbol in symbols]
    raw = assembly.Table(made, [(0, "f.part.0", None), (2, "f.constprop.1", None)], [], [], "h")
    table = blocks.Table(Path("t"), raw, [decode(b"\xc3")] * 4, {}, {})
    said = {"counts": "basic blocks", "table": "h", "blocks": [5, 3, 7, 7], "masked": [], "repeated": []}
    total, functions, edges = blocks.evaluate(table, said)
    assert {name: (c.calls, c.instructions) for name, c in functions.items()} == {"f": (12, 15), "g": (7, 7)}
    assert edges == {"g": {"f": 7}}
    assert total.calls == 19


# --- instructions


@pytest.mark.parametrize("code", ["dbf1", "dff1", "dbe9", "dfe9", "d8d1", "ded9", "660f2fc1", "660fc2c101"])
def test_every_comparison_is_one(code):
    """fcomi, fcomip, fucomi, fucomip, fcom, fcompp, comisd, cmppd"""
    assert decode(bytes.fromhex(code))[0].kind == "compare"


@pytest.mark.parametrize("code", ["c4e37140c2f1", "660f3a41c131", "62f2f5482cc2", "62f3f54850c201", "d9fe"])
def test_arithmetic_that_is_not_counted_is_refused_where_it_is_executed(code):
    """vdpps, dppd, vscalefpd, vrangepd, fsin"""
    (one,) = decode(bytes.fromhex(code))
    Counts().add(one, 0)
    with pytest.raises(StudyError, match=one.mnemonic):
        Counts().add(one, 1)


def test_of_masked_lanes_the_active_ones_count():
    (one,) = decode(bytes.fromhex("660f58c0"))  # addpd
    found = Counts()
    found.add(one, 3, 5)  # of the six lanes of three sums five
    assert (found.machine, found.instructions) == (5, 3)
