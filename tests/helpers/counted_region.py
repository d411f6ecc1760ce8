"""The program tests/fixtures/qemu/region.c: compiled, and the work that its source says."""

from __future__ import annotations

import subprocess
from collections import Counter
from pathlib import Path

FIXTURES = Path(__file__).resolve().parents[1] / "fixtures" / "qemu"
# By fixtures/qemu/region.c, per repetition: operations by lane, bytes loaded, bytes stored.
SCALAR = Counter(
    {(kind, "double", 64): 1 for kind in ("add", "mul", "div", "sqrt", "minmax", "compare")}
    | {("add", "single", 32): 1}
)
KNOWN = {
    "scalar": (SCALAR, 16, 12),
    "packed": (
        Counter(
            {
                ("add", "double", 128): 2,
                ("mul", "single", 128): 4,
                ("fma", "double", 256): 4,
                ("fma", "single", 256): 8,
                ("minmax", "double", 256): 4,
                ("rsqrt", "single", 256): 8,
                ("fma", "double", 64): 1,
            }
        ),
        32,
        32,
    ),
    "repeated": (Counter(), 37 + 6 + 8, 37 + 40 + 8),
    # Three calls from the region: a return address each.
    "calls": (Counter({("mul", "double", 64): 3, ("add", "double", 64): 1}), 24, 24),
}


def compile(folder: Path) -> str:
    """The path of the program in `folder`."""
    path = folder / "region"
    command = ["cc", "-O2", "-Wall", "-Wextra", "-Werror", str(FIXTURES / "region.c"), "-o", str(path)]
    subprocess.run([*command, "-lm", "-lpthread"], check=True)
    return str(path)
