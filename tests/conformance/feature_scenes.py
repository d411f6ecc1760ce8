"""A small scene for each feature of the format, alone, and one with all of them together."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from study.experiments.stability.cases import scenes

SIZES: dict[str, dict[str, Any]] = {
    "sphere": {"radius": 1.3},
    "box": {"half_size": [1.2, 0.7, 0.9]},
    "torus": {"major_radius": 1.2, "minor_radius": 0.4},
    "cone": {"bottom_radius": 1.2, "top_radius": 0.4, "half_height": 1},
    "octahedron": {"radius": 1.5},
    "plane": {"normal": [0.2, 1, -0.1], "offset": -1},
    "mandelbulb": {"power": 8, "iterations": 4, "bailout": 256},
    "mandelbox": {"scale": -1.5, "fold_limit": 1, "minimum_radius": 0.5, "fixed_radius": 1, "iterations": 8},
}
FRACTALS = ("mandelbulb", "mandelbox")
# A Mandelbox is seen where its estimate is below the hit distance: after few iterations, a coarse one.
COARSE = {"hit_distance": 0.02, "surface_offset": 0.1, "normal_step": 0.02}
MATERIALS = {
    "plain": {"color": [0.6, 0.5, 0.4], "reflectivity": 0, "shininess": 15},
    "blue": {"color": [0.1, 0.2, 0.7], "reflectivity": 0, "shininess": 3.5},
    "mirror": {"color": [0.02, 0.03, 0.02], "reflectivity": 1, "shininess": 40},
    "dull": {"color": [0.5, 0.5, 0.5], "reflectivity": 0, "shininess": 0.02},
    "glossy": {"color": [0.2, 0.2, 0.2], "reflectivity": 0, "shininess": 1000},
}


def scene(shapes: list[dict], **changes: Any) -> dict:
    """A whole scene around the shapes; a dict among the changes is merged into that section."""
    camera, light = {"position": [0.4, 1.1, -5], "vertical_fov_degrees": 60}, {"emission": [5, 5, 4]}
    usual = scenes.scene(shapes, camera=camera, light=light) | {"materials": MATERIALS}
    return scenes.changed(usual, changes)


def shape(kind: str, **keys: Any) -> dict:
    return {"type": kind, **SIZES.get(kind, {}), "material": "plain"} | keys


TURNED = {"rotation_degrees": [25, -40, 70], "position": [0.3, -0.2, 0.5]}
PLANE_TURNED = {"rotation_degrees": [20, -40, 10], "position": [0.3, -0.9, 0.5]}
CELLS = [3.4, 3.2, 4]
FLOOR = shape("plane", normal=[0, 1, 0], offset=-1.5)
ROOM = [FLOOR, shape("sphere", radius=1, material="blue"), shape("box", position=[1.8, -0.9, 0.7])]


def _transforms() -> dict[str, dict]:
    """Each shape alone, turned, and repeated along each axis and all."""
    found = {}
    for kind in SIZES:
        turned = PLANE_TURNED if kind == "plane" else TURNED
        limits = {"march": COARSE} if kind == "mandelbox" else {}
        found[kind] = scene([shape(kind)], **limits)
        found[f"{kind}_turned"] = scene([shape(kind, **turned)], **limits)
        for name, cells in {"x": [3.4, 0, 0], "y": [0, 3.2, 0], "z": [0, 0, 4], "all": CELLS}.items():
            found[f"{kind}_repeated_{name}"] = scene([shape(kind, repeat=cells)], **limits)
        found[f"{kind}_turned_repeated"] = scene([shape(kind, repeat=CELLS, **turned)], **limits)
    found["rounded"] = scene([shape("box", rounding=0.4)])
    found["rounded_turned_repeated"] = scene([shape("box", rounding=0.25, repeat=CELLS, **TURNED)])
    for axis, name in enumerate("xyz"):
        degrees = [50 * (i == axis) for i in range(3)]
        found[f"turned_about_{name}"] = scene([shape("box", rotation_degrees=degrees)])
    return found


def _light() -> dict[str, dict]:
    kinds = ("none", "hard", "soft", "ideal")
    lit = {f"shadows_{kind}": scene(ROOM, light={"shadows": kind}) for kind in kinds}
    soft = {"shadows": "soft", "shadow_strength": 50}
    beneath = {"position": [0.1, -4, 0.3], "shadows": "soft"}
    lit |= {
        "shadow_strength": scene(ROOM, light=soft),
        "shadow_strength_1": scene(ROOM, light=soft | {"shadow_strength": 1}),
        "shadow_strength_0.4": scene(ROOM, light=soft | {"shadow_strength": 0.4}),
        "fog": scene(ROOM, fog=0.002),
        "fog_thick": scene(ROOM, fog=10),
        "background": scene([shape("sphere")], background=[0.2, 0.5, 0.8]),
        "light_coloured": scene(ROOM, light={"emission": [9, 0, 2]}),
        "light_off": scene(ROOM, light={"emission": [0, 0, 0]}),
        "light_beneath": scene(ROOM, light=beneath),
        "shininess": scene(
            [
                FLOOR | {"material": "dull"},
                shape("torus", material="glossy"),
                shape("sphere", material="dull"),
            ],
            light={"position": [-4, 0.5, 6], "emission": [20, 20, 20]},
        ),
        "light_within_a_shape": scene(ROOM, light={"position": [0, 0.2, 0], "shadows": "hard"}),
        "light_at_the_camera": scene(ROOM, light={"position": [0.4, 1.1, -5], "shadows": "soft"}),
    }
    # dark mirrors under a bright light: a bounce hands on a tenth, and the second must still show
    mirrors = [FLOOR | {"material": "mirror"}, shape("sphere", radius=1, material="mirror"), ROOM[2]]
    mirrors.append(shape("cone", position=[-2, -0.5, 0], material="mirror"))
    bright = {"emission": [90, 80, 70], "shadows": "soft"}
    for bounces in (0, 1, 3):
        lit[f"mirrors_{bounces}"] = scene(mirrors, march={"max_bounces": bounces}, light=bright)
    rounded = [mirrors[0], *(shape("box", rounding=0.2, position=[x, -0.4, 0], material=m)
                             for x, m in ((-1.9, "plain"), (1.4, "mirror")))]  # fmt: skip
    # most of it is rounding: what bounds a shape must count that in
    round_one = [FLOOR, shape("box", half_size=[0.3, 0.2, 0.4], rounding=0.8, position=[0, 0.4, 0])]
    for kind in ("hard", "soft"):
        lit[f"rounded_{kind}"] = scene(rounded, light=bright | {"shadows": kind})
        lit[f"rounded_much_{kind}"] = scene(round_one, light={"shadows": kind})
    lit["mirrors_fog_sky"] = scene(mirrors, fog=0.002, light=bright, background=[0.9, 0.5, 0.1])
    walls = [shape("plane", normal=[0, 0, sign], offset=-6, material="mirror") for sign in (-1, 1)]
    beads = shape("sphere", radius=0.8, repeat=[3, 3, 0])
    for bounces in (1, 2, 6):
        limit = {"max_bounces": bounces}
        lit[f"mirrors_facing_{bounces}"] = scene(
            [*walls, beads], march=limit, light=bright | {"shadows": "hard"}
        )
    return lit


def _counts() -> dict[str, dict]:
    """From one shape to 64, and shapes in each other's place."""
    kinds = [kind for kind in SIZES if kind not in ("plane", *FRACTALS)]
    materials = itertools.cycle(MATERIALS)
    many = []
    for i, (x, y, z) in enumerate(itertools.product(np.linspace(-3, 3, 4), repeat=3)):
        small = {k: (np.array(v) * 0.4).tolist() for k, v in SIZES[kinds[i % len(kinds)]].items()}
        many.append(shape(kinds[i % len(kinds)], position=[x, y, z], material=next(materials)) | small)
    far = {"position": [1, 2, -12]}
    twice = [shape("sphere", material=material) for material in ("blue", "plain")]
    kinds = [kind for kind in SIZES if kind != "mandelbox"]  # which needs COARSE limits
    one_of_each = [shape(k, position=[1.6 * i - 4, 0.3 * i, 2]) for i, k in enumerate(kinds) if k != "plane"]
    return {
        "shapes_64": scene(many, camera=far, light={"shadows": "soft"}),
        "shapes_64_turned": scene(
            [m | {"rotation_degrees": [i, 2 * i, 3 * i]} for i, m in enumerate(many)], camera=far
        ),
        "shapes_one_of_each": scene([*one_of_each, FLOOR], camera=far | {"vertical_fov_degrees": 60}),
        "shapes_same_place": scene(twice),
        "shapes_overlap": scene([shape("box"), shape("sphere"), shape("torus"), shape("octahedron")]),
        "nothing_to_see": scene([shape("sphere", position=[0, 0, -20])], background=[0.1, 0.2, 0.3]),
    }


