"""Any scene that hypothesis draws, by every phase: status 0, and a picture of finite numbers."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings

from conformance import harness
from conformance.harness import PHASES, REDUCED, check_picture, keep, render
from drawn import examples
from hard.drawn_scenes import random_scenes, spheres_alone

pytestmark = pytest.mark.parametrize("phase", PHASES)


@settings(
    max_examples=examples(10 if REDUCED else 30),
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=list(HealthCheck),
)
@given(random_scenes())
def test_random_scenes(phase: str, whole: dict) -> None:
    """Whatever the numbers: status 0, nothing that is not finite. Where it is refused, of its spheres."""
    size = (5, 3) if phase == harness.TRUTH else (11, 7)  # a proved pixel may take a tenth of a second
    for one in (whole, spheres_alone(whole)):
        try:
            check_picture(render(phase, keep(f"random_{phase}", one), *size))
            return
        except harness.Unsupported:  # to hypothesis an error like any other, to be looked for and made small
            continue
