"""Writes the table of results/reference/arm64.md: the emulated pictures of every phase beside x86-64's.

PYTHONPATH=scripts:tests:tests/helpers .venv/bin/python tests/arm64/table.py > results/reference/arm64.md
"""

import os
import subprocess

import programs

import arm64
from builds import ARM64_TESTS
from conformance import harness
from study.core import registry
from study.pictures import gate, images

os.environ |= {"STEPWISE_CC": "none", "STEPWISE_UNTIMED": "1", "STEPWISE_ISA_LIMIT": "avx2"}
SIZE = (32, 18)
INTRO = """# arm64

Every phase draws every scene at 32×18 pixels, cross-built by
{compiler} and run under {emulator}.
A cell is the PSNR in dB to the same phase's picture on x86-64 with eight lanes. *same*: every bit.
–: the system does not draw the scene. ✗: further from baseline than the phase declares; a fractal
is too small here to judge. No time is shown: an emulator's says nothing.

    PYTHONPATH=scripts:tests:tests/helpers .venv/bin/python tests/arm64/table.py > FILE

**Words.** {words} of the {programs} programs of tests/c that hold words to the bit, enclosures to
their bounds and polynomials to their ulp pass there.
"""


def first_line(tool: str) -> str:
    return subprocess.run([tool, "--version"], capture_output=True, text=True).stdout.splitlines()[0]


def cell(phase: registry.Phase, scene: registry.Scene) -> str:
    try:
        mine = arm64.draw(phase.name, scene.path, *SIZE).picture
    except harness.Unsupported:
        return "–"
    here = harness.reference(scene.path, *SIZE, phase=phase.name).picture
    base = images.compare(harness.reference(scene.path, *SIZE).picture, mine)
    declared = gate.tolerance(phase, scene)
    failed = declared and not scene.fractal and gate.failures(base, arm64.small(declared, SIZE[0] * SIZE[1]))
    beside = images.compare(here, mine)["psnr_db"]
    shown = "same" if beside == float("inf") else f"{beside:.0f}"
    return shown + " ✗" * bool(failed)


def main() -> None:
    phases = [one for one in registry.phases().values() if one.name != harness.TRUTH]
    emulator = first_line("qemu-aarch64").partition("(")[0].strip()
    passed = [
        arm64.run(programs.built(f"tests/{name}", arm64.FOLDER)).returncode == 0 for name in ARM64_TESTS
    ]
    compiler = first_line(arm64.COMPILER)
    print(INTRO.format(compiler=compiler, emulator=emulator, words=sum(passed), programs=len(passed)))
    print("| phase | built of |", " | ".join(arm64.SCENES), "|")
    print("| --- | --- |", " | ".join(["---"] * len(arm64.SCENES)), "|")
    for phase in phases:
        cells = " | ".join(cell(phase, one) for one in arm64.SCENES.values())
        print(f"| {phase.name} | {arm64.made_of(phase)} | {cells} |")


if __name__ == "__main__":
    main()
