"""STEPWISE_PATH: opt9_convex and opt10_scene draw a scene by the path that it names, or refuse it.

Each path's picture is held to truth by what phase.json grants. A list and a BVH use the same closed forms:
hits, and colours without soft shadows, are equal to the bit. Soft shadows are marched in other packets and
from other origins (shadow/shadow_batch.h), so that their colours differ by rounding.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import phase_pictures
import pytest
from phase_pictures import needs, render

from conformance.feature_scenes import FLOOR, scene, shape
from study.core import registry
from study.core.registry import Scene, Spec
from study.experiments.accuracy import command
from study.pictures import gate, images
from study.pictures.gallery import Gallery
from study.truth import judging
from study.truth.subject import Subject

PHASE, GENERATOR = "opt9_convex", "opt10_scene"
VARIABLE = "STEPWISE_PATH"
PATHS = ("list", "bvh", "march")
HEIGHT, FRACTAL_HEIGHT = 36, 90  # as a quick study judges: of fewer rows of a fractal one pixel decides

pytestmark = [pytest.mark.slow, needs(PHASE)]


def spheres(count: int, shadows: str = "soft") -> dict:
    """Spheres at random over a floor, one in four of them a mirror, none about the camera."""
    random = np.random.default_rng(count)
    centres = random.uniform((-4, -1.2, -1.5), (4, 2.5, 6), (count, 3))
    materials = ["mirror", "plain", "blue", "glossy"]
    balls = [
        shape("sphere", radius=float(r), position=list(map(float, p)), material=materials[i % 4])
        for i, (p, r) in enumerate(zip(centres, random.uniform(0.1, 0.5, count), strict=True))
    ]
    light = {"shadows": shadows, "shadow_strength": 3, "position": [4, 5, -3], "emission": [60, 60, 50]}
    return scene([FLOOR, *balls], light=light, march={"max_steps": 512})


RANDOM = {f"{count} spheres": spheres(count) for count in (40, 5)}


def drawn_by(data: dict) -> set[str]:
    """The paths that can draw a shipped scene, or one of RANDOM: all but a Mandelbox's have closed forms."""
    if any(s["type"] == "mandelbox" for s in data["shapes"]):
        return {"march"}
    plain = not any(s["type"] == "mandelbulb" or any(s.get("repeat", ())) for s in data["shapes"])
    return set(PATHS) if plain and data["march"]["max_steps"] >= 256 else {"list", "march"}


def subject(name: str, folder: Path) -> Scene:
    if name not in RANDOM:
        return registry.find_scene(name)
    path = folder / f"{name.replace(' ', '-')}.json"
    path.write_text(json.dumps(RANDOM[name]))
    return Scene(path.stem, path, RANDOM[name], False)


def picture(data: dict, folder: Path, path: str = "", **more: str) -> images.Picture:
    return phase_pictures.picture(PHASE, data, folder, **{VARIABLE: path}, **more)


def same(a: images.Picture, b: images.Picture, planes: str = "R G B Z id evals N.x N.y N.z") -> bool:
    return all(np.array_equal(a[plane], b[plane], equal_nan=True) for plane in planes.split())


@pytest.mark.parametrize(
    ("count", "floors", "taken"), [(16, 0, "list"), (17, 0, "bvh"), (31, 0, "bvh"), (16, 20, "list")]
)
def test_a_bvh_is_taken_from_where_it_pays(count: int, floors: int, taken: str, tmp_path: Path) -> None:
    """With soft shadows: from its second level on, whatever planes there are. The two paths' colours differ,
    so they tell which one was taken."""
    data = spheres(count)
    data["shapes"] += [FLOOR | {"offset": -40 - k} for k in range(floors)]
    found, *both = (picture(data, tmp_path, path) for path in ("", "list", "bvh"))
    assert not same(*both) and same(found, both[taken == "bvh"])


