"""Shadow and reflection of a convex shape on itself."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Outcome, Phase
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
