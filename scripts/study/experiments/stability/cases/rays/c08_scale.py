"""Scene scaled by 2ᵏ, parameters too."""

from __future__ import annotations

from typing import Any

import numpy as np

from study.experiments.stability.cases import Outcome, Phase
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


def times(value: Any, factor: float) -> Any:
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
