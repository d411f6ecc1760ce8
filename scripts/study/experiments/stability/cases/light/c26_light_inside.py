"""Hard case 26."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase, exact
from study.experiments.stability.cases.scenes import scene, shape

SIZE, AMBIENT = (32, 18), 0.01 * 0.6


def lamp(depth: float) -> dict:
    """A ball over a floor, the light inside it, `depth` above its lowest point."""
    return scene(
        [shape("plane", normal=[0, 1, 0], offset=0), shape("sphere", radius=1, position=[0, 2, 0])],
        light={"position": [0, 1 + depth, 0], "emission": [5, 5, 5], "shadows": "hard"},
        camera={"position": [0, 0.7, -5], "look_at": [0, 0.2, 0], "vertical_fov_degrees": 40},
    )


def run(phase: Phase, strength: float) -> Outcome:
    picture = phase.render(lamp(strength), SIZE)
    floor = picture["id"] == 0
    lit = ~(np.abs(picture["R"].astype(float) / AMBIENT - 1) <= 1e-3)
    return Outcome(exact.share(lit[floor]))


CASE = Case(
    number=26,
    name="light_inside",
    title="A light inside a shape",
    what="A point light inside an opaque ball, nearer and nearer to the ball's lowest point, over a floor "
    "under hard shadows.",
    why="The shadow ray converges on the ball's surface and stops once it has come as far as the light. "
    "With the light just inside, whether it stops on the surface or beyond it hangs on the last step.",
    source="Light that leaks out of closed shapes is among the commonest reports: Roblox future-is-bright "
    "issue 5 (2017, from inside a building), GameGuru MAX issue 4188 (2023).",
    known="By construction: no light leaves the ball, so the floor has its ambient colour, 0.01 of its "
    "own, exactly.",
    strength="depth of the light below the surface, scene units",
    strengths=(0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-9),
    metric="floor pixels that are lit",
    unit="%",
    fails_above=0.0,
    limit="No light leaves a closed shape.",
    run=run,
)
