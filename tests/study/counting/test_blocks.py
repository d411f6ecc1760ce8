"""Block counters: known work exactly, the shipped code byte for byte, its picture, counts that add up."""

from __future__ import annotations

import copy
import functools
import itertools
import json
import os
import re
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import needs
import numpy as np
import pytest
from elftools.elf.elffile import ELFFile

from study.core import patches, registry, run, store
from study.core.build import build
from study.core.cli import BAD_INPUT, StudyError
from study.core.registry import ROOT, find_phase, find_scene, variant_here
from study.core.run import DriverError
from study.counting import assembly, blocks, calibration, qemu
from study.counting.assembly_counters import overwrites_flags
from study.counting.assembly_source import Source
from study.counting.counts import Counts, Measured
from study.counting.decode import Disassembler
from study.pictures import images

pytestmark = pytest.mark.slow

COMPILERS = {"gcc": "build", "clang": "build/clang"}
PHASES = list(registry.ladder())
# By clang too, but for a phase that compiles itself where it runs: its parent's code is counted there again.
PROGRAMS = [
    (compiler, phase)
    for phase in PHASES
    for compiler in COMPILERS
    if compiler == "gcc" or not registry.find_phase(phase).embedded
]
VARIANTS = list(blocks.TARGETS)
# Nobody counts what clang makes of functions that are kept: one phase of each kind (tests/builds.py).
COUNTING = [
    (variant, *program)
    for variant in VARIANTS
    for program in PROGRAMS
    if (variant, program[0]) != ("calls", "clang") or program[1] in ("baseline", "opt4", "opt9_convex")
]
REPEATS = 3


