"""Hard case 31."""

from __future__ import annotations

import math

from study.experiments.stability.cases import Case, Outcome, Phase, exact
from study.experiments.stability.cases.scenes import found, rays, scene, shape

SIZE, FAR = (32, 32), 5.0


def cut(k: float) -> dict:
    """A wall that bounds 2^−k of the distance beyond it cut to a disc, which fills the view."""
    bounds = FAR * (1 + 2.0**-k)
    half = math.sqrt(bounds**2 - FAR**2) / FAR
    degrees = max(1.0, math.degrees(2 * math.atan(1.3 * half)))
    camera = {"position": [0, 0, 0], "look_at": [0, 0, 1], "vertical_fov_degrees": degrees}
    return scene(
        [shape("plane", normal=[0, 0, -1], offset=-FAR)], camera=camera, march={"bounds_radius": bounds}
    )


def run(phase: Phase, strength: float) -> Outcome:
    whole = cut(strength)
    t = exact.plane(*rays(whole, SIZE), [0, 0, 1], FAR)
    inside = t <= whole["march"]["bounds_radius"]
    return Outcome(exact.share(found(phase.render(whole, SIZE)) != inside))


CASE = Case(
    number=31,
    name="bounds_cut",
    title="Bounds that cut a shape",
    what="The camera sits in the middle of the bounds and looks at a wall just within them, so that only a "
    "disc of it may be seen; the bounds come down on the wall.",
    why="A ray ends when it leaves the bounds, unless it hits first: near the disc's rim the two happen "
    "within one step. |p|² against radius² compares numbers that agree in more and more digits.",
    source="Things that vanish at a far limit: godot-volumetric-clouds issue 4 (2020); the format's own "
    "words: a ray further than bounds_radius from the origin has missed.",
    known="The hit counts where its distance from the origin is at most the radius.",
    strength="k: the bounds are 2^−k of the distance beyond the wall",
    strengths=(1, 4, 8, 12, 16, 18, 20),
    metric="false hits and false misses",
    unit="%",
    fails_above=0.5,
    limit="Five of the 1024 pixels: the disc's rim passes some 75, of which a few may lie on it.",
    run=run,
)
