"""Facing mirrors, a light behind a wall, a camera inside a shape."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape, worst
from study.pictures.images import rgb

SIZE, HALF = (9, 9), 2.0
HIT = 1e-6  # hit distance of the scenes
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


def enclosed(bounces: float) -> list[tuple[dict, float]]:
    """Camera inside a mirroring box and a ball, and exactly on a mirror, with how deep inside it is.

    From the ball's camera the nearest of its surface is straight behind: the line of view meets it at −depth.
    """
    box = shape("box", half_size=[1, 1, 1], material="mirror")
    ball = shape("sphere", radius=1, position=[0, 0.5, 0], material="mirror")
    floor = shape("plane", normal=[0, 1, 0], offset=0, material="mirror")
    march, light = {"max_bounces": int(bounces)}, {"position": [0.5, 0.4, 0.3], "shadows": "soft"}
    views = {"box": [0, -0.2, 1], "sphere": [0, 1, 0], "plane": [0, -0.2, 1]}
    return [
        (
            scene(
                [one],
                materials=MATERIALS,
                march=march,
                light=light,
                camera={"position": [0, 0, 0], "look_at": views[one["type"]], "up": [0, 1, 1]},
            ),
            depth,
        )
        for one, depth in ((box, 1.0), (ball, 0.5), (floor, 0.0))
    ]


def inside(phase: Phase, bounces: float) -> tuple[float, float]:
    """Brightest colour and largest |Δt| of the pictures from inside. A miss has Z = ∞, and so Δt."""
    brightest, dt = [], []
    for whole, depth in enclosed(bounces):
        picture = phase.render(whole, SIZE)
        brightest.append(worst(rgb(picture).astype(float)))
        dt.append(worst(np.abs(picture["Z"].astype(float) + depth)))
    return worst(brightest), worst(dt)


def run(phase: Phase, strength: float) -> Outcome:
    known = series(between(strength))
    got = rgb(phase.render(between(strength), SIZE)).astype(float)
    error = worst(np.abs(got - known) / known.max())
    dark, ambient = behind()
    unlit = worst(np.abs(phase.render(dark, SIZE)["R"].astype(float) - ambient) / ambient)
    error = 255 * worst([error, unlit])  # max() would drop a NaN
    brightest, dt = inside(phase, strength)
    # Diffuse and specular at a light as near as a hit can be, 1e-6 off, and the mirror's 1/0.9.
    bound = 5 * (0.7 + 0.2) / 1e-6 / 0.9
    note = f"inside a shape at most {brightest:.3g}, |Δt| {dt:.1e}"
    return Outcome(worst([error, dt / HIT]) if brightest <= bound else np.inf, note=note)
