"""Hard case 20."""

from __future__ import annotations

import functools
import json
import math
import subprocess
import threading

import numpy as np

from study.core import registry
from study.experiments.stability.cases import Case, Outcome, Phase
from study.experiments.stability.cases.scenes import scene, shape

SHAPES = {
    "sphere": {"radius": 1},
    "torus": {"major_radius": 1, "minor_radius": 0.4},
    "cone": {"bottom_radius": 1, "top_radius": 0.5, "half_height": 1},
    "mandelbulb": {"power": 8, "iterations": 1, "bailout": 4},
}


ALONE = threading.Lock()  # cases run in threads; two makes would write the same file


@functools.cache
def table() -> dict | str:
    """What this CPU's rsqrt instructions give (common/tools/rsqrt.c), or why that is not known."""
    path = "build/rsqrt"
    try:
        with ALONE:
            made = subprocess.run(
                ["make", "-s", "-C", str(registry.ROOT), path], capture_output=True, text=True
            )
        if made.returncode != 0:
            return "the table program does not build"
        done = subprocess.run([registry.ROOT / path], capture_output=True, text=True, timeout=60)
        return json.loads(done.stdout)
    except (OSError, ValueError, subprocess.TimeoutExpired) as error:
        return f"no table of this CPU: {error}"


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


def run(phase: Phase, strength: float) -> Outcome:
    error, worst_of = 0.0, ""
    for kind, sizes in SHAPES.items():
        if kind == "mandelbulb" and strength < 20:
            continue  # the closed form is for points so near that their eighth power vanishes
        points, known = at_centre(kind, 2.0**-strength)
        got = phase.distances(scene([shape(kind, **sizes)]), points)
        off = np.abs(got - known)
        this = float(np.max(np.where(np.isfinite(got), off, np.inf)))
        if this > error:
            error, worst_of = this, kind
    found = table()
    said = (
        found
        if isinstance(found, str)
        else f"rsqrtps of this {found['vendor']} CPU: table {found['rsqrtps']['hash']}"
    )
    return Outcome(error, note=f"{worst_of + ', ' if worst_of else ''}{said}")


CASE = Case(
    number=20,
    name="reciprocal_roots",
    title="1/√0, and reciprocal roots that differ by CPU",
    what="Distances at the centres and on the axes of sphere, torus, cone and Mandelbulb, at points 2^−k "
    "off, down to the point itself. Beside it a program tabulates rsqrtss, rsqrtps and, where the CPU has "
    "them, rsqrt14: their special values, and a hash over one result for every mantissa and both parities "
    "of the exponent.",
    why="There √x is taken of zero or of a square that has underflowed. A phase that writes √x as "
    "x·rsqrt(x) gets 0·∞ = NaN; below 2^−63 the square is a denormal float, which rsqrt takes for zero. "
    "The instruction's 12 bits are not the same bits on every maker's CPU, so neither would pictures be.",
    source="Intel 64 and IA-32 Architectures Software Developer's Manual, RSQRTSS (1999, SSE): relative "
    "error at most 1.5·2^−12, denormals taken for zero, no value prescribed; IEEE 754 for √.",
    known="Closed forms in double at these points; for the instructions, the manual's special values and "
    "bound.",
    strength="k: points are 2^−k off the centre, from 1075 on they are the centre",
    strengths=(2, 10, 20, 40, 63, 70, 75, 126, 149, 540, 1074, 1100),
    metric="largest error of a distance",
    unit="scene units",
    fails_above=1e-5,
    limit="Ten of the usual hit distance, on shapes of size 1.",
    run=run,
)
