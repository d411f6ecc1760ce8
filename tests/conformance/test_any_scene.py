"""Any scene that hypothesis draws, by every phase: status 0, and a picture of finite numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from conformance import harness
from conformance.feature_scenes import MATERIALS, SIZES, scene, shape
from conformance.harness import PHASES, REDUCED, check_picture, keep, render
from drawn import examples

pytestmark = pytest.mark.parametrize("phase", PHASES)

coordinate = st.floats(-4, 4, width=32)
vector = st.tuples(coordinate, coordinate, coordinate).map(list)
length = st.floats(0.0625, 3, width=32)


@st.composite
def shapes(draw: st.DrawFn) -> dict:
    kind = draw(st.sampled_from(list(SIZES)))
    sizes = {key: draw(length) for key in SIZES[kind]}
    if kind == "box":
        sizes = {"half_size": draw(st.tuples(length, length, length).map(list))}
        x, y, _ = sizes["half_size"]
        sizes["rounding"] = x / 4 if x > y else 0
    elif kind == "plane":
        sizes = {
            "normal": draw(vector.filter(lambda n: np.linalg.norm(n) > 0.01)),
            "offset": draw(coordinate),
        }
    elif kind == "mandelbulb":
        sizes = {
            "power": 8,
            "iterations": draw(st.integers(1, 6)),
            "bailout": draw(st.sampled_from([4, 256])),
        }
    elif kind == "mandelbox":
        sizes = {
            "scale": draw(st.sampled_from([-3, -1.5, 0.5, 2])),
            "fold_limit": draw(length),
            "minimum_radius": draw(st.floats(0.0625, 0.5, width=32)),
            "fixed_radius": draw(st.floats(0.5, 2, width=32)),
            "iterations": draw(st.integers(1, 6)),
        }
    placed = {"position": draw(vector), "material": draw(st.sampled_from(list(MATERIALS)))}
    if draw(st.booleans()):
        placed["rotation_degrees"] = draw(vector.map(lambda v: [90 * x for x in v]))
    if draw(st.booleans()):
        placed["repeat"] = draw(vector.map(lambda v: [2 * x if x > 1e-3 else 0 for x in v]))
    return {"type": kind, **sizes, **placed}


@st.composite
def random_scenes(draw: st.DrawFn) -> dict:
    far = vector.filter(lambda v: np.hypot(v[0], v[2]) > 0.1)
    march = {
        "max_steps": draw(st.sampled_from([1, 30, 500])),
        "hit_distance": draw(st.sampled_from([1e-6, 1e-4, 0.05])),
        "max_bounces": draw(st.integers(0, 4)),
    }
    kinds = st.sampled_from(["none", "hard", "soft"])
    light = {
        "position": draw(vector),
        "shadows": draw(kinds),
        "shadow_strength": draw(st.floats(0.5, 50, width=32)),
    }
    return scene(
        draw(st.lists(shapes(), min_size=1, max_size=6)),
        march=march,
        light=light,
        fog=draw(st.sampled_from([0, 1e-5, 0.1])),
        camera={"position": draw(far), "vertical_fov_degrees": draw(st.floats(5, 120, width=32))},
    )


def spheres_alone(whole: dict) -> dict:
    """What closed forms of spheres can have of a scene: each shape a sphere, no fog, shadows hard or none."""
    sizes = [next((v for v in s.values() if isinstance(v, float)), 0.5) for s in whole["shapes"]]
    shapes = [
        shape("sphere", position=s["position"], radius=min(max(abs(r), 0.1), 2), material="glossy")
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
