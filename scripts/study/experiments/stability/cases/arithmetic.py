"""Hard cases of arithmetic: scenes moved, scaled or of unlike sizes, roots of 0, other compilers."""

import functools
import math
from typing import Any

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, builds, exact
from study.experiments.stability.cases.exact import share
from study.experiments.stability.cases.scenes import (
    ball,
    depths,
    eye,
    floor,
    found,
    ids,
    rays,
    scene,
    shape,
    worst,
)
from study.pictures.images import Picture

SIZE = (32, 24)

# 7: camera and scene shifted by 2ᵏ. Positions are multiples of 1/16, so that each shifted number is exact in
# double; nothing that a bound could hide is in the scene.
REACH, AGREES = 32.0, 1e-4  # beyond every shape; largest |Δt|
SHIFTED = (
    shape("box", half_size=[4, 0.25, 4], position=[0, -1.5, 1]),
    ball(1.0, -1.25, 0, 0.5, material="other"),
    shape("torus", major_radius=0.75, minor_radius=0.25, position=[1.25, -0.25, 0])
    | {"rotation_degrees": [60, 20, 0]},
    shape("cone", bottom_radius=0.5, top_radius=0.25, half_height=0.5, position=[0, -0.5, -1.5]),
    shape("octahedron", radius=0.75, position=[0.25, 1, 1.5]),
)


def shifted(k: int | None) -> dict:
    """The scene, moved by (2ᵏ, 2ᵏ, 2ᵏ); None: not moved."""
    by = 0.0 if k is None else 2.0**k

    def moved(point: list[float]) -> list[float]:
        return [x + by for x in point]

    return scene(
        [one | {"position": moved(one["position"])} for one in SHIFTED],
        camera=eye(moved([0, 0.5, -6]), moved([0, -0.25, 0])),
        light={"position": moved([3, 6, -5])},
        march={"bounds_radius": REACH + 2 * by},
    )


def c07_camera_shift(phase: Phase, k: float) -> Outcome:
    """Pixels whose shape (or miss) differs, or t by more than AGREES."""
    a, b = (phase.render(shifted(by), SIZE) for by in (None, int(k)))
    both = found(a) & found(b) & (ids(a) == ids(b))
    off = np.abs(np.where(both, depths(a), 0) - np.where(both, depths(b), 0))
    wrong = (ids(a) != ids(b)) | ~(off <= AGREES)
    note = f"{int(wrong.sum())} of 768 pixels; elsewhere |Δt| ≤ {off[~wrong].max(initial=0):.1e}"
    return Outcome(1e6 * int(wrong.sum()) / wrong.size, note=note)


# 8: the scene scaled by 2ᵏ, parameters too
LENGTHS = ("radius", "half_size", "major_radius", "minor_radius", "bottom_radius", "top_radius",
           "half_height", "rounding", "offset", "position", "repeat")  # fmt: skip
SHAPES = (
    floor(-24),
    shape("box", half_size=[8, 6, 8], position=[-20, -8, 64], rotation_degrees=[20, 40, 0]),
    ball(10, 4, -6, 56, material="mirror"),
    shape("torus", major_radius=8, minor_radius=3, position=[22, 4, 60], rotation_degrees=[60, 20, 0]),
    shape("cone", bottom_radius=6, top_radius=3, half_height=7, position=[-8, 8, 80], material="other"),
    shape("octahedron", radius=5, position=[0, 0, 96], repeat=[16, 0, 0], material="other"),
)
# Powers of two, so that they are scaled exactly, and as large as the format lets the scaled ones be.
MARCH = {"hit_distance": 2.0**-10, "bounds_radius": 256.0, "normal_step": 2.0**-7, "surface_offset": 2.0**-6}


def times(value: Any, factor: float) -> Any:
    return [x * factor for x in value] if isinstance(value, (list, tuple)) else value * factor


def scaled(k: int) -> dict:
    """Every length times 2ᵏ; fog falls with the cube of lengths, light with their inverse."""
    s = 2.0**k
    shapes = [{key: times(v, s) if key in LENGTHS else v for key, v in one.items()} for one in SHAPES]
    light = {"position": times((60, -12, 20), s), "emission": [256.0 * s] * 3, "shadows": "soft"}
    return scene(
        shapes,
        camera=eye(times((0, 4, 0), s), times((0, -2, 64), s), 50),
        light=light,
        march={key: value * s for key, value in MARCH.items()},
        fog=2.0**-28 / s**3,
        background=[0.1, 0.1, 0.2],
    )


def c08_scale(phase: Phase, k: float) -> Outcome:
    plain, most, notes = phase.render(scaled(0), SIZE), 0.0, []
    for sign in (1, -1):
        by = sign * int(k)
        other = phase.render(scaled(by), SIZE)
        differ = {
            name: plane * np.float32(2.0 ** (by if name == "Z" else 0)) != other[name]
            for name, plane in plain.items()
        }
        part = float(np.any(list(differ.values()), axis=0).mean())
        most = max(most, 1e6 * part)
        if part:
            planes = ", ".join(f"{name} {int(d.sum())}" for name, d in sorted(differ.items()) if d.any())
            notes.append(f"2^{by}: of 768 pixels {planes}")
    return Outcome(most, note="; ".join(notes))


