"""Which of a phase's variants each program has: all where it is timed, else what this CPU runs (rules.mk)."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from study import registry
from study.build import build
from study.registry import ROOT

PHASE = "opt6_wide"
VARIANTS = {f"lanes{one['lanes']}": set(one["isa"]) for one in registry.find_phase(PHASE).variants}


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


def test_counting_sources_of_every_variant_are_compiled_or_read_and_a_warning_ends_it(tmp_path: Path) -> None:
    """As tests/run.py has it made, in a tree of its own where one variant has a fault."""
    for name in ("common", "scripts/study", f"phases/{PHASE}"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(["cp", "-r", ROOT / name, tmp_path / name], check=True)
    (tmp_path / "Makefile").write_text("include common/rules.mk\n")
    source = tmp_path / "phases" / PHASE / "march.c"  # the first of those that each variant has
    kept = source.read_text()

    def make(compiler: str, target: str) -> subprocess.CompletedProcess[str]:
        words = ["make", "-s", "-C", str(tmp_path), f"CC={compiler}", f"BUILD=build/{compiler}"]
        return subprocess.run(
            [*words, f"build/{compiler}/{PHASE}/count/{target}"], capture_output=True, text=True
        )

    for compiler in ("gcc", "clang"):
        good = make(compiler, "read")
        assert good.returncode == 0, good.stderr
    for variant, isa in VARIANTS.items():
        lanes = variant.removeprefix("lanes")
        fault = f"#if defined STEPWISE_COUNT && LANES == {lanes}\nstatic int unused_here;\n#endif\n"
        for compiler in ("gcc", "clang"):
            read = compiler == "clang" or not isa <= registry.cpu_flags()
            source.write_text(kept + fault)
            done = make(compiler, "read" if read else "phase.o")
            assert done.returncode != 0 and "unused_here" in done.stderr, (variant, compiler)
