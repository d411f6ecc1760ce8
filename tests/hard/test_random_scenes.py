"""Random scenes: no phase of the ladder may crash, hang or write what is not finite, and on benign scenes all
see what the baseline sees. A failing scene is shrunk by hypothesis and kept in build/test-scenes.

Benign: nothing that rounding alone decides over much of the picture (see `agree`).
"""

import math
import os

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, note, settings
from hypothesis import Phase as Stage
from hypothesis import strategies as st

from conformance import harness
from hard.drawn_scenes import EVERY, SIZES, rounded, scenes, scenes_of_groups, vector
from study.core import registry
from study.experiments.stability.cases import measure
from study.pictures import images

pytestmark = pytest.mark.slow

SIZE = 8  # pixels a side
LADDER = [
    name
    for name, phase in registry.phases().items()
    if phase.family == measure.FAMILY and not registry.missing_isa(phase)
]
REFERENCE = harness.REFERENCE
# Per phase the sum of the times of its runs: nothing at these sizes takes a second.
TIME_LIMIT = 20.0  # s
# In 64 pixels. A pixel may fall on the other side of an edge, or a shadow ray graze one, within rounding: at
# 1e-6 of a unit and pixels of 0.2 to 1 units that is one in 10^5 per edge that crosses it. But coordinates
# are multiples of 1/16, so that a symmetric scene may put an edge on the very middle of a row of eight
# pixels; one such row, but not two, may differ.
ALLOWED = 8 / 64
CLOSE = 2e-3  # of depth, relative; and of colour, of which float's shadow estimate needs the most


RATHER = {"type", "material", "power", "iterations", "bailout", "normal"}  # neither large nor small
RATHER |= {"scale", "minimum_radius", "fixed_radius"}


# The ends of what the loader lets through, and what lies between.
LENGTHS = st.sampled_from([1e-9, 1e-6, 1e-3, 0.1, 1.0, 3.0, 100.0, 1e4, 1e9])
ANY = st.one_of(st.just(0), LENGTHS, LENGTHS.map(lambda x: -x), st.floats(-2, 2))


@st.composite
def extreme(draw: st.DrawFn) -> dict:
    """A valid scene whose every number may be as large or small as the format allows."""
    at = st.one_of(vector(-2.5, 2.5), st.tuples(ANY, ANY, ANY).map(list))
    color = st.tuples(*[st.sampled_from([0, 5e-324, 1e-9, 0.5, 1, 1e9])] * 3).map(list)
    shapes = []
    for kind in draw(st.lists(st.sampled_from([*EVERY]), min_size=1, max_size=3)):
        shape = {"type": kind, "material": "only"} | {key: draw(size) for key, size in EVERY[kind].items()}
        if draw(st.booleans()):
            for key in sorted(shape.keys() - RATHER):
                size = st.tuples(*[LENGTHS] * 3).map(list) if key == "half_size" else LENGTHS
                shape[key] = draw(st.one_of(st.just(shape[key]), size))
        rounded(shape)
        if kind == "plane":  # the loader divides it by the normal's length, a sixteenth at least
            shape["offset"] = min(shape["offset"], 1e7)
        for key, values in {
            "position": at,
            "rotation_degrees": at,
            "repeat": st.tuples(*[st.one_of(st.just(0), LENGTHS)] * 3).map(list),
        }.items():
            if draw(st.integers(0, 3)) == 3:
                shape[key] = draw(values)
        shapes.append(shape)
    scene = draw(scenes([*EVERY]))
    scene["camera"]["vertical_fov_degrees"] = draw(st.sampled_from([30, 60, 1, 170]))
    if draw(st.booleans()):
        position = draw(st.tuples(ANY, ANY, ANY).map(list))
        far = 1e-3 * max(1.0, *map(abs, position))  # towards the middle of the world, off every axis
        ahead = [x - math.copysign(n * far, x) for n, x in zip((1, 2, 3), position, strict=True)]
        scene["camera"] |= {"position": position, "look_at": ahead}
    scene["light"] |= {"position": draw(at), "emission": draw(color), "shadow_strength": draw(LENGTHS)}
    scene["fog"] = draw(st.sampled_from([0, 5e-324, 1e-30, 1e-9, 1.0, 1e9]))
    scene["background"] = draw(color)
    scene["march"] |= {
        "max_steps": draw(st.sampled_from([300, 200, 100, 1])),
        "max_bounces": draw(st.sampled_from([0, 1, 256])),
    }
    for key in ("hit_distance", "bounds_radius", "normal_step", "surface_offset"):
        if draw(st.integers(0, 7)) == 7:
            scene["march"][key] = draw(LENGTHS)
    only = {
        "color": draw(color),
        "reflectivity": draw(st.sampled_from([0, 5e-324, 1])),
        "shininess": draw(LENGTHS),
    }
    return scene | {"materials": {"only": only}, "shapes": shapes}


