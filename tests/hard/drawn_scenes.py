"""Valid scenes drawn by hypothesis: any shapes of the format, placed, turned and repeated, under any light.

Every number is a multiple of 1/16 within a few units, so that a shrunk scene is readable and floats hold it
exactly.
"""

from hypothesis import strategies as st

from conformance.feature_scenes import shape
from conformance.group_scenes import tree


def sixteenths(low: float, high: float) -> st.SearchStrategy[float]:
    return st.integers(round(16 * low), round(16 * high)).map(lambda n: n / 16)


def vector(low: float, high: float) -> st.SearchStrategy[list[float]]:
    return st.tuples(*[sixteenths(low, high)] * 3).map(list)


SIZES = {
    "sphere": {"radius": sixteenths(0.125, 1.5)},
    "box": {"half_size": vector(0.125, 1.25)},
    "torus": {"major_radius": sixteenths(0.5, 1.5), "minor_radius": sixteenths(0.125, 0.5)},
    "cone": {
        "bottom_radius": sixteenths(0.125, 1.25),
        "top_radius": sixteenths(0.125, 1.25),
        "half_height": sixteenths(0.125, 1.25),
    },
    "octahedron": {"radius": sixteenths(0.25, 1.5)},
    "plane": {"normal": vector(-1, 1).filter(any), "offset": sixteenths(-3, 1)},
    "mandelbulb": {
        "power": st.just(8),
        "iterations": st.integers(1, 5),
        "bailout": st.sampled_from([4, 256, 10000]),
    },
}
# Kept apart, so that hypothesis draws the same scenes of solids as ever.
EVERY = SIZES | {
    "mandelbox": {
        "scale": st.sampled_from([-3, -1.5, 0.5, 2]),
        "fold_limit": sixteenths(0.25, 2),
        "minimum_radius": sixteenths(0.125, 0.5),
        "fixed_radius": sixteenths(0.5, 1.5),
        "iterations": st.integers(1, 6),
    },
}


def rounded(shape: dict) -> None:
    """Some boxes: by their sizes, so that no draw is another one for it."""
    if shape["type"] == "box" and shape["half_size"][0] > shape["half_size"][1]:
        shape["rounding"] = shape["half_size"][1] / 2 if shape["half_size"][1] > 2e-9 else 0


@st.composite
def shapes(draw: st.DrawFn, kinds: list[str]) -> dict:
    kind = draw(st.sampled_from(kinds))
    shape = {"type": kind, "material": draw(st.sampled_from(["plain", "mirror"]))}
    shape |= {key: draw(size) for key, size in EVERY[kind].items()}
    for key, values in {
        "position": vector(-2.5, 2.5),
        "rotation_degrees": st.tuples(*[st.integers(-180, 180)] * 3).map(list),
        # cells that hold any of the shapes: smaller ones are not benign (hard cases 9 and 33)
        "repeat": st.tuples(*[st.sampled_from([0, 4, 6.5])] * 3).map(list),
    }.items():
        if draw(st.booleans()):
            shape[key] = draw(values)
    rounded(shape)
    return shape


@st.composite
def scenes(draw: st.DrawFn, kinds: list[str]) -> dict:
    """A valid scene of one to four shapes."""
    mirror = {"color": [0.125, 0.25, 0.125], "reflectivity": draw(sixteenths(0, 1)), "shininess": 15}
    return {
        "camera": {
            "position": draw(vector(-5, 5)),
            "look_at": [0.0625, 0.125, 0.03125],  # off the lattice of the positions: no zero direction
            "up": [0.1003, 1, 0.0307],  # along no line from there to it
            "vertical_fov_degrees": draw(st.integers(10, 110)),
        },
        "light": {
            "position": draw(vector(-6, 6)),
            "emission": [2, 3, 4],
            "shadows": draw(st.sampled_from(["none", "hard", "soft"])),
            "shadow_strength": draw(sixteenths(0.5, 8)),
        },
        "background": draw(st.sampled_from([[0, 0, 0], [0.25, 0.5, 0.75]])),
        "fog": draw(st.sampled_from([0, 2.0**-20, 2.0**-10])),
        "march": {
            "max_steps": draw(st.sampled_from([256, 3000])),
            "hit_distance": 1e-6,
            "bounds_radius": 64,
            "max_bounces": draw(st.integers(0, 4)),
            "normal_step": 1e-4,
            "surface_offset": 1e-3,
        },
        "materials": {
            "plain": {"color": [0.5, 0.375, 0.25], "reflectivity": 0, "shininess": 20},
            "mirror": mirror,
        },
        "shapes": draw(st.lists(shapes(kinds), min_size=1, max_size=4)),
    }


@st.composite
def scenes_of_groups(draw: st.DrawFn) -> dict:
    """A benign scene of a plane or none and one or two random trees of solids."""
    whole, materials = draw(scenes(["plane"])), ("plain", "mirror")
    dice = draw(st.lists(st.randoms(use_true_random=False), min_size=1, max_size=2))
    trees = [tree(one, depth=2, materials=materials) for one in dice]
    return whole | {"shapes": [*trees, *whole["shapes"][: draw(st.integers(0, 1))]]}


@st.composite
def random_scenes(draw: st.DrawFn) -> dict:
    """Any scene, its cells smaller than its shapes too, under limits that end marches early."""
    whole = draw(scenes([*EVERY]))
    for one in whole["shapes"]:
        if "repeat" in one and draw(st.booleans()):
            one["repeat"] = draw(vector(0.0625, 8))
    whole["march"] |= {
        "max_steps": draw(st.sampled_from([1, 30, 500])),
        "hit_distance": draw(st.sampled_from([1e-6, 1e-4, 0.05])),
    }
    return whole


def spheres_alone(whole: dict) -> dict:
    """What closed forms of spheres can have of a scene: each shape a sphere, no fog, shadows hard or none."""
    sizes = [next((v for v in s.values() if isinstance(v, float)), 0.5) for s in whole["shapes"]]
    shapes = [
        shape(
            "sphere", position=s.get("position", [0, 0, 0]), radius=min(max(abs(r), 0.1), 2), material="plain"
        )
        for s, r in zip(whole["shapes"], sizes, strict=True)
    ]
    light = whole["light"] | {"shadows": "none" if whole["light"]["shadows"] == "none" else "hard"}
    return whole | {"shapes": shapes, "fog": 0, "light": light}
