"""The paper's own rule of counting FLOPs: the calls of each function times the FLOPs of that function.

Its text (P1, section 2, "Cost Analysis"): the FLOPs of each function are counted by hand, one for a call of
math.h; the program counts calls; the product is the cost. A call of the Mandelbulb's distance function then
has all iterations of its loop, though most calls leave it early. What we count instead, iterations as they
are entered, stands beside. Functions without such a loop cost the same by both.
"""

from __future__ import annotations

from typing import Any

from study.core import registry
from study.core.cli import StudyError
from study.counting import costs, flops
from study.counting.decode import FLOPS

BULB = "sdf_mandelbulb"
OTHERS = "bulb_"  # how the functions begin that evaluate it in pieces
LOOPS = ("step", "iteration")  # names of the loop's part in costs.def
ALWAYS = ("off_axis",)  # parts of an iteration that are left out on the axis only
CALLED = {"baseline": ("vec_dot",), "opt1": ("vec_add", "vec_dot")}  # functions that an iteration calls

Row = dict[str, Any]


def flop(one: Row) -> int | None:
    """FLOPs of a counted picture by the rule.

    None where a Mandelbulb's evaluation is not one function with a loop in it, as in later phases, where two
    Mandelbulbs differ in iterations, or where the scene or the phase is not known here.
    """
    total, functions = one["flops"]["paper"], one.get("by_function", {})
    iterations = _iterations(one["scene"])
    if not iterations:
        return total if iterations is not None else None
    parts = functions.get(BULB, {}).get("parts", {})
    loop = next((name for name in LOOPS if name in parts), None)
    elsewhere = any(name.startswith(OTHERS) and of["calls"] for name, of in functions.items())
    if loop is None or elsewhere or len(iterations) > 1:
        return None
    try:
        lines = costs.read(registry.find_phase(one["phase"]).file("costs.def"))
    except StudyError:
        return None
    per_lane = {(line.function, line.part): _flop(line) for line in lines}
    width = {line.part: line.width for line in lines if line.function == BULB}.get(loop)
    if width is None:
        return None
    step = sum(per_lane.get((BULB, part), 0) for part in (loop, *ALWAYS))
    step += sum(per_lane[name, "call"] for name in CALLED.get(one["phase"], ()))
    lanes = flops.lanes_of(one) if width == "LANES" else 1
    return total + (max(iterations) * parts["call"] - parts[loop]) * step * lanes


def convention(one: Row) -> int:
    """The same with iterations as they were entered: one FLOP for a call of math.h."""
    return one["flops"]["paper"]


def _iterations(scene: str) -> set[int] | None:
    """Iterations of the scene's Mandelbulbs; None for a scene that is not known."""
    if scene not in registry.scenes():
        return None
    shapes = registry.find_scene(scene).data["shapes"]
    return {shape["iterations"] for shape in shapes if shape["type"] == "mandelbulb"}


def _flop(line: costs.Cost) -> int:
    """Of one lane: one for a call of math.h, none for a comparison."""
    return line.per_lane["call"] + sum(FLOPS.get(kind, 0) * n for kind, n in line.per_lane.items())
