"""Hard cases of surfaces: silhouettes, thin and coplanar shapes, edges, creases, rims."""

import functools
import math
from collections.abc import Iterator
from fractions import Fraction

import mpmath
import numpy as np

from study.experiments.stability.cases import Outcome, Phase
from study.experiments.stability.cases.exact import share
from study.experiments.stability.cases.fields import ALONE, DIGITS
from study.experiments.stability.cases.scenes import (
    angle_degrees,
    ball,
    depths,
    eye,
    found,
    ids,
    normals,
    one_ray,
    rays,
    scene,
    shape,
    worst,
)

# 2: the silhouette of a unit sphere
# Where the rays start, as multiples of the impact parameter: 3-4-5 and 5-12-13, as near as doubles come.
SIDES = ((1.0, 0.0), (0.0, -1.0), (0.6, 0.8), (-5 / 13, 12 / 13))


def starts(delta: float) -> list[tuple[float, float, bool]]:
    """x and y of each ray, which goes along z, and whether it meets the sphere: by the exact discriminant."""
    placed = []
    for x, y in SIDES:
        for b in (1.0 * (1 - delta), 1.0 * (1 + delta)):
            px, py = x * b, y * b
            placed.append((px, py, 1 - Fraction(px) ** 2 - Fraction(py) ** 2 > 0))
    return placed


def beside(x: float, y: float) -> dict:
    return scene([ball(1.0)], camera=eye([x, y, -5], [x, y, 0]))


def c02_silhouette(phase: Phase, delta: float) -> Outcome:
    seen = [(one_ray(phase, beside(x, y)).shape >= 0, meets) for x, y, meets in starts(delta)]
    false_hits = sum(hit and not meets for hit, meets in seen)
    false_misses = sum(meets and not hit for hit, meets in seen)
    return Outcome(false_hits + false_misses, note=f"{false_hits} false hits, {false_misses} false misses")


# 10: a plate and a wire of thickness 2⁻ᵏ
PLATE_SIZE = (8, 8)
DEGREES = [0, 0, 30]  # the plate is turned, so that its faces are along no axis
FACE = np.array([np.cos(np.radians(30)), -np.sin(np.radians(30)), 0])  # normal of the plate's face


def _thin(one: dict, camera: dict, thickness: float) -> dict:
    march = {"hit_distance": min(1e-6, max(1e-9, thickness / 8))}
    return scene([one], camera=camera, march=march)


def plate(thickness: float) -> dict:
    """A leaning plate that fills the picture, seen at an angle; ε is an eighth of its thickness."""
    box = shape("box", half_size=[thickness / 2, 8, 8], rotation_degrees=DEGREES)
    return _thin(box, eye([-4, 3, -1.5], [0, 0, 0], 20), thickness)


def wire(thickness: float) -> dict:
    """A ring of wire, met square in the middle of the wire by one ray."""
    ring = shape("torus", major_radius=1, minor_radius=thickness / 2)
    return _thin(ring, eye([1, 5, 0], [1, 0, 0], up=[0, 0, 1]), thickness)


def to_plate(thickness: float) -> tuple[np.ndarray, float]:
    """t of the plate's entry for each ray, (height, width), and on which side the camera is."""
    origin, directions = rays(plate(thickness), PLATE_SIZE)
    side = np.sign(FACE @ origin)
    return (side * thickness / 2 - FACE @ origin) / (directions @ FACE), side


def c10_thin_plate(phase: Phase, thickness: float) -> Outcome:
    picture, (t, side) = phase.render(plate(thickness), PLATE_SIZE), to_plate(thickness)
    hit = found(picture)
    wrong = ~hit | ~(np.abs(np.where(hit, depths(picture), np.inf) - t) <= 1e-5)
    angle = angle_degrees(normals(picture)[hit], side * FACE)
    wrong_wire = not abs(one_ray(phase, wire(thickness)).t - (5 - thickness / 2)) <= 1e-5
    note = f"{int((~hit).sum())} of 64 rays miss the plate, {int(wrong.sum())} are wrong"
    note += f"; normals up to {angle.max(initial=0):.1f}° off; the wire is {'lost' if wrong_wire else 'met'}"
    return Outcome(int(wrong.sum()) + wrong_wire, note=note)


