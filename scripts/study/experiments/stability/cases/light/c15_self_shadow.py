"""Hard case 15."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase
from study.experiments.stability.cases.exact import share
from study.experiments.stability.cases.scenes import found, scene, shape

SIZE = (32, 32)
MATERIALS = {
    "matte": {"color": [0.6, 0.5, 0.4], "reflectivity": 0, "shininess": 15},
    "mirror": {"color": [0.6, 0.5, 0.4], "reflectivity": 1, "shininess": 15},
}
CONVEX = {
    "sphere": {"radius": 1},
    "box": {"half_size": [0.8, 0.6, 0.7], "rotation_degrees": [20, 30, 10]},
}


def convex(kind: str, offset: float, material: str, shadows: str) -> dict:
    return scene(
        [shape(kind, **CONVEX[kind]) | {"material": material}],
        materials=MATERIALS,
        march={"surface_offset": offset},
        light={"shadows": shadows},
        camera={"vertical_fov_degrees": 26},
    )


def run(phase: Phase, strength: float) -> Outcome:
    acne, hits, notes = 0, 0, []
    for kind in CONVEX:
        plain = phase.render(convex(kind, strength, "matte", "none"), SIZE)
        full = phase.render(convex(kind, strength, "mirror", "hard"), SIZE)
        hit = found(plain)
        off = np.zeros(hit.shape, bool)
        for name in "RGB":
            off |= ~(np.abs(full[name] - plain[name]) <= 1e-3 * np.abs(plain[name]))
        acne, hits = acne + int((off & hit).sum()), hits + int(hit.sum())
        notes.append(f"{kind} {share(off[hit]):.2f} %")
    return Outcome(100 * acne / hits, note=", ".join(notes))


CASE = Case(
    number=15,
    name="self_shadow",
    title="Shadow and reflection of a convex shape on itself",
    what="A lit sphere, and a turned box, alone: once without shadows and matt, once as a perfect mirror "
    "with hard shadows on. The distance at which secondary rays start is made smaller and smaller; the hit "
    "distance stays 1e-6.",
    why="A secondary ray starts near the very surface it leaves. Too near, and the surface is hit again at "
    "once: shadow acne, and a mirror that shows itself. The hit's own error decides how near is too near.",
    source="T. Akenine-Möller, E. Haines, N. Hoffman and others, Real-Time Rendering, on shadow acne and "
    "bias; C. Wächter and N. Binder, A fast and robust method for avoiding self-intersection, Ray Tracing "
    "Gems (2019), chapter 6; still reported, as in mitsuba3 issue 1236 (2024, a small sphere) and SORT "
    "issue 117 (2020, axis-aligned walls).",
    known="A convex shape neither shadows nor sees itself: the two pictures are equal.",
    strength="surface_offset, scene units",
    strengths=(1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 3e-6, 1e-6),
    metric="hit pixels whose colour differs by more than 0.1 %",
    unit="%",
    fails_above=0.5,
    limit="Where light grazes at a sine below hit_distance/surface_offset a march of these two parameters "
    "is in shadow by definition: 0.1 % of a sphere's sight at 1e-3. Half a percent is speckle that is "
    "seen.",
    run=run,
)
