"""What bounds the hot code: loops found in the disassembly, analysers' output, known chains, Table 3."""

import dataclasses
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from study.bounds import mca, regions
from study.bounds import topdown as bounds
from study.bounds.profiles import Sampled
from study.bounds.regions import Region
from study.bounds.schema import Hotspots, Mca, Profiled, Share
from study.core.cli import StudyError
from study.core.run_schema import Cpu
from study.counting import elf
from study.experiments.hotspots import bounds_tables as bounds_page

FIXTURES = Path(__file__).parents[2] / "fixtures" / "bounds"
MCA = (FIXTURES / "llvm-mca.txt").read_text()
needs_mca = pytest.mark.skipif(mca.model() is None, reason=mca.MISSING)

# A loop in a loop, then a loop around a switch of three cases, one of which returns.
NEST = """
        .text
        .globl  nest
        .type   nest, @function
nest:   xorl    %eax, %eax
outer:  movl    $3, %ecx
inner:  addsd   %xmm1, %xmm0
        decl    %ecx
        jne     inner
        decl    %edi
        jne     outer
again:  movl    (%rsi), %edx
        notrack jmp *%rdx
case0:  mulsd   %xmm0, %xmm0
        jmp     merge
case1:  call    other@PLT
        testl   %eax, %eax
        jne     merge
        ret
case2:  divsd   %xmm1, %xmm0
        jmp     merge
merge:  incq    %rsi
        rep movsq
        cmpl    $5, %eax
        jne     again
        ret
        .size   nest, .-nest
"""


@pytest.fixture(scope="module")
def nest(tmp_path_factory):
    """The lines of NEST, assembled and taken apart again, and the addresses of its labels."""
    folder = tmp_path_factory.mktemp("nest")
    (folder / "nest.s").write_text(NEST)
    subprocess.run(["gcc", "-c", folder / "nest.s", "-o", folder / "nest.o"], check=True)
    symbols = subprocess.run(["nm", folder / "nest.o"], check=True, capture_output=True, text=True).stdout
    labels = {
        name: int(value, 16)
        for value, _, name in (line.split() for line in symbols.splitlines() if line[0] == "0")
    }
    command = ["objcopy", "-O", "binary", "-j", ".text", folder / "nest.o", folder / "code"]
    subprocess.run(command, check=True)
    return regions.disassemble((folder / "code").read_bytes(), 0), labels


def test_loops_of_a_known_nest(nest):
    lines, at = nest
    loops = regions.loops_of(regions.blocks_of(lines))
    assert set(loops) == {at["outer"], at["inner"], at["again"]}
    assert loops[at["inner"]] == {at["inner"]}
    assert loops[at["outer"]] > loops[at["inner"]]
    assert {at["case0"], at["case1"], at["case2"], at["merge"]} <= loops[at["again"]]
    assert at["outer"] not in loops[at["again"]] and at["nest"] not in loops[at["outer"]]
    # The return inside the switch leaves the loop.
    returns = [line.address for line in lines if line.mnemonic.startswith("ret")]
    members = [line.address for block in loops[at["again"]] for line in regions.blocks_of(lines)[block]]
    assert not set(returns) & set(members)


def test_every_instruction_is_in_one_block(nest):
    lines, _ = nest
    blocks = regions.blocks_of(lines)
    assert [line for block in blocks.values() for line in block] == lines
    assert all(line.ends_block is False for block in blocks.values() for line in block[:-1])


def test_samples_go_to_their_innermost_loop(nest, monkeypatch):
    lines, at = nest
    monkeypatch.setattr(regions, "disassemble", lambda *_: lines)
    built = elf.Program(Path("x"), [elf.Function("nest.isra.0", 0, 0x1000)], [])
    weights = {at["inner"]: 60, at["outer"]: 10, at["case0"]: 20, at["merge"]: 10}
    found = regions.regions(profile_of(weights), built)
    assert [(region.address, region.share) for region in found] == [
        (at["inner"], 0.6),
        (at["again"], 0.3),
        (at["outer"], pytest.approx(0.1)),
    ]
    assert found[0].function == "nest" and found[0].loop
    # The case without a sample is not on the path.
    assert "mulsd" in regions.assembly(found[1].lines) and not any(line.is_call for line in found[1].lines)


def profile_of(weights: dict[int, int]) -> Sampled:
    total = sum(weights.values())
    about = {"phase": "opt2", "flags_from": "opt2", "variant": "shipped", "scene": "scene0", "width": 2}
    about |= {"height": 1, "event": "cpu-clock", "frames": 1, "frame_ns": 1e6, "cpu_ns": 1e6}
    about |= {"core_cycles": 3000.0, "samples": total, "weight": total, "covered": 1.0, "left_out": {}}
    functions = [Share(function="nest", samples=total, weight=total)]
    return Sampled(Profiled(**about, functions=functions), weights)


