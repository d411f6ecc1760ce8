"""The step cap, in a long gap between two planes: see CASE."""

from __future__ import annotations

from study.experiments.stability.cases import Case, Outcome, Phase
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


CASE = Case(
    number=4,
    name="step_cap",
    title="Step cap in a long thin gap",
    what="Three rays run along a gap between two parallel planes, 10 long, with a wall at its end: in the "
    "middle and nearer to either plane. The step cap is scene0's, 3000.",
    why="A sphere that fits into the gap is no larger than half of it, so the steps are short all the "
    "way, though nothing is in the ray's way. At the cap the march gives up and a hole shows where the "
    "wall should be. More precision does not help.",
    source="J. C. Hart, The Visual Computer 12 (1996), bounds the number of steps by the distance over "
    "the least step. Over-relaxation: Keinert et al., STAG 2014; enhanced step sizes: C. Bálint and G. "
    "Valasek, *Accelerating sphere tracing*, Eurographics 2018 (short papers).",
    known="By construction: the wall is at t = 10, and no ray meets the planes before.",
    strength="width of the gap, scene units",
    strengths=(2.0, 0.5, 0.1, 0.05, 0.03, 0.02, 0.01, 0.005, 0.002),
    metric="false misses of 3 rays",
    unit="rays",
    fails_above=0.0,
    limit="A missed wall is a hole; a hit elsewhere than at 10 ± 1e-4 (100 ε) counts as one.",
    run=run,
)
