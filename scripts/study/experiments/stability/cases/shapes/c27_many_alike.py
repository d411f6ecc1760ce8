"""Hard case 27."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase, exact
from study.experiments.stability.cases.scenes import scene, shape

SIZE = (16, 9)
TORUS = {"major_radius": 1, "minor_radius": 0.4, "rotation_degrees": [50, 10, 30]}


def alike(count: float) -> dict:
    return scene(
        [shape("torus", **TORUS) for _ in range(int(count))],
        light={"shadows": "hard"},
        camera={"vertical_fov_degrees": 40},
    )


def run(phase: Phase, strength: float) -> Outcome:
    one, many = phase.render(alike(1), SIZE), phase.render(alike(strength), SIZE)
    differs = np.zeros(one["R"].shape, bool)
    for name in one:
        differs |= one[name].view(np.uint32) != many[name].view(np.uint32)
    return Outcome(exact.share(differs))


CASE = Case(
    number=27,
    name="many_alike",
    title="Thousands of equal shapes in one place",
    what="One torus, and up to 4096 of it in the same place, the most that the format allows.",
    why="Nothing tells the shapes apart: a hierarchy over them cannot split and becomes a list or recurses "
    "without end, and every point is at the same distance from all.",
    source="godot pull request 109514 (2025: equal centres made every operation of the tree linear, its "
    "construction quadratic); obvhs pull request 5 (2025: overlapping instances overflowed the depth of "
    "the tree).",
    known="The union of equal shapes is the shape, and the first of equals is the one that counts: the "
    "same picture bit for bit, with id 0.",
    strength="number of shapes",
    strengths=(1, 8, 64, 512, 4096),
    metric="pixels in which any bit of any channel differs",
    unit="%",
    fails_above=0.0,
    limit="The same numbers enter the same arithmetic.",
    run=run,
)
