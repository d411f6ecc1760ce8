"""Denormals, flushed denormals, and a compiler told that there are none."""

from __future__ import annotations

import math

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, builds
from study.experiments.stability.cases.exact import share
from study.experiments.stability.cases.scenes import scene, shape
from study.pictures.images import clamped, rgb

SIZE = (24, 16)
SHORTEST = 1e-150  # of a vector whose square is still a normal double


def with_tiny(exponent: float) -> dict:
    """A room whose directions are 10^exponent long and whose small terms are 1e-7 of that."""
    tiny = 1e-7 * 10.0**exponent if math.isfinite(exponent) else 0.0
    long = max(10.0**exponent, SHORTEST) if math.isfinite(exponent) else 1.0
    normal = max(long, 1e-9)
    shapes = [
        shape("plane", normal=[0, normal, 0.1 * normal], offset=-1.2 * normal),
        shape("sphere", radius=1, position=[tiny, tiny, 5], material="faint"),
        shape("box", half_size=[0.5, 0.4, 0.6], position=[1.6, -0.5, 4], rotation_degrees=[tiny, 30, tiny]),
        shape("torus", major_radius=0.6, minor_radius=0.2, position=[-1.5, tiny, 4]),
        shape("mandelbulb", power=8, iterations=3, bailout=256, position=[-0.2, 2.2, 6 + tiny]),
    ]
    faint = {"color": [0.6, tiny, 0.4], "reflectivity": tiny, "shininess": 15}
    plain = {"color": [0.5, 0.4, 0.3], "reflectivity": 0, "shininess": 15}
    return scene(
        shapes,
        camera={
            "position": [0, 0, 0],
            "look_at": [0, 0, long],
            "up": [0, long, 0],
            "vertical_fov_degrees": 60,
        },
        light={"position": [3, 6, tiny], "emission": [4, 4, tiny], "shadows": "soft"},
        background=[tiny, 0.2, tiny],
        fog=tiny,
        materials={"faint": faint, "plain": plain},
    )


def run(phase: Phase, strength: float) -> Outcome:
    known = rgb(phase.render(with_tiny(-math.inf), SIZE))
    worst, bad, notes = 0.0, 0, []
    for title, built in (
        ("", phase),
        ("FTZ", builds.flushing(phase)),
        ("-ffast-math", builds.fast_math(phase)),
    ):
        if built is None:
            notes.append(f"{title}: not built: no gcc, or its parent is asked, whose code it is")
            continue
        before = built.non_finite
        picture = rgb(built.render(with_tiny(strength), SIZE))
        off = ~(np.abs(clamped(picture) - clamped(known)) <= 1 / 255).all(-1)
        worst = max(worst, share(off))
        if built is not phase:
            bad += built.non_finite - before
        if off.any() or built.non_finite > before:
            notes.append(
                f"{title or 'as built'}: {share(off):.2f} % off, {built.non_finite - before} not finite"
            )
    return Outcome(worst, bad, "; ".join(notes))
