"""Which of a phase's variants each program has: all where it is timed, else what this CPU runs (rules.mk)."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import copied
import programs
import pytest

from study.core import registry
from study.core.build import build

pytestmark = pytest.mark.slow

PHASE = "opt6_wide"
VARIANTS = {f"lanes{one.lanes}": set(one.isa) for one in registry.find_phase(PHASE).variants}


def is_there(program: Path, variant: str) -> bool:
    """Whether a variant is in the program; else its table (workers/lane_kernel.h) leads to a trap."""
    names = subprocess.check_output(["nm", str(program)], text=True).split()
    assert f"{variant}_kernel" in names
    command = ["objdump", "-d", "--no-show-raw-insn", f"--disassemble={variant}_left_out", str(program)]
    text = subprocess.check_output(command, text=True)
    found = re.findall(r"^ +[0-9a-f]+:\t(\S+)", text, re.MULTILINE)[:1]  # what is behind a trap is padding
    assert found == (["ud2"] if f"{variant}_left_out" in names else [])
    return not found


@pytest.mark.parametrize("target", ["render", "render-count", "render-blocks"])
@pytest.mark.parametrize("variant", VARIANTS)
def test_a_variant_is_there_or_traps(variant: str, target: str) -> None:
    there = target == "render" or VARIANTS[variant] <= registry.cpu_flags()
    assert is_there(build(PHASE, target), variant) == there


def test_what_is_sampled_builds_too() -> None:
    """The last phase has the others' files. Where nothing is inlined, gcc knows less of them."""
    assert build("opt12_fused", "render-calls").exists()


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A tree of its own, with one phase."""
    copied.folders(tmp_path, "common", "scripts/study", f"phases/{PHASE}")
    (tmp_path / "Makefile").write_text("include common/rules.mk\n")
    return tmp_path


def make(tree: Path, compiler: str, target: str) -> subprocess.CompletedProcess[str]:
    words = ["make", "-s", "-C", str(tree), f"CC={compiler}", f"BUILD=build/{compiler}"]
    return subprocess.run([*words, f"build/{compiler}/{PHASE}/{target}"], capture_output=True, text=True)


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
    program, _ = (programs.built(f"{PHASE}/{target}", "build/clang") for target in ("render", "read"))
    for variant, isa in VARIANTS.items():
        assert is_there(program, variant) == (isa <= registry.cpu_flags())
