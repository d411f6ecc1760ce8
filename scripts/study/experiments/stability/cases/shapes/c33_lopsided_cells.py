"""Hard case 33."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape

SIZE, CELL, BOTTOM, HALF = (48, 48), 1.4, 0.9, 0.5
COPIES = range(-8, 9)


def stack(ratio: float) -> dict:
    """A column of cones, each wide below and narrow above, seen slantwise from below."""
    cone = shape(
        "cone", bottom_radius=BOTTOM, top_radius=BOTTOM / ratio, half_height=HALF, repeat=[0, CELL, 0]
    )
    camera = {"position": [0, -3.3, -3], "look_at": [0, 0, 0], "vertical_fov_degrees": 40}
    return scene([cone], camera=camera)


def run(phase: Phase, strength: float) -> Outcome:
    whole = stack(strength)
    origin, directions = rays(whole, SIZE)
    top = BOTTOM / strength
    t, _ = exact.nearest(
        *(exact.cone(origin, directions, [0, CELL * i, 0], BOTTOM, top, HALF) for i in COPIES)
    )
    seen = np.isfinite(t) & (t < 12)  # what lies further is smaller than a pixel's care
    picture = phase.render(whole, SIZE)
    missed = seen & (picture["id"] < 0)
    wrong = seen & ~(np.abs(picture["Z"] - np.where(seen, t, 0).astype(float)) <= 1e-2)
    return Outcome(
        exact.share(wrong[seen]), note=f"{int(missed.sum())} pixels see through a cone" * bool(missed.any())
    )


CASE = Case(
    number=33,
    name="lopsided_cells",
    title="Repetition of a shape that is not its own mirror image",
    what="A cone, repeated along its axis, seen slantwise from below: over each narrow top hangs the wide "
    "bottom of the next. Every cone fits its cell. The narrower the top, the more lopsided the cone.",
    why="A repeated shape is asked for its distance in one cell only. Under the cell's upper face the "
    "point still sees its own narrow top, far off, and not the wide bottom just across: the step is too "
    "long, into the next cone or through it.",
    source="pouet.net topic 11363, Domain repetition artifact (2018), which explains it; I. Quilez, domain "
    "repetition (iquilezles.org/articles/sdfrepetition), on neighbours and mirrored cells.",
    known="Ray against each of the cones of the column, analytic.",
    strength="bottom radius in top radii (1: a cylinder, its own mirror image)",
    strengths=(1, 1.2, 1.5, 2, 4, 9, 30),
    metric="pixels of the column whose depth is off by more than 1e-2, or that miss it",
    unit="%",
    fails_above=0.0,
    limit="A hundredth of a unit is far above the hit distance of 1e-6: such a ray has stepped into a "
    "shape. The failure is the method's.",
    run=run,
)
