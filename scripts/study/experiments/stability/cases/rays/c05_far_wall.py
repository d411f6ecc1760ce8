"""ε below an ulp of t, at a far wall: see CASE."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase
from study.experiments.stability.cases.scenes import found, rays, scene, shape

SIZE = (16, 16)
NORMAL = (0.0, 0.6, -0.8)  # the wall leans: no ray is square to it, so no march gets there in one step


def wall(distance: float) -> dict:
    return scene(
        [shape("plane", normal=list(NORMAL), offset=NORMAL[2] * distance)],
        camera={"position": [0, 0, 0], "look_at": [0, 0, 1]},
        march={"bounds_radius": min(1e9, 4 * distance)},
    )


def exact(distance: float) -> np.ndarray:
    """t of each ray, (height, width)."""
    origin, directions = rays(wall(distance), SIZE)
    n = np.array(NORMAL) / np.linalg.norm(NORMAL)
    return (n[2] * distance - n @ origin) / (directions @ n)


def run(phase: Phase, distance: float) -> Outcome:
    whole, t = wall(distance), exact(distance)
    picture = phase.render(whole, SIZE)
    hit = found(picture)
    stalled = int((~hit & (picture["evals"] >= whole["march"]["max_steps"])).sum())
    off = np.abs(picture["Z"][hit].astype(float) / t[hit] - 1)
    far = f", relative |Δt| up to {off.max():.1e}" if hit.any() else ""
    return Outcome(int((~hit).sum()), note=f"{stalled} of the misses used up all steps{far}")


CASE = Case(
    number=5,
    name="far_wall",
    title="ε below an ulp of t: a far wall",
    what="256 rays to a leaning wall, at a distance of 10 to 2·10⁸, with scene0's hit distance of 1e-6.",
    why="A float t of 16 is known to 10⁻⁶, one of 10⁵ to 8·10⁻³. Where the rest of the way is shorter "
    "than half a unit in the last place of t, t + distance is t again: the ray stands still in front of "
    "the wall until the step cap, and the wall gets holes. A double stalls in the same way at 10¹⁰.",
    source="An absolute ε against floats whose spacing grows: J. Amanatides and D. P. Mitchell, *Some "
    "regularization problems in ray tracing*, Graphics Interface 1990; H. Dammertz and A. Keller, "
    "*Improving ray tracing precision by object space intersection computation*, IEEE Symposium on "
    "Interactive Ray Tracing 2006. Users meet it at planets: demont-engine issue 256 (2026), where a point "
    "o + t·d at the horizon is known to 0.13 m and the hit distance is 10⁻⁴ m. As a stall of sphere tracing: "
    "we know of no first description.",
    known="The intersection of a ray with a plane, t = (c − n·o)/(n·d), in double. Every ray meets the wall.",
    strength="distance of the wall, scene units",
    strengths=(10.0, 100.0, 1e3, 1e4, 1e5, 1e6, 1e7, 2e8),
    metric="false misses of 256 rays",
    unit="rays",
    fails_above=0.0,
    limit="The wall fills the picture: any miss is a hole.",
    run=run,
)
