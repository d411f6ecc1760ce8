"""Another machine's phase.json has neither the flags and instruction sets of x86 nor its 16 lanes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from study.core.registry import ROOT

MADE_BY = {"opt2": "aarch64", "opt3": "avx2 by SIMDe", "opt5_threads": "avx2 by SIMDe", "opt6_wide": "neon"}
MADE_BY |= {"opt11_ideal": "neon", "fixed_simd": "avx2 by SIMDe", "fixed_float": "neon", "packets": "neon"}


@pytest.mark.parametrize("phase", MADE_BY)
def test_flags_of_another_machine(phase: str, tmp_path: Path) -> None:
    gcc = "aarch64-linux-gnu-gcc (Debian 12.2.0-14) 12.2.0"
    words = [ROOT / "common/build/phase_info.py", phase, phase, tmp_path, gcc, "", "aarch64-linux-gnu"]
    subprocess.run([sys.executable, *words], check=True)
    about, header = json.loads((tmp_path / "flags.json").read_text()), (tmp_path / "phase_info.h").read_text()
    assert not any(
        word.startswith("-m") for text in [about["cflags"], *about["flags"].values()] for word in text.split()
    )
    assert "lanes16" not in about["variants"] and about["here"] == about["variants"]
    assert about["never"] == (["lanes16"] if about["variants"] else [])
    assert f'#define PHASE_ISA "{MADE_BY[phase]}"' in header and "need(" not in header.replace("(need)", "")
    assert header.count(f'"{MADE_BY[phase]}"') == 1 + len(about["variants"])
