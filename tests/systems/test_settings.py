"""What words of settings each system refuses, in one line that names its variable."""

from __future__ import annotations

import pytest

from study.core.build import build
from study.core.registry import ROOT

REFUSED = {
    "rods": ["down", "down=0", "step=half", "x" * 300],
    "rods_simd": ["size=12", "size=8 least=16", "steps=1e3"],
    "fixed": ["bits=7", "bits=29", "bits=20.5", "unit=3", "roots=5", "clear=all", "bits"],
    "packets": ["tree", "tree=octree", "lanes=4", "x" * 300],
}


@pytest.mark.parametrize(("phase", "words"), [(p, one) for p, some in REFUSED.items() for one in some])
def test_a_setting_that_is_none_is_refused(phase: str, words: str, called) -> None:
    done = called(build(phase), ROOT / "common" / "scenes" / "spheres40.json", (4, 4), words)
    assert done.returncode == 4 and done.stdout == "" and done.stderr.count("\n") == 1
    assert f"STEPWISE_{phase.partition('_')[0].upper()}: " in done.stderr and "should be" in done.stderr