def test_an_analyser_gets_no_calls_returns_or_padding(nest):
    lines, _ = nest
    text = regions.assembly(lines)
    assert "call" not in text and "ret" not in text and "*%rdx" not in text
    assert text.count("\tjne\t.Lhere") == 4 and "addsd\t%xmm1,%xmm0" in text
    assert "\trep movsq" in text  # a string instruction stays one


# --- llvm-mca's output


def test_recorded_llvm_mca():
    found = mca.parse(MCA)
    assert (found.cycles, found.uops, found.width, found.block) == (1209, 400, 6, 12)
    assert (found.resources, found.registers, found.memory) == (0.5947, 0.5443, 0)


@pytest.mark.parametrize(
    "text",
    ["", "error: no target\n", MCA[:40], MCA.replace("Iterations:        100", "Iterations: 7")],
)
def test_broken_llvm_mca_is_refused(text):
    with pytest.raises(StudyError, match="llvm-mca: "):
        mca.parse(text)


# --- known code

# Latency 4, two a cycle: A. Fog, Instruction tables, Skylake, ADDPD.
CHAIN = ".Lhere:\n" + "\tvaddpd\t%ymm1, %ymm0, %ymm0\n" * 8
APART = ".Lhere:\n" + "".join(f"\tvaddpd\t%ymm1, %ymm1, %ymm{i}\n" for i in range(2, 10))


def run(text: str) -> Mca:
    """By the model of Skylake, whatever CPU this is."""
    found = mca.model()
    assert found
    return mca.run(text, dataclasses.replace(found, cpu="skylake"))


@needs_mca
def test_a_chain_takes_its_latency_and_the_rest_its_ports():
    chain, apart = run(CHAIN), run(APART)
    assert chain.throughput == pytest.approx(8 * 4, rel=0.02)
    assert apart.throughput == pytest.approx(8 / 2, rel=0.02)
    assert chain.split.dependencies > 0.9 > 0.5 > apart.split.dependencies
    assert chain.latency >= 8 * 4 > apart.latency


@needs_mca
def test_the_stack_is_no_chain():
    """Ten pushes and pops are ten stores and ten loads: one store a cycle, far from ten loads in a row."""
    code = [regions.Line(i, "push" if i < 10 else "pop", f"%r{8 + i % 8}") for i in range(20)]
    made = run(regions.assembly(code))
    assert 9 <= made.throughput < 20
    pushed = regions.assembly([regions.Line(0, "push", "0x38(%rsp)")]).split()
    assert pushed == [".Lhere:", "movq", "0x38(%rsp),", "%r11", "movq", "%r11,", "-8(%rsp)"]


@needs_mca
def test_code_that_is_none_is_refused():
    with pytest.raises(StudyError, match="llvm-mca: "):
        run("\tnonsense %ymm0\n")


def made_up(
    throughput: float, latency: float, uops: float, resources: float, registers: float, memory: float
) -> Mca:
    about = {"throughput": throughput, "latency": latency, "uops": uops, "block_throughput": 1, "width": 6}
    made = Mca(**about, resources=resources, registers=registers, memory=memory)
    made.split = mca.split(made)
    return made


share = st.floats(0, 1)


@given(share, share, share, st.floats(0.1, 1000), st.floats(0.1, 1000))
def test_the_split_is_everything(resources, registers, memory, uops, cycles):
    made = mca.split(made_up(cycles, cycles, uops, resources, registers, memory))
    assert made.retiring + made.memory + made.core == pytest.approx(1)
    assert made.ports + made.dependencies == pytest.approx(made.core)
    shares = (made.retiring, made.memory, made.core, made.ports, made.dependencies)
    assert all(-1e-9 <= value <= 1 + 1e-9 for value in shares)


@pytest.mark.parametrize(
    ("release", "host", "flags", "chosen", "guessed"),
    [
        (14, "icelake-server", ["avx512f"], "icelake-server", False),
        (18, "generic", ["avx2", "avx512f"], "skylake-avx512", True),  # of an older LLVM than its CPU
        (18, "x86-64-v3", ["avx2"], "haswell", True),
        (18, "(unknown)", [], "sandybridge", True),
    ],
)
def test_the_newest_models_this_cpu_or_the_nearest(
    monkeypatch, tmp_path, release, host, flags, chosen, guessed
):
    for number in (11, release):
        tool = tmp_path / f"llvm-mca-{number}"
        tool.write_text(f"#!/bin/sh\necho '  LLVM version {number}.0.6'\necho '  Host CPU: {host}'\n")
        tool.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}")
    monkeypatch.setattr(mca.machine, "cpu", lambda: Cpu(flags=flags))
    assert mca.model.__wrapped__() == mca.Model(str(tool), release, chosen, guessed)
    monkeypatch.setenv("PATH", "/nowhere")
    assert mca.model.__wrapped__() is None


