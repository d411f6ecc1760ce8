"""Where closed forms of opt9_convex have to look twice: against a march in double, or truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from opt9_pictures import PHASE, needs_opt9, picture
from soft_shadows import clamped, lit

from conformance.feature_scenes import FLOOR, scene, shape

pytestmark = needs_opt9


BEHIND = [1, 3.0, 3]
TORUS = shape("torus", rotation_degrees=[-50, 0, 0])

# A mirror ball in the floor, whose rays start up to 0.2 off it: in the floor, and in what stands beside it.
CREVICE = scene(
    [
        shape("plane", normal=[0, 1, 0], offset=-1.5, material="blue"),
        shape("sphere", radius=1, position=[0, -0.65, 0], material="mirror"),
        shape("box", position=[1.7, -0.7, 0.3], half_size=[0.8, 0.8, 0.8]),
        shape("torus", position=[-1.7, -0.9, 0.2]),
        shape("cone", position=[0.2, -0.6, -1.4], half_height=0.9, bottom_radius=0.7, top_radius=0.2),
    ],
    light={"emission": [90, 80, 70]},
    background=[0.9, 0.5, 0.1],
    march={"surface_offset": 0.2},
    camera={"position": [0, -1.3, -5], "look_at": [0, -0.9, 0], "vertical_fov_degrees": 45},
)

SOLIDS = [FLOOR, TORUS, shape("box", position=[1.8, -0.9, 0.7]), shape("cone", position=[-1.9, -0.5, 0.2])]
MARCHED = {
    "mirror rays from a crevice": CREVICE,
    "a torus shades itself": scene([TORUS], light=lit("hard", [6, 0.3, 0])),
    "hard shadows of all, from 0.05 off": scene(
        SOLIDS, light=lit("hard", BEHIND), march={"surface_offset": 0.05}
    ),
    "a hard shadow of a Mandelbulb": scene([FLOOR, shape("mandelbulb")], light=lit("hard", [1, 3, -3])),
    # Its march has no step: the light reaches all that is nearer to it, though beyond it is a ceiling.
    "a light nearer than the first step": scene(
        [FLOOR, shape("plane", normal=[0, -1, 0], offset=1.3), shape("box", position=[0.6, -1.5, 1])],
        light=lit("hard", [0, -1.38, 0]) | {"emission": [1, 1, 1]},
        march={"surface_offset": 0.5},
        camera={"position": [0.1, -1.35, -0.6], "look_at": [0, -1.45, 0], "vertical_fov_degrees": 60},
    ),
    "a blocker beyond the bounds": scene(
        [FLOOR, shape("sphere", position=[2, 2.5, 0], radius=0.7)],
        light=lit("hard", [4, 6, 0]),
        march={"bounds_radius": 2.6},
        camera={"position": [0.4, 1.1, -2]},
    ),
}


@pytest.mark.parametrize("name", MARCHED)
def test_where_closed_forms_look_twice(name: str, tmp_path: Path) -> None:
    """Baseline marches these in double. Most were off by over 1/255 at first, in 3 to 867 of 6,527 pixels."""
    mine, march = (picture(MARCHED[name], tmp_path, phase=phase) for phase in (PHASE, "baseline"))
    assert np.array_equal(mine["id"], march["id"])
    off = np.abs(clamped(mine) - clamped(march)).max(axis=-1)
    assert off.max() < 1 / 255, f"{(off > 1 / 255).sum()} pixels"


# Rays along which a ring's inner side hardly bends, and steps by the distance are hundreds: 20 pixels of each
# view were lost.
ALONG_A_RING = {
    "all hit": ([2.3, -2.49, -4.21], [0.86, -0.21, 0]),
    "at its outline": ([1.88, -2.66, -4.2], [0.83, -0.15, 0]),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ALONG_A_RING)
def test_rays_along_a_rings_inner_side_are_not_lost(name: str, tmp_path: Path) -> None:
    place, look = ALONG_A_RING[name]
    ring = scene([shape("torus")], camera={"position": place, "look_at": look, "vertical_fov_degrees": 1})
    exact = picture(ring, tmp_path, phase="truth")
    hit = exact["id"] == 0
    assert hit.sum() > 5000
    for phase in (PHASE, "opt10_scene"):
        mine = picture(ring, tmp_path, phase=phase)
        assert np.array_equal(mine["id"], exact["id"]), phase
        assert np.quantile(np.abs(mine["Z"] - exact["Z"])[hit], 0.99) < 1e-3, phase


@pytest.mark.parametrize("height", [1e-4, 1e-5])
@pytest.mark.parametrize("radii", [(1e-3, 1.5), (1.5, 1e-3)])
def test_cones_thousands_of_times_wider_than_high(radii: tuple, height: float, tmp_path: Path) -> None:
    """A quadratic whose coefficients are the slope's square had hits beside it: a tenth of the picture's."""
    bottom, top = radii
    flat = shape(
        "cone", bottom_radius=bottom, top_radius=top, half_height=height, rotation_degrees=[20, 0, 10]
    )
    view = {"position": [-3, 2, -4], "look_at": [0, 0, 0], "vertical_fov_degrees": 30}
    names = ("truth", PHASE, "opt10_scene")
    truth, *both = (picture(scene([flat], camera=view), tmp_path, phase=phase) for phase in names)
    for mine in both:
        assert np.array_equal(mine["id"], truth["id"]), f"{(mine['id'] != truth['id']).sum()} pixels"
        hit = mine["id"] >= 0
        assert hit.sum() > 500 and np.allclose(mine["Z"][hit], truth["Z"][hit], atol=1e-5, rtol=0)


@pytest.mark.parametrize("phase", [PHASE, "opt10_scene"])
def test_normals_far_out_are_of_unit_length(phase: str, tmp_path: Path) -> None:
    """Float misses a solid 300 times its size away by 2e-5 of it; its normals are no longer for that."""
    solids = [
        shape("sphere", radius=1, position=[-1.2, 0, 0]),
        shape("box", half_size=[0.8, 0.8, 0.8], rounding=0.5, position=[1.2, 0, 0]),
    ]
    camera = {"position": [70, 90, -280], "look_at": [0, 0, 0], "vertical_fov_degrees": 1}
    made = picture(scene(solids, camera=camera, march={"bounds_radius": 1e3}), tmp_path, phase=phase)
    assert all((made["id"] == i).sum() > 200 for i in range(2))
    normal = np.stack([made[f"N.{axis}"] for axis in "xyz"], -1)[made["id"] >= 0].astype(float)
    assert np.abs(np.linalg.norm(normal, axis=-1) - 1).max() < 1e-6