@pytest.mark.parametrize("name", [*registry.scenes(), *RANDOM])
def test_every_path_is_as_near_to_truth_as_the_phase_declares(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = subject(name, tmp_path)
    plain, size = (
        judging.without_shadows(shown, tmp_path),
        shown.size(FRACTAL_HEIGHT if shown.fractal else HEIGHT),
    )
    spec, beside = Spec.parse(PHASE), [command.FLOAT] if shown.fractal else []
    drawn = set()
    gallery = Gallery(tmp_path / "images", [command.BASE, *beside, spec])
    gallery.render_all([(who, one, size) for who in (command.BASE, *beside) for one in (shown, plain)], 1)
    held = Subject(gallery, shown, plain, size, beside)
    for path in PATHS:
        monkeypatch.setenv(VARIABLE, path)
        refused = gallery.render_all([(spec, one, size) for one in (shown, plain)], 1)
        rows, missing = command.judge(held, [spec], refused)
        for one in (shown, plain):
            gallery.path(spec, one, size).unlink(missing_ok=True)  # which has no path in its name
        assert all(f"{VARIABLE}={path}: " in item.reason for item in missing)
        for row in rows:
            assert row.gated and row.worse == [], (path, row.why)
            drawn.add(path)
    assert drawn == drawn_by(shown.data)


LISTED = {name: s.data for name, s in registry.scenes().items() if "bvh" in drawn_by(s.data)} | RANDOM


@pytest.mark.parametrize("lanes", ["", "avx2"])
@pytest.mark.parametrize("shadows", ["none", "hard", "soft"])
@pytest.mark.parametrize("name", LISTED)
def test_a_list_and_a_bvh_find_the_same_hits(name: str, shadows: str, lanes: str, tmp_path: Path) -> None:
    data = LISTED[name] | {"light": LISTED[name]["light"] | {"shadows": shadows}}
    listed, tree = (picture(data, tmp_path, path, STEPWISE_ISA_LIMIT=lanes) for path in ("list", "bvh"))
    usual = picture(data, tmp_path, STEPWISE_ISA_LIMIT=lanes)
    assert same(usual, tree if len(data["shapes"]) >= 32 else listed)
    assert same(listed, tree, "Z id evals N.x N.y N.z")
    if shadows != "soft":
        assert same(listed, tree)
        return
    enough = registry.phases()[PHASE].tolerance[gate.TRUTH]["enough_db"]
    off = images.colour_errors(images.rgb(listed), images.rgb(tree), with_flip=False)
    assert off["psnr_db"] >= enough
    if name in RANDOM:  # the two do not run the same code
        assert not same(listed, tree)


@pytest.mark.parametrize("name", RANDOM)
def test_a_march_evaluates_where_a_list_does_not(name: str, tmp_path: Path) -> None:
    listed, marched = (picture(RANDOM[name], tmp_path, path) for path in ("list", "march"))
    assert (listed["evals"] == 1).all() and (marched["evals"] > 1).mean() > 0.9


@pytest.mark.parametrize("path", PATHS)
def test_a_forced_path_has_no_generated_kernel(path: str, tmp_path: Path) -> None:
    """The record says which path drew, and why no kernel did; the picture is opt9_convex's."""
    data = RANDOM["5 spheres"]
    expected = picture(data, tmp_path, path)
    words = {VARIABLE: path, "STEPWISE_CC": "gcc", "STEPWISE_CACHE": str(tmp_path / "cache")}
    done = render(GENERATOR, data, tmp_path, **words)
    record = json.loads(done.stdout)
    assert record["settings"] == f"path={path}" and done.stderr == ""
    assert record["kernel"].startswith(f"general: {VARIABLE} ") and record["kernel_compile_ns"] == 0
    assert not (tmp_path / "cache").exists()
    assert same(expected, images.read(tmp_path / "picture.exr"))


WIDE = scene([shape("sphere", radius=200, position=[0, -201.5, 0]), shape("sphere")])
AROUND_CAMERA = scene([shape("sphere", position=[0, 1, -5])])
FEW_STEPS = spheres(40) | {"march": spheres(40)["march"] | {"max_steps": 255}}
REFUSED = {
    "a value that is none": (RANDOM["5 spheres"], "tree"),
    "a list of what has no closed form": (WIDE, "list"),
    "a BVH of what has no closed form": (WIDE, "bvh"),
    "a BVH of few steps": (FEW_STEPS, "bvh"),
    "a BVH of a Mandelbulb": (scene([FLOOR, shape("mandelbulb")]), "bvh"),
    "a BVH of what is repeated": (scene([FLOOR, shape("sphere", repeat=[4, 0, 4])]), "bvh"),
    "a BVH of no solid": (scene([FLOOR]), "bvh"),
    "a list of ideal shadows": (spheres(5, "ideal"), "list"),
    "a list about the camera": (AROUND_CAMERA, "list"),
}


@pytest.mark.parametrize("phase", [PHASE, GENERATOR])
@pytest.mark.parametrize("name", REFUSED)
def test_refused(name: str, phase: str, tmp_path: Path) -> None:
    data, path = REFUSED[name]
    done = render(phase, data, tmp_path, **{VARIABLE: path})
    assert done.returncode == 4 and done.stdout == "" and done.stderr.count("\n") == 1
    assert f": {VARIABLE}" in done.stderr
    assert not (tmp_path / "picture.exr").exists()


def test_empty_the_scene_decides(tmp_path: Path) -> None:
    done = render(PHASE, RANDOM["5 spheres"], tmp_path, **{VARIABLE: ""})
    assert done.returncode == 0 and json.loads(done.stdout)["settings"] is None
