"""The silhouette of a sphere: see CASE."""

from __future__ import annotations

from fractions import Fraction

from study.experiments.stability.cases import Case, Outcome, Phase
from study.experiments.stability.cases.scenes import found, scene, shape

RADIUS = 1.0
# Where the rays start, as multiples of the impact parameter: 3-4-5 and 5-12-13, as near as doubles come.
SIDES = ((1.0, 0.0), (0.0, -1.0), (0.6, 0.8), (-5 / 13, 12 / 13))


def starts(delta: float) -> list[tuple[float, float, bool]]:
    """x and y of each ray, which goes along z, and whether it meets the sphere: by the exact discriminant."""
    placed = []
    for x, y in SIDES:
        for b in (RADIUS * (1 - delta), RADIUS * (1 + delta)):
            px, py = x * b, y * b
            discriminant = Fraction(RADIUS) ** 2 - Fraction(px) ** 2 - Fraction(py) ** 2
            placed.append((px, py, discriminant > 0))
    return placed


def beside(x: float, y: float) -> dict:
    camera = {"position": [x, y, -5], "look_at": [x, y, 0]}
    return scene([shape("sphere", radius=RADIUS)], camera=camera)


def run(phase: Phase, delta: float) -> Outcome:
    false_hits = false_misses = 0
    for x, y, meets in starts(delta):
        hit = bool(found(phase.render(beside(x, y), (1, 1)))[0, 0])
        false_hits += hit and not meets
        false_misses += meets and not hit
    return Outcome(false_hits + false_misses, note=f"{false_hits} false hits, {false_misses} false misses")


CASE = Case(
    number=2,
    name="silhouette",
    title="Silhouette of a sphere",
    what="Eight parallel rays past a unit sphere: from four sides, one a share δ of the radius inside its "
    "silhouette and one as much outside.",
    why="Near the silhouette the ray is tangent to the surface: the march crawls, and hit or miss hangs "
    "on the last digits of the ray's distance from the centre. Below δ = ε a march must call the outer "
    "ray a hit, whatever its precision: that is the method's own error, not the arithmetic's.",
    source="J. C. Hart, D. J. Sandin and L. H. Kauffman, *Ray tracing deterministic 3-D fractals*, "
    "SIGGRAPH 1989, end a march at a distance ε, which thickens every shape by ε. For the quadratic "
    "formula: E. Haines, J. Günther and T. Akenine-Möller, *Precision improvements for ray/sphere "
    "intersection*, Ray Tracing Gems (2019).",
    known="The sign of R² − x² − y², in rational arithmetic, of the numbers the scene file holds.",
    strength="δ, share of the radius",
    strengths=tuple(2.0**-k for k in (3, 8, 12, 16, 18, 19, 20, 22, 26, 32, 40)),
    metric="false hits and misses of 8 rays",
    unit="rays",
    fails_above=0.0,
    limit="Hit or miss is a yes or a no: any wrong ray is a wrong pixel.",
    run=run,
)
