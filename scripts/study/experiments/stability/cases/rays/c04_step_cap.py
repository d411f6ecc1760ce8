"""Step cap in a long thin gap."""

from __future__ import annotations

from study.experiments.stability.cases import Outcome, Phase
from study.experiments.stability.cases.scenes import found, scene, shape

LENGTH, MAX_STEPS = 10.0, 3000
HEIGHTS = (0.0, 0.25, -0.375)  # of the rays, as shares of the gap, from its middle


def gap(width: float, share: float) -> dict:
    """Two planes of that distance, a wall square to them, and a ray that runs along the gap."""
    y = share * width
    return scene(
        [
            shape("plane", normal=[0, 1, 0], offset=-width / 2),
            shape("plane", normal=[0, -1, 0], offset=-width / 2),
            shape("plane", normal=[0, 0, -1], offset=-LENGTH, material="other"),
        ],
        camera={"position": [0, y, 0], "look_at": [0, y, 1]},
        march={"max_steps": MAX_STEPS},
    )


def steps_needed(width: float, share: float) -> float:
    """Evaluations of an exact march to the end: each step is the distance to the nearer plane."""
    return LENGTH / ((0.5 - abs(share)) * width) + 1


def run(phase: Phase, width: float) -> Outcome:
    missed, evals = 0, 0
    for share in HEIGHTS:
        picture = phase.render(gap(width, share), (1, 1))
        hit = found(picture)[0, 0] and picture["id"][0, 0] == 2
        missed += not (hit and abs(float(picture["Z"][0, 0]) - LENGTH) <= 1e-4)
        evals = max(evals, int(picture["evals"][0, 0]))
    needed = max(steps_needed(width, share) for share in HEIGHTS)
    return Outcome(missed, note=f"up to {evals} evaluations; plain sphere tracing needs {needed:.0f}")
