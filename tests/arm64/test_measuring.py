"""aarch64: the kernels of common/ceilings/neon.c do the work they are credited with, and the clocks agree.

Cross-built and emulated (helpers/arm64.py): counts and registers are held, no time is.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path

import msgspec
import numpy as np
import programs
import pytest

import arm64
from study.bounds import ceilings
from study.bounds.ceilings import Ceilings
from study.core import registry
from study.core.build import build
from study.core.registry import ROOT

pytestmark = [pytest.mark.slow, arm64.needs_arm64]
SOURCE = ROOT / "common" / "ceilings"
FORMS = {"d": ("double", 64), "v2d": ("double", 128), "s": ("single", 32), "v4s": ("single", 128)}
NAMES = {"add+mul": "add_mul", "add+2mul": "add_2mul", "2add+mul": "two_add_mul"}
# Instructions of a round of the loop, in both banks of registers: four times 14, 10 or (with 16) 12.
WORK = {
    "add": {"fadd": 112},
    "mul": {"fmul": 112},
    "div": {"fdiv": 112},
    "minmax": {"fmax": 384, "fadd": 2},
    "sqrt": {"fsqrt": 80, "fadd": 32},
    "rsqrt": {"frsqrte": 80, "fadd": 32},
    "add+mul": {"fadd": 56, "fmul": 56},
    "add+2mul": {"fadd": 40, "fmul": 72},
    "2add+mul": {"fadd": 72, "fmul": 40},
}


@pytest.fixture(scope="module")
def program() -> Path:
    return programs.built("ceilings", arm64.FOLDER)


@pytest.fixture(scope="module")
def loops(program: Path) -> dict[str, list[tuple[str, str]]]:
    """Function → mnemonics and operands of its loop: from the target of its only `b.ne` up to that."""
    objdump = f"{arm64.COMPILER.removesuffix('gcc')}objdump"
    words = [objdump, "-d", "--no-show-raw-insn", program]
    text = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    found = {}
    for name, body in re.findall(r"^[0-9a-f]+ <(\w+)>:\n((?:.+\n)+)", text, re.MULTILINE):
        lines = re.findall(r"^ *([0-9a-f]+):\t(\S+)(?:\t(.*))?$", body, re.MULTILINE)
        back = [(int(at, 16), int(where.split()[0], 16)) for at, word, where in lines if word == "b.ne"]
        if len(back) == 1:
            (last, first), *_ = back
            found[name] = [(word, rest) for at, word, rest in lines if first <= int(at, 16) <= last]
    return found


@pytest.fixture(scope="module")
def limits(program: Path) -> Ceilings:
    """What it prints, which it does only if every kernel's registers and memory were right."""
    done = subprocess.run(
        [*arm64.EMULATOR, program, "--samples", "5"], capture_output=True, text=True, timeout=900
    )
    assert done.returncode == 0, done.stderr
    return msgspec.json.decode(done.stdout, type=Ceilings)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", [*ceilings.KINDS, *ceilings.TOGETHER])
def test_a_loop_holds_the_operations_it_is_credited_with(
    loops: dict, limits: Ceilings, kind: str, form: str
) -> None:
    code = loops[f"{NAMES.get(kind, kind)}_{form}"]
    fused = "fmla" if form[0] == "v" else "fmadd"
    wanted = WORK.get(kind, {fused: 112})
    assert Counter(word for word, _ in code) == {**wanted, "subs": 1, "b.ne": 1}
    suffix = f".{form[1:]}" if form[0] == "v" else ""
    registers = rf"{form[0]}\d+{re.escape(suffix)}(, {form[0]}\d+{re.escape(suffix)})+"
    assert all(re.fullmatch(registers, rest) for word, rest in code if word in wanted)
    row = limits._find(kind, *FORMS[form])
    sums = ("fadd", "fmul") if kind in NAMES else (next(iter(wanted)),)
    assert row and row.loop_operations == sum(wanted[word] for word in sums)


@pytest.mark.parametrize("motion", ["load", "store", "copy"])
@pytest.mark.parametrize("bits", [64, 128, 256])
def test_a_loop_moves_the_bytes_it_is_credited_with(
    loops: dict, limits: Ceilings, motion: str, bits: int
) -> None:
    """256: pairs of 128."""
    load, store, count = ("ldp", "stp", 8) if bits == 256 else ("ldr", "str", 16)
    wanted = {load: count * (motion != "store"), store: count * (motion != "load")}
    counted = Counter(word for word, _ in loops[f"{motion}_{bits}"])
    assert {word: counted[word] for word in wanted} == wanted and counted.total() <= 2 * count + 6
    rows = [one for one in limits.ceilings if (one.name, one.bits) == (motion, bits)]
    assert [one.level for one in rows] == list(ceilings.LEVELS)
    moved = count * bits // 8 * (2 if motion == "copy" else 1)
    assert {one.loop_bytes for one in rows} == {moved}


