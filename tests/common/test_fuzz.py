"""Each harness of tests/fuzz makes the same RUNS and finds nothing. `make fuzz MINUTES=60` explores."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys

import pytest

from study.core import build
from study.core.registry import ROOT

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not shutil.which("clang"), reason="fuzzing needs clang, which is not installed"),
]
FOLDER = ROOT / "tests" / "fuzz"
RUNS = 30_000
ASAN = "malloc_context_size=0:quarantine_size_mb=1:thread_local_quarantine_size_kb=64"  # fuzz.mk
SEEDED = ["scene"]  # of texts; the others take any bytes


@pytest.mark.parametrize("name", sorted(path.stem for path in FOLDER.glob("*.c")))
def test_a_harness_finds_nothing(name, tmp_path):
    program = build.build("fuzz", name)  # by build(): test_random makes the same programs at the same time
    more = []
    if name in SEEDED:
        subprocess.run([sys.executable, FOLDER / "seeds.py", tmp_path / "seeds"], check=True)
        more = [tmp_path / "seeds", f"-dict={FOLDER / 'scene.dict'}"]
    (tmp_path / "corpus").mkdir()
    command = [program, tmp_path / "corpus", *more, f"-runs={RUNS}", "-seed=1", "-max_len=1200"]
    done = subprocess.run(
        [*command, "-timeout=10", "-print_final_stats=1", f"-artifact_prefix={tmp_path}/"],
        env=os.environ | {"ASAN_OPTIONS": ASAN},
        capture_output=True,
        text=True,
        errors="replace",
        timeout=300,
    )
    assert done.returncode == 0, done.stderr[-4000:]
    runs = re.search(r"number_of_executed_units:\s*(\d+)", done.stderr)
    assert runs and int(runs[1]) >= RUNS, done.stderr[-4000:]
