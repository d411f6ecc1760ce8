"""Which of a phase's variants each program has: all where it is timed, else what this CPU runs (rules.mk)."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest

from study.core import registry
from study.core.build import build
from study.core.registry import ROOT

pytestmark = pytest.mark.slow

PHASE = "opt6_wide"
COUNTS = ("flops", "by_function", "by_class", "executed", "useful")  # of flops.c
VARIANTS = {f"lanes{one.lanes}": set(one.isa) for one in registry.find_phase(PHASE).variants}


def instructions(program: Path, name: str) -> list[str]:
    """Of a function: its instructions as objdump writes them."""
    command = ["objdump", "-d", "--no-show-raw-insn", f"--disassemble={name}", program]
    text = subprocess.check_output([str(word) for word in command], text=True)
    return re.findall(r"^ +[0-9a-f]+:\t(\S+)", text, re.MULTILINE)


@pytest.mark.parametrize("target", ["render", "render-count", "render-blocks"])
@pytest.mark.parametrize("variant", VARIANTS)
def test_a_variant_is_there_or_traps(variant: str, target: str) -> None:
    found = instructions(build(PHASE, target), f"{variant}_tile")
    if target == "render" or VARIANTS[variant] <= registry.cpu_flags():
        assert found and "ud2" not in found
    else:
        assert found == ["ud2"]


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A tree of its own, with one phase."""
    for name in ("common", "scripts/study", f"phases/{PHASE}"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(["cp", "-r", ROOT / name, tmp_path / name], check=True)
    (tmp_path / "Makefile").write_text("include common/rules.mk\n")
    return tmp_path


def make(tree: Path, compiler: str, target: str) -> subprocess.CompletedProcess[str]:
    words = ["make", "-s", "-C", str(tree), f"CC={compiler}", f"BUILD=build/{compiler}"]
    return subprocess.run([*words, f"build/{compiler}/{PHASE}/{target}"], capture_output=True, text=True)


def test_counting_sources_of_every_variant_are_compiled_or_read_and_a_warning_ends_it(tree: Path) -> None:
    """As tests/builds.py has it made, where one variant has a fault."""
    source = tree / "phases" / PHASE / "march/march.c"  # the first of those that each variant has
    kept = source.read_text()
    for compiler in ("gcc", "clang"):
        good = make(tree, compiler, "count/read")
        assert good.returncode == 0, good.stderr
    for variant, isa in VARIANTS.items():
        lanes = variant.removeprefix("lanes")
        fault = f"#if defined STEPWISE_COUNT && LANES == {lanes}\nstatic int unused_here;\n#endif\n"
        for compiler in ("gcc", "clang"):
            read = compiler == "clang" or not isa <= registry.cpu_flags()
            source.write_text(kept + fault)
            done = make(tree, compiler, "count/read" if read else "count/phase.o")
            assert done.returncode != 0 and "unused_here" in done.stderr, (variant, compiler)


# What parsing finds, and what only making code does: an instruction that the flags do not allow.
FAULTS = {
    "unused_here": "static int unused_here;",
    "vpopcntdq": "void VARIANT(beyond)(__m512i *a);\n"
    "void VARIANT(beyond)(__m512i *a) { *a = _mm512_popcnt_epi32(*a); }",
}


@pytest.mark.parametrize("said", FAULTS)
def test_clang_builds_or_reads_every_variant_and_a_fault_ends_it(tree: Path, said: str) -> None:
    source = tree / "phases" / PHASE / "march/march.c"
    kept = source.read_text()
    for variant, isa in VARIANTS.items():
        lanes = variant.removeprefix("lanes")
        target = "phase.o" if isa <= registry.cpu_flags() else "read"
        source.write_text(f"{kept}#if LANES == {lanes}\n{FAULTS[said]}\n#endif\n")
        done = make(tree, "clang", target)
        assert done.returncode != 0 and said in done.stderr, (variant, done.stderr)


def test_what_clang_makes_has_the_variants_of_this_cpu() -> None:
    """And what it leaves out it has read: both are made before (tests/builds.py)."""
    for target in ("render", "read"):
        assert make(ROOT, "clang", target).returncode == 0
    for variant, isa in VARIANTS.items():
        found = instructions(ROOT / "build/clang" / PHASE / "render", f"{variant}_tile")
        assert found and ("ud2" in found) == (not isa <= registry.cpu_flags())


def test_counts_are_the_sources_at_any_level_of_optimization(tree: Path) -> None:
    """render-count is compiled with -O1 (rules.mk): as its phase is timed, it counts the same."""
    rules = tree / "common/rules.mk"
    text = rules.read_text()
    assert text.count("--more='-O1 $(COUNTING)'") == 1
    rules.write_text(text.replace("--more='-O1 $(COUNTING)'", "--more='$(COUNTING)'"))
    done = make(tree, "gcc", "render-count")
    assert done.returncode == 0, done.stderr
    for scene in ("scene0", "mandelbulb", "cubes"):
        counts = []
        for program in (build(PHASE, "render-count"), tree / "build/gcc" / PHASE / "render-count"):
            command = [program, registry.find_scene(scene).path, "-n", "24", "--json"]
            said = json.loads(subprocess.check_output([str(word) for word in command]))
            counts.append({key: said[key] for key in COUNTS})
        assert counts[0] == counts[1] and counts[0]["executed"] > 0, scene
