"""The C tests (tests.mk): one program of each tests/c/FOLDER/test_NAME.c: by gcc sanitized, by clang
optimized, which shows what clang makes of lanes."""

from __future__ import annotations

import fcntl
import functools
import os
import re
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from builds import SETTINGS, c_tests_by_clang
from study.core import registry
from study.core.registry import ROOT

SOURCES = sorted(Path(__file__).parent.glob("*/test_*.c"), key=lambda path: -path.stat().st_size)
FOLDERS = {"gcc": "build/asan", "clang": "build/clang"}
TARGETS = {"gcc": ["c-tests"], "clang": [f"build/clang/tests/{name}" for name in c_tests_by_clang()]}
PROGRAMS = [pytest.param(path, "gcc", id=f"{path.stem}-gcc") for path in SOURCES]
PROGRAMS += [
    pytest.param(path, "clang", id=f"{path.stem}-clang", marks=pytest.mark.slow)
    for path in SOURCES
    if path.stem in c_tests_by_clang()
]


@functools.cache
def built(compiler: str) -> None:
    """Brings all programs of that build up to date, once."""
    folder = FOLDERS[compiler]
    (ROOT / folder).mkdir(parents=True, exist_ok=True)
    with (ROOT / folder / ".making").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        words = ["make", "-s", "-k", f"BUILD={folder}", *SETTINGS[folder], *TARGETS[compiler]]
        done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def missing_isa(source: Path) -> str:
    """Instruction sets that the source's first line, `// flags: -mavx2 …`, asks for and this CPU lacks."""
    asked = re.findall(r"-m(\w+)", source.read_text().splitlines()[0])
    return ", ".join(flag for flag in asked if flag not in registry.cpu_flags())


def said_of(results: Path, kind: str) -> list[str]:
    """Name and text of the cases that failed, or were skipped."""
    cases = ET.parse(results).getroot().iter("testcase")
    return [f"{c.get('name')}: {(found.text or '').strip()}" for c in cases for found in c.iter(kind)]


@pytest.mark.parametrize(("source", "compiler"), PROGRAMS)
def test_program(source: Path, compiler: str, tmp_path: Path) -> None:
    """A program of which some cases cannot run here counts as left out, once all others have passed."""
    if lacking := missing_isa(source):
        pytest.skip(f"the CPU lacks {lacking}")
    built(compiler)
    results = tmp_path / "results.xml"
    environment = os.environ | {"CMOCKA_MESSAGE_OUTPUT": "xml", "CMOCKA_XML_FILE": str(results)}
    done = subprocess.run(
        [ROOT / FOLDERS[compiler] / "tests" / source.stem], capture_output=True, text=True, env=environment
    )
    print(done.stdout, done.stderr)
    reasons = re.findall("^skipped: (.*)", done.stdout, re.MULTILINE)
    if done.returncode == 0 and reasons and not results.exists():
        pytest.skip(reasons[0])
    assert results.is_file(), "it ended before its tests did"
    failed = said_of(results, "failure") + said_of(results, "error")
    assert done.returncode == 0 and not failed, "\n".join(failed)
    if left_out := said_of(results, "skipped"):
        names = ", ".join(one.partition(":")[0] for one in left_out)
        pytest.skip(f"{', '.join(reasons) or 'it says no reason'} ({names})")