def make(compiler: str, *targets: str) -> Path:
    """The compiler's folder, with these built in it."""
    folder = COMPILERS[compiler]
    command = ["make", "-s", f"CC={compiler}", f"BUILD={folder}", *(f"{folder}/{t}" for t in targets)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return ROOT / folder


# --- known work


@pytest.fixture(scope="module", params=COMPILERS)
def calibrate(request):
    """Runs a part of the known work with counted blocks: total, functions, edges."""
    folder = make(request.param, "calibration/calibrate-blocks") / "calibration"
    table = blocks.read_table(folder / "blocks/table.json")

    def one(part: str, repeats: int) -> tuple[Counts, dict[str, Counts], dict[str, dict[str, int]]]:
        command = [str(folder / "calibrate-blocks"), part, str(repeats)]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return blocks.evaluate(table, json.loads(done.stdout))

    return one


@pytest.mark.parametrize("part", calibration.parts())
def test_known_work_is_counted_exactly(calibrate, part):
    if lacking := calibration.parts()[part]:
        pytest.skip(f"the CPU lacks {', '.join(lacking)}")
    total, functions, edges = calibrate(part, REPEATS)
    assert calibration.differences(functions, part, REPEATS, edges) == []
    known = calibration.expected(part, REPEATS).values()
    if known:
        assert total.machine == sum(c.machine for c in known)


def test_two_threads_count_as_one(calibrate):
    """One thread's work and twice that by another, against three times the work by one."""
    _, by_two, _ = calibrate("threads", REPEATS)
    _, by_one, _ = calibrate("sse", 3 * REPEATS)
    assert by_two["sse_double"] == by_one["sse_double"]


def test_flops_of_the_expected_table_by_another_hand():
    """The parts' FLOPs by SDE's rule, once more and not from the table's rows: 10 rounds of each loop."""

    def flops(part: str) -> int:
        return sum(c.machine for c in calibration.expected(part, 1).values())

    scalar = 3 + 3 + 1 + 1 + 3  # add, mul, div, sqrt, min and max
    assert flops("scalar") == 10 * (scalar + scalar + 2)
    assert flops("sse") == 10 * (10 * 2 + 12 * 4)
    assert flops("avx2") == 10 * ((9 + 7 * 2) * 4 + 2 * 2 + 2 + (11 + 7 * 2) * 8 + 4 * 2 + 2)
    # By k2 three of 8 lanes (add, mul, min), by k1 four of 2 (add, sub, sqrt, rsqrt14) and an fma; else all
    masked = 3 * 8 + 4 * 2 + 2 * 2
    assert flops("avx512") == 10 * ((8 + 16) * (1 + 1 + 1 + 1 + 2) + 2 * masked)


def test_a_wrong_count_is_told():
    functions = calibration.expected("calls", 1)
    functions["calls_inner"].load += 1
    edges = calibration.expected_edges("calls", 1)
    edges["calls_maybe"]["calls_inner"] = 4
    assert calibration.differences(functions, "calls", 1, edges) == [
        "calls, calls_inner, loaded: 289 instead of 288",
        "calls, calls by calls_maybe: {'calls_inner': 4} instead of {'calls_inner': 5}",
    ]
    assert "sse, sse_double, calls: 0 instead of 1" in calibration.differences({}, "sse", 1)


def test_this_machine_is_calibrated():
    assert blocks.calibrated()
    made = store.read_json(ROOT / "build/calibration/blocks.json")
    assert made["differences"] == []
    assert {"scalar", "sse", "string", "threads"} <= set(made["parts"])


# --- the code counted is the code shipped


def code(path: Path) -> dict[str, tuple[bytes, list]]:
    """Each text section's bytes and relocations, by what they refer to."""
    with path.open("rb") as file:
        elf = ELFFile(file)
        found = {}
        for section in elf.iter_sections():
            if not section.name.startswith(".text"):
                continue
            relocations = elf.get_section_by_name(f".rela{section.name}")
            rows = []
            if relocations:
                symbols = elf.get_section(relocations["sh_link"])
                for r in relocations.iter_relocations():
                    symbol = symbols.get_symbol(r["r_info_sym"])
                    where = symbol["st_shndx"]
                    name = symbol.name or elf.get_section(where).name
                    rows.append((r["r_offset"], r["r_info_type"], r["r_addend"], name))
            found[section.name] = section.data(), rows
        return found


def joined(name: str, plain: Path, folder: Path) -> Path:
    """Where the object of that name is: a variant's (rules.mk) is joined from its files' first."""
    parts = sorted(plain.glob(f"*-{name}"))
    if not parts:
        return plain / name
    out = folder / name
    for command in (
        ["ld", "-r", "-o", out, *parts],
        ["objcopy", "-w", f"--keep-global-symbol={out.stem}_*", out],
    ):
        subprocess.run([str(word) for word in command], check=True)
    return out


@pytest.mark.parametrize(("compiler", "phase"), PROGRAMS)
def test_the_code_counted_is_the_code_shipped(compiler, phase, tmp_path):
    folder = make(compiler, f"{phase}/phase.o", f"{phase}/blocks/phase.o") / phase
    left_out = {
        f"lanes{one.lanes}.o"
        for one in find_phase(phase).variants
        if not registry.cpu_flags().issuperset(one.isa)
    }
    shipped = sorted((folder / "objects").glob("*.o"))
    timed = left_out if compiler == "gcc" else set()  # clang's have only those that run (rules.mk)
    assert len(shipped) >= 3 and timed == left_out & {path.name for path in shipped}
    compared = 0
    for path in shipped:
        if path.name in left_out:  # counted where it runs (rules.mk): here it must not be there
            assert not list((folder / "blocks/plain").glob(f"*-{path.name}"))
            continue
        assert code(path) == code(joined(path.name, folder / "blocks/plain", tmp_path))
        compared += sum(len(data) for data, _ in code(path).values())
    assert compared > 4000


@functools.cache
def drawn(program: Path, scene: str, folder: Path) -> bytes:
    """The picture's file: a timing build's is wanted beside each of its counting builds'."""
    out = folder / "drawn.exr"
    command = [program, find_scene(scene).path, "-n", "24", "--aov", "-o", out]
    environment = os.environ | {run.UNTIMED: "1"}
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    return out.read_bytes()


@pytest.mark.parametrize(("variant", "compiler", "phase"), COUNTING)
def test_the_picture_is_the_timing_builds(tmp_path_factory, phase, variant, compiler):
    needs.cpu_for(phase)
    counting = blocks.TARGETS[variant]
    folder = make(compiler, f"{phase}/render", f"{phase}/{counting}") / phase
    for scene in ("scene0", "trio", "mandelbulb", "cubes"):
        timing, counted = (
            drawn(folder / target, scene, tmp_path_factory.getbasetemp()) for target in ("render", counting)
        )
        assert timing == counted, scene


# --- counts add up


@pytest.fixture(scope="module", params=PHASES)
def measured(request) -> dict[str, Measured]:
    needs.cpu_for(request.param)
    scene = find_scene("trio").path
    return {variant: blocks.measure(request.param, scene, 30, 54, variant=variant) for variant in VARIANTS}


@pytest.mark.parametrize("variant", VARIANTS)
def test_functions_are_the_total(measured, variant):
    one = measured[variant]
    assert one.calibrated is True
    total = Counts()
    for counts in one.functions.values():
        total.merge(counts)
    assert total == one.total
    assert sum(one.total.mix.values()) == one.total.instructions > 0


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_total_is_the_counters_times_the_bytes(measured, variant):
    """Instructions once more, from the raw counters, and with objdump's idea of an instruction."""
    one, target = measured[variant], blocks.TARGETS[variant]
    said = run.render(one.phase, find_scene("trio").path, 30, 54, target=target)
    folder = build(one.phase, target).parent / target.removeprefix("render-")
    table = store.read_json(folder / "table.json")
    lengths = {}  # (file, section, address) to an instruction's bytes
    for path in (folder / "plain").glob("*.o"):
        text = subprocess.check_output(["objdump", "-d", "-w", "--insn-width=16", path], text=True)
        section = ""
        for line in text.splitlines():
            if line.startswith("Disassembly of section "):
                section = line.split()[-1].rstrip(":")
            elif match := re.match(r" +([0-9a-f]+):\t((?:[0-9a-f]{2} )+)", line):
                lengths[path.stem, section, int(match[1], 16)] = len(match[2].split())
    instructions = 0
    for block, times in zip(table["blocks"], said["blocks"], strict=True):
        place, end = block["offset"], block["offset"] + len(block["bytes"]) // 2
        while place < end:
            place += lengths[Path(block["file"]).stem, block["section"], place]
            instructions += times
        assert place == end
    assert instructions == one.total.instructions


@pytest.mark.parametrize("variant", VARIANTS)
def test_two_runs_are_identical(measured, variant):
    one = measured[variant]
    again = blocks.measure(one.phase, find_scene("trio").path, 30, 54, variant=variant)
    assert again == one


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_call_has_a_caller(measured, variant):
    """Entries are counted at the callee, edges at the caller: the same number by other counters."""
    one = measured[variant]
    incoming: Counter[str] = Counter()
    for callees in one.edges.values():
        incoming.update(callees)
    pointed = by_pointer(one.phase)
    for name, counts in one.functions.items():
        if name in pointed:  # an indirect call, or one by common/workers, which is not counted
            assert counts.calls >= incoming[name], name
        else:
            assert counts.calls == (1 if name == "phase_render" else incoming[name]), name


def by_pointer(phase: str) -> set[str]:
    """Functions that the phase's sources use as values: names before no parenthesis, outside of comments."""
    texts = [path.read_text() for name, path in patches.files(phase).items() if name.endswith((".c", ".h"))]
    text = re.sub(r"//.*|^#.*|\bCOUNT\([^)]*\)", "", "\n".join(texts), flags=re.MULTILINE)
    defined = set(re.findall(r"^(?:static |inline |CALL )*(?:\w+ \**)+(\w+)\(", text, re.MULTILINE))
    return {name for name in defined if re.search(rf"[{{(,=?:\]]\s*{name}\s*[,;)}}]", text)}


def patches_drawn(phase: str) -> int:
    """Of the same picture: where the phase's plane `start` has one."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "picture.exr"
        run.render(phase, find_scene("trio").path, 30, 54, aov=True, out=out)
        return int((images.read(out)["start"][::8, ::8] >= 0).sum())


def test_a_ray_has_one_direction(measured, tmp_path):
    one = measured["calls"]
    phase = find_phase(one.phase)
    lanes = variant_here(phase).lanes
    wide, high = (4, lanes // 4) if phase.variants else (lanes, 1)  # pixels of a packet
    packets = -(-30 // high) * -(-54 // wide)
    rays = one.functions["get_direction"].calls
    if phase.exact_hits:  # a tile that no shape lies across has no rays
        seen = run.render(
            one.phase, find_scene("trio").path, 30, 54, aov=True, out=tmp_path / "seen.exr", timed=False
        )
        hit = np.pad(images.read(seen["image"])["id"] >= 0, ((0, -30 % high), (0, -54 % wide)))
        least = hit.reshape(-1, high, hit.shape[1] // wide, wide).any(axis=(1, 3)).sum()
        assert packets > rays >= least > packets / 2
    else:
        # patches of 8 × 8, but for those that meet nothing
        if phase.file("cones/tile_cones.h").exists():
            packets = patches_drawn(phase.name) * (8 // high) * (8 // wide)
        elif phase.variants:  # in groups of four, and a tile's last one is filled with packets of no pixel
            tiles = itertools.product((8, 8, 8, 30 % 8), (32, 54 % 32))
            packets = sum(-(-(-(-down // high) * -(-across // wide)) // 4) * 4 for down, across in tiles)
        assert rays == packets
    callers = [callees["get_direction"] for callees in one.edges.values() if "get_direction" in callees]
    assert callers == [rays]
    assert one.functions["phase_render"].calls == 1


def test_only_the_timed_region_counts(measured):
    for one in measured.values():
        assert not {"main", "phase_prepare", "phase_release", "phase_unsupported"} & one.functions.keys()


def test_a_measurement_survives_json(measured):
    for one in measured.values():
        assert Measured.from_json(json.loads(json.dumps(one.to_json()))) == one


@pytest.mark.skipif(
    qemu.available() is not None, reason=f"{qemu.EMULATOR} is missing: counts are not held against emulation"
)
@pytest.mark.parametrize("phase", PHASES)
def test_an_emulator_counts_the_same(phase, monkeypatch):
    """QEMU runs the timing build itself and counts by another mechanism: every number of every function."""
    needs.cpu_for(phase)
    monkeypatch.setenv("STEPWISE_ISA_LIMIT", "avx2")  # it has no AVX-512
    scene = find_scene("trio").path
    own, other = blocks.measure(phase, scene, 12), qemu.measure(phase, scene, 12)
    pool = {
        "workers_run",
        "draw_tiles",
        "take_tiles",
    }  # of common/workers: only the emulator sees it
    assert own.functions.keys() == other.functions.keys() - pool
    for name, counts in own.functions.items():
        seen = other.functions[name]
        assert calibration.flat(counts) == calibration.flat(seen), name

    def edges(measured: Measured) -> dict[str, dict[str, int]]:
        """Calls from the phase's functions to the phase's functions."""
        found = {
            caller: {callee: n for callee, n in callees.items() if callee in own.functions}
            for caller, callees in measured.edges.items()
            if caller in own.functions
        }
        return {caller: callees for caller, callees in found.items() if callees}

    assert edges(own) == edges(other)


# --- reading assembly; what is expected is told from the text


HEAD = "\t.text\n\t.globl f\n\t.type f, @function\n"


def read(tmp_path: Path, text: str) -> Source:
    path = tmp_path / "f.s"
    path.write_text(HEAD + text)
    return Source(path, 0)


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
    source.locate(obj, Disassembler())
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
    source = read(tmp_path, f"f:\n{text}.L9:\n\tret\n")
    source.locate(assembly._assemble(["gcc"], source.marked(), tmp_path, "plain"), Disassembler())
    assert overwrites_flags(source.blocks[0].code, source.blocks[0].offset) is flags_free


def test_a_prefix_stays_with_its_instruction(tmp_path):
    """clang writes rep;movsq: between the two a counter would be repeated, and the copy would not."""
    source = read(tmp_path, "f:\n\trep;movsq (%rsi), %es:(%rdi)\n\tret\n")
    assert shapes(source) == [("f", True, 2)]
    source.locate(assembly._assemble(["gcc"], source.marked(), tmp_path, "plain"), Disassembler())
    assert [one.repeat for one in source.blocks[0].decoded] == [True, False]


@pytest.mark.parametrize(
    "text, said",
    [
        ("f:\n\tjmp .+4\n", "f.s:5: a jump by distance, not to a label: 'jmp .+4' cannot be counted"),
        ("f:\n\t.rept 3\n\tnop\n\t.endr\n\tret\n", "assembler repetitions hide instructions"),
        ("\tnop\n", "code outside any function (`.type NAME, @function` and a label make one)"),
        ("f:\n\tnop\n\t.byte 0xeb, 0\n\tret\n", "f.s:6: bytes written by hand: '.byte 0xeb, 0'"),
        ("f:\n\trep\n\t.data\n", "a prefix without an instruction"),
    ],
)
def test_what_cannot_be_counted_is_refused(tmp_path, text, said):
    with pytest.raises(StudyError) as refused:
        read(tmp_path, text)
    assert said in str(refused.value)


def test_data_between_functions_is_no_code(tmp_path):
    source = read(tmp_path, "f:\n\tjmp *.L4(,%rdi,8)\n.L4:\n\t.quad .L5\n.L5:\n\tret\n")
    source.locate(assembly._assemble(["gcc"], source.marked(), tmp_path, "plain"), Disassembler())
    assert [[one.mnemonic for one in b.decoded] for b in source.blocks] == [["jmp"], ["ret"]]


def test_a_block_that_decodes_otherwise_is_refused(tmp_path):
    """What the assembler makes of the text is held against it: here the text is another one."""
    source = read(tmp_path, "f:\n\tnop\n\tnop\n\tret\n")
    other = source.marked().replace("\tnop\n\tnop", "\tnop")
    with pytest.raises(StudyError, match=r"f\.s:5: 2 instructions decoded where the assembly has 3"):
        source.locate(assembly._assemble(["gcc"], other, tmp_path, "plain"), Disassembler())


def test_an_object_without_symbols_is_refused(tmp_path):
    source = read(tmp_path, "f:\n\tret\n")
    obj = assembly._assemble(["gcc"], source.marked(), tmp_path, "plain")
    subprocess.run(["strip", str(obj)], check=True)
    with pytest.raises(StudyError, match="block 0 has no symbol; do not strip it"):
        source.locate(obj, Disassembler())


def test_an_alias_is_the_function_it_stands_for(tmp_path):
    (tmp_path / "f.s").write_text(HEAD + "f:\n\tcall h\n\tret\n\t.type g, @function\ng:\n\tret\n\t.set h,g\n")
    assembly.instrument(["gcc"], [tmp_path / "f.s"], tmp_path / "out")
    table = blocks.read_table(tmp_path / "out/table.json")
    assert table.calls == [(0, "g", None)]
    assert [(b.symbol, b.entry) for b in table.blocks] == [("f", True), ("f", False), ("g", True)]


def test_the_tool_says_in_one_line_what_is_wrong(tmp_path):
    """As make calls it. A loop instruction reaches 127 bytes; nothing is left that looks whole."""
    path = tmp_path / "f.s"
    path.write_text(HEAD + "f:\n.L2:\n" + "\tcall g\n" * 20 + "\tloop .L2\n\tret\n")
    command = [
        sys.executable,
        "-m",
        "study.counting.assembly",
        "--cc",
        "gcc",
        str(tmp_path / "out"),
        str(path),
    ]
    environment = os.environ | {"PYTHONPATH": str(ROOT / "scripts")}
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == BAD_INPUT
    (line,) = done.stderr.splitlines()
    assert "counted/f.s: cannot be assembled: " in line
    assert not (tmp_path / "out/table.json").exists()


def test_a_part_split_off_is_its_function_and_no_call():
    """f does its rest in f.part.0; g calls a copy of f made for it."""
    code = tuple(Disassembler().decode(b"\xc3"))
    symbols = ["f", "f.part.0", "g", "f.constprop.1"]
    made = [blocks.Block(symbol, True, code) for symbol in symbols]
    table = blocks.Table(Path("t"), "h", made, [(0, "f.part.0", None), (2, "f.constprop.1", None)], {}, {})
    said = {"counts": "basic blocks", "table": "h", "blocks": [5, 3, 7, 7], "masked": [], "repeated": []}
    total, functions, edges = blocks.evaluate(table, said)
    assert {name: (c.calls, c.instructions) for name, c in functions.items()} == {"f": (12, 15), "g": (7, 7)}
    assert edges == {"g": {"f": 7}}
    assert total.calls == 19


# --- bad input


@pytest.fixture(scope="module")
def counted() -> tuple[Path, dict]:
    """The baseline's table and what its program printed."""
    said = run.render("baseline", find_scene("two_spheres").path, 8, target="render-blocks")
    return build("baseline", "render-blocks").parent / "blocks/table.json", said


def test_what_the_program_says_is_accepted(counted):
    path, said = counted
    total, functions, _ = blocks.evaluate(blocks.read_table(path), said)
    assert total.instructions > 0
    assert functions["phase_render"].calls == 1


@pytest.mark.parametrize(
    "change, text",
    [
        (lambda s: s.pop("counts"), "printed no counts of basic blocks"),
        (lambda s: s.update(table="0" * 64), "not the table of the program that ran; build it again"),
        (lambda s: s["blocks"].pop(), "counters are described, the program has"),
        (lambda s: s.update(blocks=None), "the program has no"),
        (lambda s: s["blocks"].__setitem__(0, -1), "a counter says -1, which cannot be"),
        (lambda s: s["blocks"].__setitem__(0, 1 << 63), "which cannot be: overflow, or a stray write"),
        (lambda s: s["blocks"].__setitem__(0, 1.5), "a counter says 1.5"),
    ],
)
def test_counts_that_cannot_be_are_refused(counted, change, text):
    path, said = counted
    said = copy.deepcopy(said)
    change(said)
    with pytest.raises(StudyError) as refused:
        blocks.evaluate(blocks.read_table(path), said)
    assert text in str(refused.value)
    assert refused.value.exit_status == BAD_INPUT


def test_more_lanes_than_there_are_is_refused():
    folder = build("calibration", "calibrate-blocks").parent
    table = blocks.read_table(folder / "blocks/table.json")
    (block, place), slot = next(iter(table.masked.items()))
    lanes = table.blocks[block].code[place].lanes
    said = {"counts": "basic blocks", "table": table.hash}
    said |= {"blocks": [0] * len(table.blocks), "masked": [0] * len(table.masked)}
    said["repeated"] = [0] * len(table.repeated)
    said["blocks"][block], said["masked"][slot] = 2, 2 * lanes
    blocks.evaluate(table, said)
    said["masked"][slot] += 1
    with pytest.raises(StudyError, match=rf"{2 * lanes + 1} lanes in 2 executions of .*, which cannot be"):
        blocks.evaluate(table, said)


def test_a_table_that_is_none_is_refused(counted, tmp_path):
    path, _ = counted
    text = path.read_text()
    broken = tmp_path / "table.json"
    for content, said in [
        (text[: len(text) // 2], r"table\.json:\d+:\d+: "),
        ("[1, 2]", "not a block table of"),
        ('{"hash": 1}', "was changed since it was made"),
        (text.replace('"entry": true', '"entry": false', 1), "was changed since it was made"),
    ]:
        broken.write_text(content)
        with pytest.raises(StudyError, match=said):
            blocks.read_table(broken)
    broken.unlink()
    with pytest.raises(StudyError, match="No such file"):
        blocks.read_table(broken)


def test_an_unknown_variant_is_refused():
    with pytest.raises(StudyError, match="no variant 'inlined'; there are shipped, calls"):
        blocks.measure("baseline", find_scene("trio").path, 8, variant="inlined")


def test_a_crash_while_counting_is_a_drivers_error(tmp_path, monkeypatch):
    program = tmp_path / "render-blocks"
    program.write_text('#!/bin/sh\nprintf \'{"counts": "basic blocks"\'\nkill -SEGV $$\n')
    program.chmod(0o755)
    monkeypatch.setattr(run, "build", lambda spec, target="render": program)
    with pytest.raises(DriverError, match="killed by SIGSEGV") as crashed:
        blocks.measure("baseline", find_scene("trio").path, 8)
    assert crashed.value.status == -11


def test_a_phase_that_refuses_is_heard():
    scene = find_scene("trio").path
    with pytest.raises(DriverError, match="runs on one thread"):
        blocks.measure("baseline", scene, 8, threads=2)
