"""Hard case 18."""

from __future__ import annotations

import numpy as np

from study.hard import Case, Outcome, Phase, exact
from study.hard.scenes import rays, scene, shape, worst
from study.images import rgb

SIZE, HALF = (9, 9), 2.0
MATERIALS = {"mirror": {"color": [0.3, 0.5, 0.7], "reflectivity": 1, "shininess": 15}}
WALLS = [shape("plane", normal=[0, 0, -z], offset=-HALF, material="mirror") for z in (1, -1)]


def between(bounces: float) -> dict:
    """Two mirrors that face each other, the camera and the light between them."""
    return scene(
        WALLS,
        materials=MATERIALS,
        march={"max_bounces": int(bounces)},
        light={"position": [0.5, 1, 0]},
        camera={"position": [0, 0, 0], "look_at": [0, 0, 1], "vertical_fov_degrees": 20},
    )


def series(whole: dict) -> np.ndarray:
    """Each bounce adds a tenth of the one before, and starts surface_offset off the mirror."""
    p, d = rays(whole, SIZE)
    p = np.broadcast_to(p, d.shape).astype(np.longdouble)
    total, weight = np.zeros(d.shape, np.longdouble), 1.0
    lost = np.zeros(d.shape[:-1], bool)
    for _ in range(whole["march"]["max_bounces"] + 1):
        wall = np.sign(d[..., 2:]) * HALF
        p = p + (wall - p[..., 2:]) / d[..., 2:] * d
        lost |= (p**2).sum(-1) > whole["march"]["bounds_radius"] ** 2
        n = np.concatenate([np.zeros_like(p[..., :2]), -np.sign(wall)], -1)
        total += np.where(lost[..., None], 0, weight * exact.light(p, n, d, whole, "mirror"))
        p, d, weight = p + n * whole["march"]["surface_offset"], d * [1, 1, -1], weight * 0.1
    return total.astype(float)


def behind() -> tuple[dict, float]:
    """The light on the far side of a wall: ambient only. The wall's red."""
    wall = shape("plane", normal=[0, 0, -1], offset=-1)
    return scene([wall], light={"position": [0, 0, 4], "shadows": "hard"}), 0.006


def enclosed(bounces: float) -> list[dict]:
    """Camera and light inside a mirroring box; the camera exactly on a mirror."""
    box = shape("box", half_size=[1, 1, 1], material="mirror")
    floor = shape("plane", normal=[0, 1, 0], offset=0, material="mirror")
    march, light = {"max_bounces": int(bounces)}, {"position": [0.5, 0.4, 0.3], "shadows": "soft"}
    at = {"position": [0, 0, 0], "look_at": [0, -0.2, 1]}
    return [scene([s], materials=MATERIALS, march=march, light=light, camera=at) for s in (box, floor)]


def run(phase: Phase, strength: float) -> Outcome:
    known = series(between(strength))
    got = rgb(phase.render(between(strength), SIZE)).astype(float)
    error = worst(np.abs(got - known) / known.max())
    dark, ambient = behind()
    unlit = worst(np.abs(phase.render(dark, SIZE)["R"].astype(float) - ambient) / ambient)
    error = worst([error, unlit])  # max() would drop a NaN
    brightest = worst([worst(rgb(phase.render(whole, SIZE)).astype(float)) for whole in enclosed(strength)])
    # Diffuse and specular at a light as near as a hit can be, 1e-6 off, and the mirror's 1/0.9.
    bound = 5 * (0.7 + 0.2) / 1e-6 / 0.9
    return Outcome(error if brightest <= bound else np.inf, note=f"inside a shape at most {brightest:.3g}")


CASE = Case(
    number=18,
    name="mirrors_and_inside",
    title="Facing mirrors, a light behind a wall, a camera inside a shape",
    what="Two parallel mirrors with camera and light between them, at more and more bounces; a wall lit "
    "from behind; a camera inside a mirroring box, and one exactly on a mirror.",
    why="Recursion without an end: every bounce finds the other mirror, so only the cap stops it, on a "
    "stack that must hold it. A ray that starts in or on a shape has a distance of zero or less at once.",
    source="T. Whitted, An improved illumination model for shaded display, CACM 23 (1980), for the "
    "recursion; a camera inside an object turning black: three-raymarch issue 1 (2023).",
    known="Between the mirrors the colour is a geometric series of Phong's terms, summed along the "
    "unfolded path; behind the wall it is the ambient term exactly; inside, it must be finite and bounded.",
    strength="max_bounces",
    strengths=(0, 1, 3, 8, 32, 256),
    metric="largest error of a colour, relative to the brightest",
    unit="",
    fails_above=1 / 255,
    limit="One step of an 8-bit display.",
    run=run,
)
