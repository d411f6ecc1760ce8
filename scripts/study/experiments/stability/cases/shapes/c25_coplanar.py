"""Hard case 25."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase, exact
from study.experiments.stability.cases.scenes import scene, shape

SIZE = (32, 18)
FAR, NEAR = 0, 1  # the farther is the first, so that it wins a tie


def layers(gap: float) -> dict:
    """A tilted wall, and a box turned so that its face lies `gap` before it."""
    wall = shape("plane", normal=[0, -0.6, -0.8], offset=-4, material="other")
    # A face square to (0, −0.6, −0.8), half a thickness of 1 behind its surface.
    centre = [0.0, 0.6 * (5 - gap), 0.8 * (5 - gap)]
    box = shape("box", half_size=[6, 6, 1], position=centre, rotation_degrees=[turn(), 0, 0])
    camera = {"position": [0, 0, 0], "look_at": [0.1, 0.6, 0.8], "vertical_fov_degrees": 50}
    return scene([wall, box], camera=camera)


def turn() -> float:
    """About x, (y, z) → (c·y − s·z, s·y + c·z): takes (0, 0.6, 0.8) to (0, 0, 1)."""
    return float(np.degrees(np.arctan2(0.6, 0.8)))


def run(phase: Phase, strength: float) -> Outcome:
    picture = phase.render(layers(strength), SIZE)
    return Outcome(exact.share(picture["id"] != NEAR))


CASE = Case(
    number=25,
    name="coplanar",
    title="One surface a hair before another (z-fighting)",
    what="The face of a turned box lies before a tilted wall, nearer and nearer to it. Which of the two is "
    "seen is asked of every pixel.",
    why="Both distances are differences of numbers of order 5, rounded along different ways; as soon as "
    "the gap is smaller than that rounding the two surfaces show in patches.",
    source="Known from depth buffers since they exist; in ray tracers as black or patchy faces, for "
    "example on overlapping meshes in Cycles: blender_mmd_tools issue 214 (2019).",
    known="By construction: the box is nearer everywhere.",
    strength="gap between the surfaces, scene units",
    strengths=(1e-1, 1e-2, 1e-4, 1e-5, 1e-6, 1e-7, 1e-9, 1e-12, 1e-14, 1e-15),
    metric="pixels that do not show the nearer surface",
    unit="%",
    fails_above=0.0,
    limit="The nearer surface hides the farther.",
    run=run,
)