def _limits() -> dict[str, dict]:
    bulb, hill = shape("mandelbulb"), shape("sphere", radius=300, position=[50, -250, 1500])
    found = {
        f"max_steps_{steps}": scene(ROOM, march={"max_steps": steps}, light={"shadows": "soft"})
        for steps in (1, 2, 20)
    }
    found |= {f"iterations_{n}": scene([bulb | {"iterations": n}]) for n in (1, 2, 4, 7)}
    found |= {f"bailout_{b}": scene([bulb | {"bailout": b}]) for b in (4, 10000)}
    # the other well-known scale; a Mandelbox alone, with a plane, with a Mandelbulb, in each kind of shadow
    box = shape("mandelbox")
    beside = {
        "scale_2": [box | {"scale": 2, "fold_limit": 0.4, "minimum_radius": 0.2, "fixed_radius": 0.4}],
        "plane": [FLOOR, box, shape("sphere", radius=1, position=[-2.5, -0.5, -1], material="mirror")],
        "bulb": [FLOOR, shape("mandelbulb", position=[-2.5, 0, -1]), box | {"position": [1.5, 0, 1]}],
    }
    found |= {
        f"mandelbox_{name}": scene(shapes, march=COARSE, light={"shadows": "soft"})
        for name, shapes in beside.items()
    }
    found |= {
        f"mandelbox_{kind}": scene(beside["plane"], march=COARSE, light={"shadows": kind})
        for kind in ("hard", "ideal")
    }
    return found | {
        "hit_distance": scene(ROOM, march={"hit_distance": 0.01}),
        "bounds_radius": scene(ROOM, march={"bounds_radius": 5.5}, background=[0.3, 0.1, 0.1]),
        "bounds_radius_large": scene(
            [*ROOM[1:], hill], march={"bounds_radius": 1e5}, light={"shadows": "soft"}
        ),
        "bounds_radius_large_bulb": scene([bulb], march={"bounds_radius": 1e5}, light={"shadows": "soft"}),
        "normal_step": scene(ROOM, march={"normal_step": 1e-3}),
        # a float's ulp at its size is 1e-5, far above what a torus of scene0's size may be off by
        "torus_large": scene(
            [shape("torus", major_radius=160, minor_radius=40)],
            camera={"position": [50, 300, -500]},
            light={"position": [-300, 800, -300], "emission": [800, 800, 800]},
            march={"hit_distance": 2e-4, "normal_step": 2e-2, "surface_offset": 0.2, "bounds_radius": 1e4},
        ),
        # shadow rays from the one that come to the other behind the bounds only
        "bounds_before_the_shadow": scene(
            [shape("plane", normal=[0, 1, 0], offset=-1.5), shape("plane", normal=[0, 0, -1], offset=-6)],
            light={"position": [0, 0.5, 1], "shadows": "soft"},
            march={"bounds_radius": 20},
        ),
        "surface_offset": scene(ROOM, march={"surface_offset": 0.05}, light={"shadows": "hard"}),
    }