# 11: a cone's rim, a box's edge and corner, an octahedron's crease and vertex
BOX, (BOTTOM, TOP, HALF), OCTAHEDRON = [1.0, 0.75, 0.5], (1.0, 0.5, 0.75), 1.0
AWAY = 4.0  # of the camera, along the face's normal


def spots(delta: float) -> Iterator[tuple[str, dict, np.ndarray, np.ndarray]]:
    """What it is, the shape, the point of the surface at `delta` from the edge, and the face's normal there.

    On both sides of each shape, since forward differences favour one.
    """
    box = shape("box", half_size=BOX)
    for sign in (1, -1):
        x, y, z = np.array(BOX) * [sign, sign, -1]
        yield "box edge", box, np.array([x - sign * delta, 0.1, z]), np.array([0, 0, -1.0])
        corner = np.array([x - sign * delta, y - sign * delta, z])
        yield "box corner", box, corner, np.array([0, 0, -1.0])
    cone = shape("cone", bottom_radius=BOTTOM, top_radius=TOP, half_height=HALF)
    for sign in (1, -1):
        across = np.array([0.8, 0, 0.6]) * sign
        yield "cone rim", cone, across * (TOP - delta) + [0, HALF, 0], np.array([0, 1.0, 0])
        slope = np.array([BOTTOM - TOP, 2 * HALF]) / np.hypot(BOTTOM - TOP, 2 * HALF)  # to the top: (−x, y)
        down = across * (TOP + delta * slope[0]) + [0, HALF - delta * slope[1], 0]
        yield "cone rim", cone, down, across * slope[1] + [0, slope[0], 0]
    octahedron = shape("octahedron", radius=OCTAHEDRON)
    for sign in (1, -1):
        face = np.full(3, sign / np.sqrt(3))
        height = delta / np.sqrt(1.5)  # over the crease z = 0; the face leans away from it
        rest = (OCTAHEDRON - height) / 2
        yield "octahedron crease", octahedron, sign * np.array([rest, rest, height]), face
        low = delta / np.sqrt(2)
        yield "octahedron vertex", octahedron, sign * np.array([OCTAHEDRON - 2 * low, low, low]), face


def facing(one: dict, point: np.ndarray, normal: np.ndarray) -> dict:
    """One ray square to the face, to that point."""
    up = [0, 0, 1] if abs(normal[2]) < 0.9 else [0, 1, 0]
    camera = eye((point + AWAY * normal).tolist(), point.tolist(), up=up)
    return scene([one], camera=camera, march={"normal_step": 1e-4})


def c11_edges(phase: Phase, delta: float) -> Outcome:
    names, angles, off = [], [], []
    for name, one, point, normal in spots(delta):
        met = one_ray(phase, facing(one, point, normal))
        if met.shape < 0:
            return Outcome(180.0, note=f"{name}: missed")
        names.append(name)
        off.append(abs(met.t - AWAY))
        angles.append(float(angle_degrees(met.normal, normal)))
    note = f"worst at the {names[int(np.argmax(angles))]}; |Δt| up to {worst(off):.1e}"
    return Outcome(worst(angles), note=note if worst(angles) != 0 else "")


# 12: the crease between two equal spheres
CREASE = 16  # pixels a side


def overlapping(pitch: float) -> dict:
    """Two spheres that overlap, seen so closely that pixels are `pitch` apart on their crease."""
    away = pitch * CREASE / (2 * math.tan(math.radians(5.0 / 2)))
    camera = eye([0, 0, -0.8 - away], [0, 0, 0], 5.0)
    return scene([ball(1, x, 0, 0) for x in (-0.6, 0.6)], camera=camera, march={"bounds_radius": 1000})