# 20: 1/√0, and reciprocal roots that differ by CPU
ROOTS: dict[str, dict[str, float]] = {
    "sphere": {"radius": 1},
    "torus": {"major_radius": 1, "minor_radius": 0.4},
    "cone": {"bottom_radius": 1, "top_radius": 0.5, "half_height": 1},
    "mandelbulb": {"power": 8, "iterations": 1, "bailout": 4},
}


def at_centre(kind: str, off: float) -> tuple[np.ndarray, np.ndarray]:
    """Points off the centre by `off` along each axis and in all, and their distances, in double."""
    p = np.array([(off, 0, 0), (0, off, 0), (0, 0, off), (-off, off, 0.5 * off), (-0.0, -off, -0.0)])
    ring, length = np.hypot(p[:, 0], p[:, 2]), np.hypot(np.hypot(p[:, 0], p[:, 1]), p[:, 2])
    if kind == "sphere":
        return p, length - 1
    if kind == "torus":
        return p, np.hypot(ring - 1, p[:, 1]) - 0.4
    if kind == "cone":  # to the side, along its normal, or to a cap
        side = (0.75 - 0.25 * p[:, 1] - ring) / math.hypot(0.25, 1)
        return p, -np.minimum(side, 1 - np.abs(p[:, 1]))
    # 1 iteration from so near: |w| is |p|, and the derivative 1
    return p, np.where(length > 0, 0.5 * np.log(np.where(length > 0, length, 1)) * length, 0)


def c20_reciprocal_roots(phase: Phase, strength: float) -> Outcome:
    errors = {}
    for kind, sizes in ROOTS.items():
        if kind == "mandelbulb" and strength < 20:
            continue  # the closed form is for points so near that their eighth power vanishes
        points, known = at_centre(kind, 2.0**-strength)
        got = phase.distances(scene([shape(kind, **sizes)]), points)
        errors[kind] = float(np.max(np.where(np.isfinite(got), np.abs(got - known), np.inf)))
    error = max(errors.values())
    return Outcome(error, note=max(errors, key=lambda kind: errors[kind]) if error else "")


# 21: fused multiply-adds, gcc against clang
def twins(k: float) -> dict:
    """A box and an octahedron over a floor, and inside each its twin: a quarter turn on, 2^−k smaller."""
    less = 1 - 2.0**-k
    inner = {"half_size": [x * less for x in (1.0, 0.8, 0.6)], "rotation_degrees": [15, 40, 95]}
    box = shape("box", half_size=[0.8, 1.0, 0.6], position=[0.9, 0, 0], rotation_degrees=[15, 40, 5])
    eight = shape("octahedron", radius=1.1, position=[-1.1, 0.1, 0], rotation_degrees=[35, 20, 10])
    small = {"radius": 1.1 * less, "rotation_degrees": [35, 20, 100]}
    other = {"material": "other"}
    shapes = [box | inner | other, box, eight | small | other, eight, floor(-1.2)]
    return scene(shapes, camera=eye([0, 0.6, -5], [0, 0, 0]), light={"shadows": "soft"})


def differing_bits(a: Picture, b: Picture) -> np.ndarray:
    return np.any([a[name].view(np.uint32) != b[name].view(np.uint32) for name in a], axis=0)


def c21_contraction(phase: Phase, strength: float) -> Outcome:
    whole = twins(strength)
    shipped = phase.render(whole, (48, 27))
    others = {"contracted": builds.contracted(phase), "clang": builds.clang(phase)}
    most, notes, bad = 0.0, [], 0
    for title, built in others.items():
        if built is None:
            notes.append(
                f"{title}: not compared: no compiler (or FMA), or its parent is asked, whose code it is"
            )
            continue
        made = built.render(whole, (48, 27))
        bits, shapes = share(differing_bits(shipped, made)), share(ids(shipped) != ids(made))
        most, bad = max(most, shapes), bad + built.non_finite
        notes.append(f"{title}: a bit differs in {bits:.1f} % of the pixels, the shape in {shapes:.2f} %")
    return Outcome(most, bad, "; ".join(notes))


# 22: a grain before a planet
GRAIN_SIZE = (32, 32)


def side_by_side(k: float) -> dict:
    """A grain of radius 10^−k before a ball of radius 10^k, all at the grain's scale."""
    grain, planet = 10.0**-k, 10.0**k
    shapes = [
        ball(grain, 0.4 * grain, -0.3 * grain, 20 * grain),
        ball(planet, 0, 0, 40 * grain + planet, material="other"),
    ]
    march = {"hit_distance": max(1e-4 * grain, 1e-9), "normal_step": max(1e-3 * grain, 1e-9)}
    return scene(shapes, camera=eye([0, 0, 0], [0, 0, 1], 10), march=march)


@functools.cache
def sizes_truth(k: float) -> tuple[np.ndarray, np.ndarray]:
    """t and shape of each ray."""
    whole = side_by_side(k)
    return exact.balls(whole, *rays(whole, GRAIN_SIZE))


def c22_sizes(phase: Phase, strength: float) -> Outcome:
    picture = phase.render(side_by_side(strength), GRAIN_SIZE)
    t, shapes = sizes_truth(strength)
    wrong = ids(picture) != shapes
    missed = int((~found(picture) & (shapes >= 0)).sum())
    right = ~wrong & (shapes >= 0)
    dt = worst(np.abs(depths(picture)[right] - t[right]) * 10.0**strength)
    note = f"{missed} false misses, largest |Δt| of the others {dt:.1e} radii of the grain"
    return Outcome(share(wrong), note=note)