def pictures(scene: dict, name: str) -> dict[str, harness.Run]:
    """Runs of every phase that renders it. A crash, a hang and a sample that is not finite are failures."""
    path = harness.keep(name, scene)
    found = {}
    for phase in LADDER:
        try:
            picture = harness.KEPT / f"{phase}.{os.getpid()}.exr"
            run = harness.call(
                phase, path, "-n", SIZE, "-w", SIZE, "-o", picture, "--json", "--aov", timeout=TIME_LIMIT
            )
            if run.status == 4:
                harness.check_refusal(run, 4)
                continue
            assert run.drawn, f"{run}"
            run.scene, run.picture = scene, images.read(picture)
        finally:
            picture.unlink(missing_ok=True)
        bad = images.non_finite(run.picture)
        assert bad == 0, f"{run}: {bad} samples are not finite"
        found[phase] = run
    return found


def unlike(a: images.Picture, b: images.Picture, colours: bool = True) -> np.ndarray:
    """Pixels of another shape, of another depth by more than CLOSE, or, if `colours`, of another colour."""
    wrong = a["id"] != b["id"]
    both = ~wrong & (a["id"] >= 0)
    depth = np.abs(np.where(both, a["Z"], 1) - np.where(both, b["Z"], 1))
    # 1e-6/sin(angle): a grazing hit may end anywhere in its last step; the angle is known from the normal.
    wrong |= both & ~(depth <= CLOSE * np.maximum(np.abs(np.where(both, a["Z"], 1)), 1))
    if not colours:
        return wrong
    x, y = (images.clamped(images.rgb(p)) for p in (a, b))
    return wrong | ~(np.abs(x - y) <= CLOSE + 1 / 255).all(-1)


def settled(examples: int):
    """CI runs the same examples every time; STEPWISE_RANDOM=n looks at n others."""
    more = os.environ.get("STEPWISE_RANDOM")
    return settings(
        max_examples=int(more) if more else examples,
        derandomize=not more,
        deadline=None,
        database=None,
        phases=[Stage.generate, Stage.shrink],  # explaining takes minutes more
        suppress_health_check=list(HealthCheck),
    )


@settled(20)
@given(scene=scenes([*EVERY]))
def test_no_phase_breaks(scene: dict) -> None:
    """Any valid scene: fractals, cameras and lights inside of shapes, everything at once."""
    note("build/test-scenes/random_any.json")
    pictures(scene, "random_any")


@settled(20)
@given(scene=extreme())
def test_no_phase_breaks_at_the_limits(scene: dict) -> None:
    """The largest and the smallest numbers that the format allows: finite, ended, alive."""
    note("build/test-scenes/random_extreme.json")
    pictures(scene, "random_extreme")


@settled(25)
@given(scene=scenes([kind for kind in SIZES if kind != "mandelbulb"]))
def test_phases_agree(scene: dict) -> None:
    """Exact distances, and nothing that rounding decides: all phases see what the baseline sees."""
    agree(scene, "random_benign")


@settled(15)
@given(scene=scenes_of_groups())
def test_phases_agree_on_groups(scene: dict) -> None:
    """Random trees of operations and modifiers: every phase that draws them sees what the baseline sees."""
    agree(scene, "random_groups")


def agree(scene: dict, name: str) -> None:
    note(f"build/test-scenes/{name}.json")
    runs = pictures(scene, name)
    reference = runs.pop(REFERENCE)
    # A camera inside of a solid sees a point behind itself. Rounding may decide what of it the light meets.
    assume((reference.picture["Z"] >= 0).all())
    soft = scene["light"]["shadows"] == "soft"
    for phase, run in runs.items():
        # The ideal shadow is not the estimate that the others draw of it.
        other = soft and registry.find_phase(phase).draws_ideal
        wrong = unlike(reference.picture, run.picture, colours=not other)
        assert wrong.mean() <= ALLOWED, f"{run}: {wrong.sum()} of {wrong.size} pixels are not {REFERENCE}'s"
