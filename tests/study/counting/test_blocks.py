"""Block counters: known work exactly, the shipped code byte for byte, its picture, counts that add up."""

import copy
import functools
import json
import os
import re
import subprocess
from collections import Counter
from pathlib import Path

import msgspec
import needs
import programs
import pytest
from elftools.elf.elffile import ELFFile

from builds import COUNTED, COUNTED_BY_CLANG
from study.core import patches, registry, run
from study.core.build import build
from study.core.cli import StudyError
from study.core.registry import ROOT, Spec, find_phase, find_scene, variant_here
from study.core.run import DriverError
from study.counting import assembly, backend, blocks, calibration
from study.counting.counts import Counts
from study.counting.schema import Measurement

pytestmark = pytest.mark.slow

COMPILERS = {"gcc": "build", "clang": "build/clang"}
# One phase of each kind; clang counts fewer (tests/builds.py).
PHASES = COUNTED
PROGRAMS = [("gcc", phase) for phase in PHASES] + [("clang", phase) for phase in COUNTED_BY_CLANG]
# Without inlining all but the last, which takes longest and whose calls are those of opt6's kind.
VARIANTS = [*((phase, one) for phase in PHASES[:-1] for one in blocks.TARGETS), (PHASES[-1], "shipped")]
COUNTING = [("gcc", *pair) for pair in VARIANTS]
COUNTING += [("clang", phase, one) for phase in COUNTED_BY_CLANG for one in blocks.TARGETS]
REPEATS = 3


def make(compiler: str, *targets: str) -> Path:
    """The compiler's folder, with these built in it."""
    for target in targets:
        programs.built(target, COMPILERS[compiler])
    return ROOT / COMPILERS[compiler]


# --- known work


@pytest.fixture(scope="module", params=COMPILERS)
def calibrate(request):
    """Runs a part of the known work with counted blocks: total, functions, edges."""
    folder = make(request.param, "calibration/calibrate-blocks") / "calibration"
    table = blocks.read_table(folder / "blocks" / "table.json")

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


def test_a_wrong_count_is_told():
    functions = calibration.expected("calls", 1)
    functions["calls_inner"].load += 1
    edges = calibration.expected_edges("calls", 1)
    edges["calls_maybe"]["calls_inner"] = 4
    loaded, called = calibration.differences(functions, "calls", 1, edges)
    assert "calls_inner, loaded: 289" in loaded and "calls_maybe: {'calls_inner': 4}" in called
    assert any(line.startswith("sse, sse_double, ") for line in calibration.differences({}, "sse", 1))


def test_this_machine_is_calibrated():
    assert blocks.calibrated()
    assert {"scalar", "sse", "string", "threads"} <= set(calibration.runnable())


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


@pytest.mark.parametrize(("compiler", "phase"), PROGRAMS)
def test_the_code_counted_is_the_code_shipped(compiler, phase):
    folder = make(compiler, f"{phase}/phase.o", f"{phase}/blocks/phase.o") / phase
    lacking = tuple(
        f"-lanes{one.lanes}.o"
        for one in find_phase(phase).variants
        if not registry.cpu_flags().issuperset(one.isa)
    )
    shipped = sorted((folder / "objects").glob("*.o"))
    idle = [path for path in shipped if path.name.endswith(lacking)]
    assert len(shipped) >= 3 and bool(idle) == bool(lacking and compiler == "gcc")  # clang's have what runs
    assert not any((folder / "blocks/plain" / path.name).exists() for path in idle)  # counted where it runs
    compared = 0
    for path in shipped:
        if path not in idle:
            assert code(path) == code(folder / "blocks/plain" / path.name)
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


@pytest.mark.parametrize(("compiler", "phase", "variant"), COUNTING)
def test_the_picture_is_the_timing_builds(tmp_path_factory, phase, variant, compiler):
    needs.cpu_for(phase)
    counting = blocks.TARGETS[variant]
    folder = make(compiler, f"{phase}/render", f"{phase}/{counting}") / phase
    for scene in ("trio", "mandelbulb"):
        timing, counted = (
            drawn(folder / target, scene, tmp_path_factory.getbasetemp()) for target in ("render", counting)
        )
        assert timing == counted, scene