def _cameras() -> dict[str, dict]:
    places = itertools.product((-3, -1, 1, 3), repeat=3)
    crowd = [shape("sphere", radius=0.6, position=[x, y, z + 1]) for x, y, z in places]
    return {
        "camera_rolled": scene(ROOM, camera={"up": [1, 1, 0]}),
        "camera_upside_down": scene(ROOM, camera={"up": [0, -1, 0]}),
        "camera_tilted": scene(ROOM, camera={"position": [-4, 5, -3], "look_at": [0.5, -1, 0.4]}),
        "camera_down": scene(ROOM, camera={"position": [0, 7, 0], "up": [1, 0, 1]}),
        "camera_wide": scene(ROOM, camera={"vertical_fov_degrees": 170}),
        "camera_narrow": scene(ROOM, camera={"vertical_fov_degrees": 1}),
        "camera_within_a_shape": scene(ROOM, camera={"position": [0, 0.1, -0.2], "look_at": [1, 0, 3]}),
        "camera_under_the_floor": scene(ROOM, camera={"position": [0, -3, -4]}),
        "camera_under_the_floor_bulb": scene(
            [FLOOR, shape("mandelbulb"), shape("box", position=[1.8, -0.9, 0.7])],
            camera={"position": [0, -3, -4], "vertical_fov_degrees": 20},
        ),
        "light_under_the_floor_too": scene(
            ROOM,
            camera={"position": [0, -3, -4], "look_at": [0.5, -4, 0]},
            light={"position": [1, -1.6, -3], "shadows": "hard"},
        ),
        "camera_at_a_centre": scene(
            [shape("mandelbulb")], camera={"position": [0, 0, 0], "look_at": [0, 1, 1]}
        ),
        "camera_within_a_mandelbulb": scene(
            [shape("mandelbulb")], camera={"position": [0.1, 0.2, -0.5], "look_at": [0, 0, 3]}
        ),
        "scene_within_a_sphere": scene([*ROOM, shape("sphere", radius=30, position=[0, 0, 5])]),
        # seen from outside: what encloses them hides the others
        "scene_within_a_box": scene(
            [shape("sphere", radius=1, material="blue"), shape("torus"), shape("box", half_size=[2, 1.5, 2])],
            light={"shadows": "soft"},
        ),
        "bulb_within_a_sphere": scene([shape("mandelbulb"), shape("sphere", radius=1.6), FLOOR]),
        # a crowd's shapes stand in a tree of bounding spheres: the eye is within one shape, within the
        # bounding sphere of one alone, and within the one about all
        "camera_within_one_of_a_crowd": scene(
            [*crowd, shape("torus", position=[-0.8, 1.1, -5])], light={"shadows": "soft"}
        ),
        "camera_in_the_hole_of_a_crowds_torus": scene(
            [*crowd, shape("torus", position=[0.4, 1.1, -5])], light={"shadows": "soft"}
        ),
        # a picture of one column has its hits within 1e-38 of x = 0
        "hits_in_one_column": scene(
            [FLOOR, *crowd],
            light={"position": [0, 6, -2], "shadows": "soft"},
            camera={"position": [0, 1, -5], "look_at": [1e-39, -1.2, 0]},
        ),
        "camera_within_a_sphere_of_a_crowd": scene(
            [*crowd, shape("sphere", radius=0.8, position=[0.3, 1, -5])], light={"shadows": "hard"}
        ),
        "crowd_within_a_box": scene(
            [*crowd, shape("box", half_size=[9, 9, 9])], camera={"position": [0.2, 0.3, -1.2]}
        ),
        "camera_on_the_axis": scene(
            [shape("mandelbulb")], camera={"position": [0, 3, 0], "look_at": [0, 0, 0], "up": [0, 0, 1]}
        ),
    }


