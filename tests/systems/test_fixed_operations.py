"""Integer operations of phase fixed: calls of its words in a build without inlining, held against the
multiplications that the shipped program executes. Needs valgrind and objdump; `-s` prints the counts."""

from __future__ import annotations

import collections
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from study.core.build import build
from study.core.registry import ROOT

SCENE = ROOT / "common" / "scenes" / "spheres40.json"
HEIGHT = 90
PIXELS = 160 * HEIGHT
WORDS = {
    "products": ("v_mul_wide",),
    "sums": ("v_add", "v_sub"),
    "shifts": ("v_sra", "v_srav", "v_sll", "v_srl", "v_sllv", "v_srlv"),
    "comparisons": ("v_positive", "v_cmp_lt"),
    "bits": ("v_and_bits", "v_or_bits"),
}
TILE = "lanes1_render_tile"  # a frame without the threads and the scene's conversion

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (shutil.which("valgrind") and shutil.which("objdump")), reason="no valgrind or objdump"
    ),
]


def profile(program: Path, words: str, out: Path, *more: str) -> str:
    """Callgrind's file of one frame of SCENE by the program, what runs below TILE alone."""
    command = ["valgrind", "--tool=callgrind", f"--toggle-collect={TILE}", "--compress-pos=no", *more]
    command += [f"--callgrind-out-file={out}", str(program), str(SCENE), "-n", str(HEIGHT)]
    env = os.environ | {"STEPWISE_FIXED": words, "STEPWISE_UNTIMED": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=env)
    assert done.returncode == 0, done.stderr
    return out.read_text()


def called(text: str) -> collections.Counter[str]:
    """How often each function was called."""
    names: dict[str, str] = {}
    calls: collections.Counter[str] = collections.Counter()
    callee = ""
    for line in text.splitlines():
        if found := re.fullmatch(r"c?fn=\((\d+)\)(?: (.*))?", line):
            name = names.setdefault(found[1], found[2] or "")
            callee = name if line.startswith("c") else callee
        elif line.startswith("calls="):
            calls[callee] += int(line[6:].split()[0])
    return calls


def executed(text: str) -> Iterator[tuple[int, int]]:
    """Address of each instruction and how often it ran; of calls only the instruction itself."""
    of_call = False
    for line in text.splitlines():
        if line.startswith("calls="):
            of_call = True
        elif found := re.fullmatch(r"0x([0-9a-f]+) \S+ (\d+)", line):
            if not of_call:
                yield int(found[1], 16), int(found[2])
            of_call = False


def multiplications(program: Path) -> set[int]:
    """Where they stand in the file."""
    text = subprocess.run(
        ["objdump", "-d", "--no-show-raw-insn", str(program)], capture_output=True, text=True
    )
    return {int(a, 16) for a in re.findall(r"^\s*([0-9a-f]+):\s+imul", text.stdout, re.MULTILINE)}


@pytest.mark.parametrize("words", ["roots=article clear=corners", "roots=3 clear=lists"])
def test_the_words_products_are_the_multiplications_that_ran(tmp_path, words):
    calls = called(profile(build("fixed", "render-calls"), words, tmp_path / "calls"))
    counts = {kind: sum(calls[w] for w in names) / PIXELS for kind, names in WORDS.items()}
    print(f"{words}: { ({k: round(v, 1) for k, v in counts.items()}) }, {sum(counts.values()):.1f} a pixel")
    shipped = build("fixed")
    ran = list(executed(profile(shipped, words, tmp_path / "shipped", "--dump-instr=yes")))
    there = multiplications(shipped)
    found = sum(count for address, count in ran if address in there) / PIXELS
    print(f"shipped: {found:.1f} multiplications, {sum(c for _, c in ran) / PIXELS:.0f} instructions a pixel")
    assert counts["products"] > 50
    assert found == pytest.approx(counts["products"], rel=0.01), "gcc shares a product here and there"