# --- Table 3


def regions_of(lines: list[regions.Line]) -> list[Region]:
    return [Region("nest", 16, True, lines, 0.75), Region("nest", 0, False, lines, 0.15)]


def test_prediction_against_measurement(nest, monkeypatch):
    """Counts and cycles by hand: 0.9 of 3000 cycles for 1000 instructions."""
    lines, _ = nest
    monkeypatch.setattr(bounds, "regions", lambda *_: regions_of(lines))
    monkeypatch.setattr(mca, "model", lambda: mca.Model("llvm-mca", 14, "haswell"))
    monkeypatch.setattr(mca, "run", lambda *_: made_up(20, 60, 60, 0.3, 0.1, 0.1))
    made = bounds.model(profile_of({0: 1}), None, {"nest": 1000})
    count, compared = made.regions[0].instructions, made.compared
    assert count == regions.assembly(lines).count("\n") - 1
    assert compared.measured == pytest.approx(2700) and compared.share == pytest.approx(0.9)
    assert compared.throughput == pytest.approx(1000 / (count / 20))
    assert compared.latency == pytest.approx(3 * compared.throughput)
    assert made.regions[0].measured == pytest.approx(2.7 * count)
    # 60 of 6 × 20 slots retire; the other half goes by blame, 3 : 1 : 1.
    parts = made.split
    shares = (parts.retiring, parts.memory, parts.core, parts.ports, parts.dependencies)
    assert shares == pytest.approx((0.5, 0.1, 0.4, 0.3, 0.1))
    assert made.covered == pytest.approx(0.9)
    row = bounds_page.rows(Hotspots(bounds=[made]))[0]
    assert row["predicted_over_measured"] == pytest.approx(compared.throughput / 2700)


def test_without_the_tool_one_line_and_the_rest_stays(nest, monkeypatch):
    lines, _ = nest
    monkeypatch.setattr(bounds, "regions", lambda *_: regions_of(lines))
    monkeypatch.setattr(mca, "model", lambda: None)
    said: list[str] = []
    made = bounds.model(profile_of({0: 1}), None, None, said.append)
    assert said == [mca.MISSING]
    assert made.split is None and [one.share for one in made.regions] == [0.75, 0.15]
    assert made.regions[0].measured is None and made.compared is None


def test_what_an_analyser_refuses_is_one_line_with_its_count(nest, monkeypatch):
    """Two regions of 0.75 and 0.15 of the time, both refused for the same instruction."""
    lines, _ = nest
    monkeypatch.setattr(bounds, "regions", lambda *_: regions_of(lines))
    monkeypatch.setattr(mca, "model", lambda: mca.Model("llvm-mca", 14, "haswell"))

    def refuse(*_: object) -> None:
        raise StudyError("llvm-mca: error: found an unsupported instruction")

    monkeypatch.setattr(mca, "run", refuse)
    said: list[str] = []
    made = bounds.model(profile_of({0: 1}), None, None, said.append)
    (line,) = said
    assert "2 of 2 regions, 90%" in line and made.split is None and len(made.regions) == 2


def test_the_papers_table_is_beside():
    structs, arrays = bounds_page.rows(Hotspots())
    # Table 3: structs 31, 10, 18, 41 % in 13 s; arrays 23, 5, 16, 52 % in 10 s.
    assert [structs[f"{k}_share"] for k in ("front_end", "memory", "core", "retiring")] == [
        0.31,
        0.1,
        0.18,
        0.41,
    ]
    assert [arrays[f"{k}_share"] for k in ("front_end", "memory", "core", "retiring")] == [
        0.23,
        0.05,
        0.16,
        0.52,
    ]
    assert (structs["milliseconds"], arrays["milliseconds"]) == (13000, 10000)


@pytest.mark.slow
def test_the_hot_loop_of_arrays_is_found():
    """In the real program: the loop over shapes in opt2's sdf, which takes square roots."""
    from study.core.build import build
    from study.core.registry import ROOT

    path = build("opt2", "render-lines")
    built = elf.read(path, ROOT / "build/opt2/lines/phase.o")
    sdf = built.find("sdf")
    blocks = regions.blocks_of(regions.disassemble(built.code_of(sdf), sdf.start))
    loops = regions.loops_of(blocks)
    assert any(
        any(line.mnemonic == "sqrtsd" for block in body for line in blocks[block]) for body in loops.values()
    )
