"""Any scene that hypothesis draws, by every phase: status 0, and a picture of finite numbers."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from conformance import harness
from conformance.feature_scenes import shape
from conformance.harness import PHASES, REDUCED, check_picture, keep, render
from drawn import examples
from hard.drawn_scenes import EVERY, scenes, vector

pytestmark = pytest.mark.parametrize("phase", PHASES)


@st.composite
def random_scenes(draw: st.DrawFn) -> dict:
    """Any scene, its cells smaller than its shapes too, under limits that end marches early."""
    whole = draw(scenes([*EVERY]))
    for one in whole["shapes"]:
        if "repeat" in one and draw(st.booleans()):
            one["repeat"] = draw(vector(0.0625, 8))
    whole["march"] |= {
        "max_steps": draw(st.sampled_from([1, 30, 500])),
        "hit_distance": draw(st.sampled_from([1e-6, 1e-4, 0.05])),
    }
    return whole


def spheres_alone(whole: dict) -> dict:
    """What closed forms of spheres can have of a scene: each shape a sphere, no fog, shadows hard or none."""
    sizes = [next((v for v in s.values() if isinstance(v, float)), 0.5) for s in whole["shapes"]]
    shapes = [
        shape(
            "sphere", position=s.get("position", [0, 0, 0]), radius=min(max(abs(r), 0.1), 2), material="plain"
        )
        for s, r in zip(whole["shapes"], sizes, strict=True)
    ]
    light = whole["light"] | {"shadows": "none" if whole["light"]["shadows"] == "none" else "hard"}
    return whole | {"shapes": shapes, "fog": 0, "light": light}


@settings(
    max_examples=examples(10 if REDUCED else 60),
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
