"""Fused multiply-adds, gcc against clang."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, builds
from study.experiments.stability.cases.exact import share
from study.experiments.stability.cases.scenes import scene, shape
from study.pictures.images import Picture

SIZE = (48, 27)


def twins(k: float) -> dict:
    """A box and an octahedron over a floor, and inside each its twin: a quarter turn on, 2^−k smaller."""
    less = 1 - 2.0**-k
    box = {"half_size": [0.8, 1.0, 0.6], "position": [0.9, 0, 0], "rotation_degrees": [15, 40, 5]}
    inner = {"half_size": [x * less for x in (1.0, 0.8, 0.6)], "rotation_degrees": [15, 40, 95]}
    eight = {"radius": 1.1, "position": [-1.1, 0.1, 0], "rotation_degrees": [35, 20, 10]}
    shapes = [
        shape("box", **box | inner, material="other"),
        shape("box", **box),
        shape(
            "octahedron",
            **eight | {"radius": 1.1 * less, "rotation_degrees": [35, 20, 100]},
            material="other",
        ),
        shape("octahedron", **eight),
        shape("plane", normal=[0, 1, 0], offset=-1.2),
    ]
    return scene(
        shapes,
        camera={"position": [0, 0.6, -5], "vertical_fov_degrees": 30},
        light={"shadows": "soft"},
    )


def _differences(a: Picture, b: Picture) -> tuple[np.ndarray, np.ndarray]:
    """Pixels whose shape differs, and pixels in which any bit does."""
    bits = np.zeros(a["id"].shape, bool)
    for name in a:
        bits |= a[name].view(np.uint32) != b[name].view(np.uint32)
    return a["id"] != b["id"], bits


def run(phase: Phase, strength: float) -> Outcome:
    whole = twins(strength)
    shipped = phase.render(whole, SIZE)
    others = {"contracted": builds.contracted(phase), "clang": builds.clang(phase)}
    worst, notes, bad = 0.0, [], 0
    for title, built in others.items():
        if built is None:
            notes.append(
                f"{title}: not compared: no compiler (or FMA), or its parent is asked, whose code it is"
            )
            continue
        shapes, bits = _differences(shipped, built.render(whole, SIZE))
        worst, bad = max(worst, share(shapes)), bad + built.non_finite
        notes.append(
            f"{title}: a bit differs in {share(bits):.1f} % of the pixels, the shape in {share(shapes):.2f} %"
        )
    return Outcome(worst, bad, "; ".join(notes))