def test_no_ceiling_is_wider_than_neon(limits: Ceilings) -> None:
    forms = Counter((one.precision, one.bits) for one in limits.ceilings if one.precision)
    assert forms == dict.fromkeys(FORMS.values(), 10)
    assert limits.core_hz_load and limits.core_hz_load["256"] is None and limits.core_hz_load["512"] is None
    widths = {line["width"] for line in ceilings.grid(limits, "precision")}
    assert widths == {"32 bits (scalar)", "64 bits (scalar)", "128 bits"}
    widths = {line["width"] for line in ceilings.grid(limits, "level")}
    assert widths == {"64 bits (scalar)", "128 bits", "256 bits (two registers)"}


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('ONE(mul_##N, "fmul"', 'ONE(mul_##N, "fdiv"'),  # another operation
        ("b.ne 1b", "b.pl 1b"),  # one round too many
        ('#A "*16]', '#A "*8]'),  # another address
    ],
)
def test_a_kernel_whose_work_is_wrong_gives_no_figure(tmp_path: Path, old: str, new: str) -> None:
    for path in SOURCE.glob("*.[ch]"):
        shutil.copy(path, tmp_path)
    text = (tmp_path / "neon.c").read_text()
    assert old in text
    (tmp_path / "neon.c").write_text(text.replace(old, new))
    made = tmp_path / "made"
    words = [arm64.COMPILER, "-std=c11", "-D_GNU_SOURCE", "-O1", f"-I{ROOT / 'common'}", "-o", made]
    sources = [*tmp_path.glob("*.c"), ROOT / "common" / "timing" / "timer.c"]
    subprocess.run([*words, *sources, "-lm"], check=True)
    done = subprocess.run([*arm64.EMULATOR, made, "--samples", "5"], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)


def test_the_clocks_agree() -> None:
    """But for cycles of a core, which an emulator has not."""
    made = programs.built("tests/test_timer", arm64.FOLDER)
    done = arm64.run(made, env=os.environ | {"STEPWISE_EMULATED": "1"})
    said = done.stdout + done.stderr
    assert done.returncode == 0, said
    assert re.findall(r"SKIPPED +\] (\d+) test", said) == ["2"]


def test_a_record_has_the_timers_frequency() -> None:
    """CNTFRQ_EL0: the same in every process, and what turns its cycles into the other clock's time."""
    words = [registry.scenes()["scene0"].path, "-w", "8", "-n", "5", "--reps", "2", "--json"]
    command = [arm64.program("baseline"), *words]
    environment = {key: value for key, value in os.environ.items() if key != "STEPWISE_UNTIMED"}
    runs = [
        json.loads(
            subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout
        )
        for _ in range(2)
    ]
    (hz,) = {run["tsc_hz"] for run in runs}
    assert hz == round(hz) and 1e6 <= hz <= 1e9
    frames = [frame for run in runs for frame in run["frames"]]
    apart = [abs(one["tsc_cycles"] / hz * 1e9 - one["ns"]) - 0.05 * one["ns"] for one in frames]
    assert min(apart) < 20_000
    assert {run["core_hz_load"] for run in runs} == {0}  # scalar


def test_declared_counts_are_those_of_x86() -> None:
    """The same source in doubles: every function is entered as often. There are no others on arm64."""
    words = [registry.scenes()["scene0"].path, "-n", "18", "--json"]
    found = []
    for program in (build("baseline", "render-count"), arm64.program("baseline", "render-count")):
        done = subprocess.run([program, *words], capture_output=True, text=True, check=True)
        found.append(json.loads(done.stdout))
    here, there = found
    assert (here["isa"], there["isa"]) == ("x86-64", "aarch64")
    assert here["flops"]["machine"] > 1e7 and there["flops"] == here["flops"]
    assert there["by_function"] == here["by_function"] and there["by_class"] == here["by_class"]


def test_rays_are_traced_without_embree_which_says_why() -> None:
    """build/packets/hits: one ray to the first sphere of spheres40, by eight lanes of NEON."""
    scene = registry.find_scene("spheres40")
    sphere = scene.data["shapes"][1]
    ray = np.array([[*np.add(sphere["position"], [0, 20, 0]), 0, -1, 0, 1e9]], "<f4")
    command = [arm64.program("packets", "hits"), scene.path, "--embree"]
    done = subprocess.run(command, input=ray.tobytes(), capture_output=True, check=True)
    said = json.loads(done.stdout)
    assert (said["lanes"], said["isa"], said["count"]) == (8, "neon", 1)
    assert said["embree16_ns"] == [] and "libembree-dev" in said["embree"]