# --- counts add up


@pytest.fixture(scope="module", params=VARIANTS, ids="-".join)
def measured(request) -> Measurement:
    phase, variant = request.param
    needs.cpu_for(phase)
    return blocks.measure(Spec(phase, phase), find_scene("trio"), 30, variant, width=54)


def test_functions_are_the_total_of_the_timed_region(measured):
    assert measured.calibrated is True
    total = Counts.total(map(Counts.of, measured.functions.values()))
    assert total.executed() == measured.total and measured.total.instructions > 0
    assert not {"main", "phase_prepare", "phase_release", "phase_unsupported"} & measured.functions.keys()
    again = msgspec.json.decode(msgspec.json.encode(measured), type=Measurement)
    assert again == measured


def test_the_total_is_the_counters_times_the_bytes(measured):
    """Instructions once more, from the raw counters, and with objdump's idea of an instruction."""
    one, target = measured, blocks.TARGETS[measured.variant]
    said = run.render(one.phase, find_scene("trio").path, 30, 54, target=target)
    folder = build(one.phase, target).parent / target.removeprefix("render-")
    table = msgspec.json.decode((folder / "table.json").read_bytes(), type=assembly.Table)
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
    for block, times in zip(table.blocks, said["blocks"], strict=True):
        place, end = block.offset, block.offset + len(block.bytes) // 2
        while place < end:
            place += lengths[Path(block.file).stem, block.section, place]
            instructions += times
        assert place == end
    assert instructions == one.total.instructions


def test_every_call_has_a_caller(measured):
    """Entries are counted at the callee, edges at the caller: the same number by other counters."""
    one = measured
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


def test_a_camera_ray_has_one_direction(measured):
    """Where it is not inlined: one call for each packet of pixels, from one caller."""
    one = measured
    if one.variant != "calls":
        return
    phase = find_phase(one.phase)
    lanes = variant_here(phase).lanes
    calls = one.functions["get_direction"].calls
    assert [c["get_direction"] for c in one.edges.values() if "get_direction" in c] == [calls]
    assert one.functions["phase_render"].calls == 1
    if not phase.variants:
        assert calls == 30 * -(-54 // lanes)


# --- bad input


@pytest.fixture(scope="module")
def counted() -> tuple[Path, dict]:
    """The baseline's table and what its program printed."""
    said = run.render("baseline", find_scene("two_spheres").path, 8, target="render-blocks")
    return build("baseline", "render-blocks").parent / "blocks" / "table.json", said


@pytest.mark.parametrize(
    "change",
    [
        lambda s: s.pop("counts"),
        lambda s: s.update(table="0" * 64),
        lambda s: s.update(blocks=None),
    ],
)
def test_counts_that_cannot_be_are_refused(counted, change):
    path, said = counted
    _, functions, _ = blocks.evaluate(blocks.read_table(path), said)
    assert functions["phase_render"].calls == 1
    said = copy.deepcopy(said)
    change(said)
    with pytest.raises(StudyError, match=str(path)):
        blocks.evaluate(blocks.read_table(path), said)


def test_a_phase_that_refuses_is_heard():
    with pytest.raises(DriverError, match="one thread"):
        blocks.measure(Spec("baseline", "baseline"), find_scene("trio"), 8, threads=2)


def test_known_work_is_counted_again_when_a_file_changes(tmp_path):
    counted: list[str] = []
    path = tmp_path / "program"

    def known(text: str) -> bool:
        path.write_text(text)
        wrong = ["off by one"] if text == "wrong" else []
        return backend.known_work(
            tmp_path / "known.json", [path], ["sse"], lambda p: counted.append(p) or wrong
        )

    assert known("a") and known("a") and len(counted) == 1
    assert not known("wrong") and not known("wrong") and len(counted) == 3
