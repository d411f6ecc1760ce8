"""The paper's own rule of counting FLOPs: the calls of each function times the FLOPs of that function.

Its text (P1, section 2, "Cost Analysis"): the FLOPs of each function are counted by hand, one for a call of
math.h; the program counts calls; the product is the cost. A call of the Mandelbulb's distance function then
has all iterations of its loop, though most calls leave it early. What we count instead, iterations as they
are entered, stands beside. Functions without such a loop cost the same by both.
"""

from study.core import registry
from study.core.cli import StudyError
from study.counting import costs
from study.counting.schema import FLOPS, Declared, Function

BULB = "sdf_mandelbulb"
OTHERS = "bulb_"  # how the functions begin that evaluate it in pieces
LOOPS = ("step", "iteration")  # names of the loop's part in costs.def
ALWAYS = ("off_axis",)  # parts of an iteration that are left out on the axis only
CALLED = {"baseline": ("vec_dot",), "opt1": ("vec_add", "vec_dot")}  # functions that an iteration calls


def flop(one: Declared) -> int | None:
    """FLOPs of a counted picture by the rule.

    None where a Mandelbulb's evaluation is not one function with a loop in it, as in later phases, where two
    Mandelbulbs differ in iterations, or where the scene or the phase is not known here, or declares no costs.
    """
    iterations = _iterations(one.scene)
    if one.flops is None or not iterations:
        return one.flops.paper if one.flops and iterations is not None else None
    bulb = one.by_function.get(BULB, Function(calls=0, parts={}))
    loop = next((name for name in LOOPS if name in bulb.parts), None)
    elsewhere = any(name.startswith(OTHERS) and of.calls for name, of in one.by_function.items())
    if loop is None or elsewhere or len(iterations) > 1:
        return None
    try:
        lines = {(line.function, line.part): line for line in costs.of_phase(one.phase)}
    except StudyError:
        return None
    if (BULB, loop) not in lines:
        return None
    parts = [(BULB, part) for part in (loop, *ALWAYS)]
    parts += [(name, "call") for name in CALLED.get(one.phase, ())]
    step = sum(_flop(lines[part]) for part in parts if part in lines)
    lanes = one.lanes if lines[BULB, loop].width == "LANES" else 1
    return one.flops.paper + (max(iterations) * bulb.parts["call"] - bulb.parts[loop]) * step * lanes


def _iterations(scene: str) -> set[int] | None:
    """Iterations of the scene's Mandelbulbs; None for a scene that is not known."""
    if scene not in registry.scenes():
        return None
    shapes = registry.find_scene(scene).data["shapes"]
    return {shape["iterations"] for shape in shapes if shape["type"] == "mandelbulb"}


def _flop(line: costs.Cost) -> int:
    """FLOPs of one lane: one for a call of math.h, none for a comparison."""
    return line.per_lane["call"] + sum(FLOPS.get(kind, 0) * n for kind, n in line.per_lane.items())