def c12_medial_axis(phase: Phase, strength: float) -> Outcome:
    picture = phase.render(overlapping(strength), (CREASE, CREASE))
    n, mirror = normals(picture), normals(picture)[:, ::-1] * [-1, 1, 1]
    stray = ids(picture) != np.where(np.arange(CREASE) < CREASE // 2, 0, 1)[None, :]
    angle = np.where(stray, 180.0, angle_degrees(n, mirror))
    with np.errstate(invalid="ignore"):  # ∞ − ∞ where the picture misses
        uneven = worst(np.abs(depths(picture) - depths(picture)[:, ::-1]))
    note = f"{int(stray.sum())} pixels on the wrong sphere, depth uneven by {uneven:.1e}"
    return Outcome(worst(angle), note=note if stray.any() else "")


# 17: rays that graze the rim of a torus's hole
RIM_SIZE, MAJOR, MINOR = (1, 9), 1.0, 0.4
REAL = mpmath.mpf("1e-20")


def above(x: float) -> dict:
    """Looking straight down at the rim of the hole, x from the axis."""
    camera = eye([x, 3, 0], [x, 0, 0], 1, up=[0, 0, 1])
    return scene([shape("torus", major_radius=MAJOR, minor_radius=MINOR)], camera=camera)


def first_root(origin: np.ndarray, direction: np.ndarray) -> float:
    """The smallest t > 0 on the torus, +inf if there is none: the roots of its quartic in 60 digits."""
    with mpmath.workdps(DIGITS):
        o, d = ([mpmath.mpf(float(x)) for x in v] for v in (origin, direction))
        big, small = mpmath.mpf(MAJOR), mpmath.mpf(MINOR)
        dd, od, oo = (
            mpmath.fsum(a * b for a, b in zip(u, v, strict=True)) for u, v in ((d, d), (o, d), (o, o))
        )
        k = oo + big**2 - small**2
        flat = [d[0] ** 2 + d[2] ** 2, o[0] * d[0] + o[2] * d[2], o[0] ** 2 + o[2] ** 2]
        quartic = [
            dd**2,
            4 * dd * od,
            4 * od**2 + 2 * dd * k - 4 * big**2 * flat[0],
            4 * od * k - 8 * big**2 * flat[1],
            k**2 - 4 * big**2 * flat[2],
        ]
        roots = mpmath.polyroots(quartic[::-1], maxsteps=400, extraprec=400, asc=True)
        real = [mpmath.re(r) for r in roots if abs(mpmath.im(r)) < REAL and mpmath.re(r) > 0]
        return float(min(real)) if real else np.inf


@functools.cache
def _to_rim(x: float) -> np.ndarray:
    origin, directions = rays(above(x), RIM_SIZE)
    return np.array([[first_root(origin, d) for d in row] for row in directions])


def to_rim(x: float) -> np.ndarray:
    with ALONE:
        return _to_rim(x)


def c17_torus_rim(phase: Phase, strength: float) -> Outcome:
    wrong, dt = [], [0.0]
    for side in (-1, 1):
        x = MAJOR - MINOR + side * 2.0**-strength
        picture, known = phase.render(above(x), RIM_SIZE), to_rim(x)
        hit = found(picture)
        wrong.append(hit != np.isfinite(known))
        both = hit & np.isfinite(known)
        dt.append(worst(np.abs(depths(picture)[both] - known[both])))
    return Outcome(share(np.array(wrong)), note=f"largest |Δt| of the right hits {worst(np.array(dt)):.1e}")


# 25: one surface a hair before another (z-fighting)
FAR, NEAR = 0, 1  # the farther is the first, so that it wins a tie


def layers(gap: float) -> dict:
    """A tilted wall, and a box turned so that its face lies `gap` before it."""
    back = shape("plane", normal=[0, -0.6, -0.8], offset=-4, material="other")
    # A face square to (0, −0.6, −0.8), half a thickness of 1 behind its surface: about x, (y, z) →
    # (c·y − s·z, s·y + c·z) takes (0, 0.6, 0.8) to (0, 0, 1).
    centre = [0.0, 0.6 * (5 - gap), 0.8 * (5 - gap)]
    turn = float(np.degrees(np.arctan2(0.6, 0.8)))
    box = shape("box", half_size=[6, 6, 1], position=centre, rotation_degrees=[turn, 0, 0])
    return scene([back, box], camera=eye([0, 0, 0], [0.1, 0.6, 0.8], 50))


def c25_coplanar(phase: Phase, strength: float) -> Outcome:
    return Outcome(share(ids(phase.render(layers(strength), (32, 18))) != NEAR))
