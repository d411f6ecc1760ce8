"""The scene scaled by 2ᵏ, parameters too: see CASE."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase
from study.experiments.stability.cases.scenes import scene, shape

SIZE = (32, 24)
LENGTHS = ("radius", "half_size", "major_radius", "minor_radius", "bottom_radius", "top_radius",
           "half_height", "rounding", "offset", "position", "repeat")  # fmt: skip
SHAPES = (
    shape("plane", normal=[0, 1, 0], offset=-24),
    shape("box", half_size=[8, 6, 8], position=[-20, -8, 64], rotation_degrees=[20, 40, 0]),
    shape("sphere", radius=10, position=[4, -6, 56], material="mirror"),
    shape("torus", major_radius=8, minor_radius=3, position=[22, 4, 60], rotation_degrees=[60, 20, 0]),
    shape("cone", bottom_radius=6, top_radius=3, half_height=7, position=[-8, 8, 80], material="other"),
    shape("octahedron", radius=5, position=[0, 0, 96], repeat=[16, 0, 0], material="other"),
)
CAMERA, LOOK_AT, LIGHT, EMISSION = [0.0, 4.0, 0.0], [0.0, -2.0, 64.0], [60.0, -12.0, 20.0], [256.0] * 3
# Powers of two, so that they are scaled exactly, and as large as the format lets the scaled ones be.
MARCH = {"hit_distance": 2.0**-10, "bounds_radius": 256.0, "normal_step": 2.0**-7, "surface_offset": 2.0**-6}
FOG = 2.0**-28
LARGEST = 19  # of |k|: ε·2⁻¹⁹ is still above the format's least length, the bounds below its largest


def times(value: object, factor: float) -> object:
    return [x * factor for x in value] if isinstance(value, list) else value * factor


def scaled(k: int) -> dict:
    """Every length times 2ᵏ; fog falls with the cube of lengths, light with their inverse."""
    s = 2.0**k
    shapes = [{key: times(v, s) if key in LENGTHS else v for key, v in one.items()} for one in SHAPES]
    return scene(
        shapes,
        camera={"position": times(CAMERA, s), "look_at": times(LOOK_AT, s), "vertical_fov_degrees": 50},
        light={"position": times(LIGHT, s), "emission": times(EMISSION, s), "shadows": "soft"},
        march={key: value * s for key, value in MARCH.items()},
        fog=FOG / s**3,
        background=[0.1, 0.1, 0.2],
    )


def run(phase: Phase, k: float) -> Outcome:
    plain, worst, notes = phase.render(scaled(0), SIZE), 0.0, []
    for sign in (1, -1):
        other = phase.render(scaled(sign * int(k)), SIZE)
        differ = {name: plain[name] != other[name] for name in plain if name != "Z"}
        differ["Z"] = plain["Z"] * np.float32(2.0 ** (sign * int(k))) != other["Z"]
        share = float(np.any(list(differ.values()), axis=0).mean())
        worst = max(worst, 1e6 * share)
        if share:
            planes = ", ".join(f"{name} {int(d.sum())}" for name, d in sorted(differ.items()) if d.any())
            notes.append(f"2^{sign * int(k)}: of 768 pixels {planes}")
    return Outcome(worst, note="; ".join(notes))


CASE = Case(
    number=8,
    name="scale",
    title="Scene scaled by 2ᵏ, parameters too",
    what="Six shapes with rotation, repetition, a mirror, soft shadows and fog. Every length of the file, "
    "ε and the other limits among them, is multiplied by 2ᵏ and by 2⁻ᵏ; the light, which falls off with "
    "1/distance, is multiplied too, and the fog divided by the cube.",
    why="Powers of two change the exponents of floating-point numbers and nothing else, so not a bit of "
    "the picture may change, unless a phase has a constant in it that is a length: an epsilon of its "
    "own, a clamp, a sentinel like 1e20, or an exponent that leaves the range of float.",
    source="That a power of two changes the exponent and not the significand: D. Goldberg, *What every "
    "computer scientist should know about floating-point arithmetic*, ACM Computing Surveys 23 (1991), in "
    "the proof of theorem 7. A constant that is a length, found by scaling: BeamletOptics.jl issue 51 "
    "(2026), on sphere tracing from a surface. As a test by a relation of two outputs: T. Y. Chen, "
    "S. C. Cheung and S. M. Yiu, *Metamorphic testing*, HKUST-CS98-01 (1998); on graphics: A. F. Donaldson "
    "and A. Lascu, *Metamorphic testing for (graphics) compilers*, MET 2016. For this scaling of a renderer "
    "we know of no first description.",
    known="The same phase's picture at k = 0; every number is scaled exactly. Depth is compared after "
    "scaling.",
    strength="|k| of the factor 2ᵏ",
    strengths=(1, 2, 4, 7, 10, 13, 16, LARGEST),
    metric="pixels with any bit changed",
    unit="ppm",
    fails_above=0.0,
    limit="Scaling by a power of two rounds nothing, so anything above 0 is a constant in the phase.",
    run=run,
)
