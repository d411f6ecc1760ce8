"""Random inputs by seed: scenes by hypothesis, bytes by libFuzzer.

Both are deterministic: the same seed, programs and compiler give the same finding on every machine.
"""

from __future__ import annotations

import base64
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Collection
from pathlib import Path

from study.core import build, registry, temporary
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.registry import ROOT
from study.experiments.random.schema import Row

TESTS = ROOT / "tests"
SCENES = {  # kind → its test; the scene that fails is random_KIND.json
    "any": "test_no_phase_breaks",
    "extreme": "test_no_phase_breaks_at_the_limits",
    "benign": "test_phases_agree",
    "groups": "test_phases_agree_on_groups",
}
# As make fuzz has it: quarantines are small, but larger than what one input allocates.
ASAN = "malloc_context_size=0:quarantine_size_mb=1:thread_local_quarantine_size_kb=64"


def kinds() -> list[str]:
    """Kinds of inputs: those of scenes, and the harnesses."""
    return [*SCENES, *sorted(path.stem for path in (TESTS / "fuzz").glob("*.c"))]


def prepare(kinds: Collection[str]) -> None:
    """Builds what they need. Raises StudyError where one of them cannot be tried here."""
    harnesses = [kind for kind in dict.fromkeys(kinds) if kind not in SCENES]
    if harnesses and not shutil.which("clang"):
        text = f"kind {harnesses[0]} needs clang: apt install clang, or choose --kind {' '.join(SCENES)}"
        raise StudyError(text, CANNOT_RUN)
    for harness in harnesses:
        build.build("fuzz", harness)
    if len(harnesses) < len(set(kinds)):
        for phase in registry.phases().values():
            if phase.family == "ladder" and not registry.missing_isa(phase):
                build.build(phase.name)


def scenes(kind: str, seed: int, count: int) -> Row:
    """`count` random scenes through every phase of the ladder that can run here."""
    with temporary.folder() as scratch:
        test = f"{TESTS / 'hard' / 'test_random_scenes.py'}::{SCENES[kind]}"
        how = ["-q", "-o", f"cache_dir={scratch}", f"--hypothesis-seed={seed}"]
        more = {"STEPWISE_RANDOM": str(count), "STEPWISE_KEPT": str(scratch)}
        command = [sys.executable, "-I", "-m", "pytest", *how, test]
        done = child.run(command, capture_output=True, text=True, cwd=ROOT, env=os.environ | more)
        if done.returncode not in (0, 1):
            raise StudyError(f"pytest: {(done.stderr or done.stdout).strip().splitlines()[-1]}")
        kept = scratch / f"random_{kind}.json"
        text = kept.read_text(encoding="utf-8") if done.returncode and kept.exists() else None
    errors = re.findall(r"^E +(\S.*)$", done.stdout, re.MULTILINE)
    found = (errors[0] if errors else "the test failed") if done.returncode else None
    return Row(kind=kind, seed=seed, tried=count, found=found, input=text)


def fuzzed(harness: str, seed: int, count: int) -> Row:
    """`count` executions of a harness from the seeds' corpus alone."""
    program = build.build("fuzz", harness)
    with temporary.folder() as scratch:
        (scratch / "corpus").mkdir()
        more: list[str | Path] = []
        if harness == "scene":
            subprocess.run([sys.executable, "-I", TESTS / "fuzz" / "seeds.py", scratch / "seeds"], check=True)
            more = [scratch / "seeds", f"-dict={TESTS / 'fuzz' / 'scene.dict'}"]
        how = [f"-seed={seed}", f"-runs={count}", "-max_len=1200", "-timeout=10", "-rss_limit_mb=2048"]
        command = [program, scratch / "corpus", *more, *how, f"-artifact_prefix={scratch}/found-"]
        done = child.run(
            command, capture_output=True, text=True, errors="replace", env=os.environ | {"ASAN_OPTIONS": ASAN}
        )
        inputs = sorted(scratch.glob("found-*"))
        data = base64.b64encode(inputs[0].read_bytes()).decode() if inputs else None
    lines = re.findall(r"^(?:.*runtime error: .*|SUMMARY: .*)$", done.stderr, re.MULTILINE)
    found = (lines[0] if lines else f"status {done.returncode}") if done.returncode else None
    return Row(kind=harness, seed=seed, tried=count, found=found, input=data)
