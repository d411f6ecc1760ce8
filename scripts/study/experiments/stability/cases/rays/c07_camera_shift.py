"""Camera and scene shifted by 2ᵏ."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Outcome, Phase
from study.experiments.stability.cases.scenes import found, scene, shape

SIZE = (32, 24)
REACH = 32.0  # beyond every shape
AGREES = 1e-4
# Positions are multiples of 1/16, so that each shifted number is exact in double.
SHAPES = (
    shape("box", half_size=[4, 0.25, 4], position=[0, -1.5, 1]),
    shape("sphere", radius=1.0, position=[-1.25, 0, 0.5], material="other"),
    shape(
        "torus", major_radius=0.75, minor_radius=0.25, position=[1.25, -0.25, 0], rotation_degrees=[60, 20, 0]
    ),
    shape("cone", bottom_radius=0.5, top_radius=0.25, half_height=0.5, position=[0, -0.5, -1.5]),
    shape("octahedron", radius=0.75, position=[0.25, 1, 1.5]),
)


def shifted(k: int | None) -> dict:
    """The scene, moved by (2ᵏ, 2ᵏ, 2ᵏ); None: not moved. Nothing that a bound could hide is in it."""
    by = 0.0 if k is None else 2.0**k

    def moved(point: list[float]) -> list[float]:
        return [x + by for x in point]

    return scene(
        [one | {"position": moved(one["position"])} for one in SHAPES],
        camera={"position": moved([0, 0.5, -6]), "look_at": moved([0, -0.25, 0])},
        light={"position": moved([3, 6, -5])},
        march={"bounds_radius": REACH + 2 * by},
    )


def differing(a: dict, b: dict) -> tuple[int, float]:
    """Pixels whose shape (or miss) differs, or t by more than AGREES; the largest |Δt| of the others."""
    both = found(a) & found(b) & (a["id"] == b["id"])
    off = np.abs(np.where(both, a["Z"], 0).astype(float) - np.where(both, b["Z"], 0))
    wrong = (a["id"] != b["id"]) | ~(off <= AGREES)
    return int(wrong.sum()), float(off[~wrong].max(initial=0))


def run(phase: Phase, k: float) -> Outcome:
    count, off = differing(phase.render(shifted(None), SIZE), phase.render(shifted(int(k)), SIZE))
    return Outcome(
        1e6 * count / (SIZE[0] * SIZE[1]), note=f"{count} of 768 pixels; elsewhere |Δt| ≤ {off:.1e}"
    )