def _everything() -> dict:
    """Every feature at once."""
    turn = {"rotation_degrees": [20, -35, 15]}
    kinds = [kind for kind in SIZES if kind != "plane"]
    row = [shape(k, position=[1.7 * i - 4, 0.2, 1 + 0.5 * i], **turn) for i, k in enumerate(kinds)]
    beads = shape("sphere", radius=0.3, material="mirror", position=[0, 2, 3], repeat=[1.5, 0, 2.5], **turn)
    floor = FLOOR | {"material": "mirror"}
    return scene(
        [floor, *row, beads],
        light={"shadows": "soft"},
        fog=0.001,
        background=[0.05, 0.1, 0.2],
        camera={"position": [1, 2, -9], "up": [0.2, 1, 0], "vertical_fov_degrees": 55},
    )


FEATURES = _transforms() | _light() | _counts() | _limits() | _cameras() | {"everything": _everything()}

# As many bounces as a scene may ask for, and all are taken: a stack must hold them.
DEEPEST = scenes.changed(FEATURES["mirrors_facing_6"], {"march": {"max_bounces": 256}})

# Many pixels hit the floor where its difference, of a coarse step, is another shape's too; what has closed
# forms differs from baseline there.
STANDING = scene(
    [
        FLOOR,
        shape("box", position=[0.4, -0.9, 0]),
        shape("octahedron", position=[-1.5, -0.9, -0.5]),
        shape("sphere", radius=0.7, position=[1.8, -1, -0.8], material="blue"),
    ],
    march={"normal_step": 0.1},
    camera={"look_at": [0.2, -1.2, 0], "position": [0.4, 0.3, -3]},
)

# Within four walls, each leaning another way, every pixel hits at a depth of its own, whatever the picture's
# shape: a pixel written to the wrong place shows.
CELL = scene(
    [
        shape("plane", normal=n, offset=-4, material=m)
        for n, m in [
            ([0.3, 0.2, -1], "plain"),
            ([1, 0.1, -0.4], "blue"),
            ([-1, -0.2, -0.3], "plain"),
            ([0, 1, 0.1], "blue"),
            ([0.1, -1, 0], "plain"),
        ]
    ],
    camera={"position": [0, 0, 0.5], "look_at": [0.1, 0.1, 2]},
    light={"position": [1, 0.5, 1]},
)


def is_fractal(whole: dict) -> bool:
    return any(s["type"] in FRACTALS for s in whole["shapes"])
