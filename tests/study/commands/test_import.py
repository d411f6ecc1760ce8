"""Scene files of the paper's program: known values from a small file, every bad one in a line, and where its
program can be had, its own picture of each of its files."""

import copy
import json
import math
import subprocess
from pathlib import Path
from typing import Any

import needs
import numpy as np
import pytest

from study.core import cli, commands, run
from study.core.cli import Outcome, StudyError
from study.core.registry import find_scene
from study.experiments.original import measure as original
from study.measuring import paper_scenes as scenes
from study.pictures import images


def converted(path: Path) -> dict[str, Any]:
    return scenes.converted(scenes.read(path), path)


def called(*words: object) -> Outcome:
    return commands.called("import", [str(word) for word in words])[0]


def point(x: float, y: float, z: float) -> dict[str, float]:
    return {"x": x, "y": y, "z": z}


PLACED = {"position": point(0, 0, 20), "rotation": point(0, 0, 0)}
THEIRS: dict[str, Any] = {
    "camera": {"width": 80, "height": 40, "fov": 30, "position": point(0, 0, 0), "rotation": point(0, 0, 0)},
    "pointlight": {"position": point(0, 0, 0), "emission": point(10, 10, 10)},
    "transforms": [PLACED, {"position": point(0, 0, 50), "rotation": point(0, 0, 90)}],
    "materials": [
        {"reflection": 0.0, "shininess": 15.0, "surface": point(1, 1, 1)},
        {"reflection": 0.5, "shininess": 2.0, "surface": point(0, 0.5, 0.25)},
    ],
    "geometric_objects": [
        {"name": "sphere", "transform_idx": 0, "material_idx": 1, "params": [3.0]},
        {"name": "plane", "transform_idx": 1, "material_idx": 1, "params": [0.0, 0.0, -1.0, 0.0]},
    ],
}


def written(folder: Path, text: Any) -> Path:
    path = folder / "theirs.json"
    path.write_text(text if isinstance(text, str) else json.dumps(text))
    return path


def drawn(scene: Path, height: int, width: int, folder: Path) -> images.Picture:
    out = folder / "picture.exr"
    run.render("baseline", scene, height, width, aov=True, out=out, timed=False)
    return images.read(out)


def test_a_small_file_becomes_the_scene_that_it_is(tmp_path: Path) -> None:
    path, out = written(tmp_path, THEIRS), tmp_path / "ours.json"
    found = called(path, "-o", out)
    assert found.ended == cli.OK and (found.result["width"], found.result["height"]) == (80, 40)
    made = json.loads(out.read_text())
    plane = {"type": "plane", "normal": [0, 0, -1], "offset": 0, "rotation_degrees": [0, 0, 90]}
    assert made["shapes"] == [
        {"type": "sphere", "radius": 3, "position": [0, 0, 20], "material": "material1"},
        plane | {"position": [0, 0, 50], "material": "material1"},
    ]
    assert made["light"]["shadows"] == "soft" and list(made["materials"]) == ["material1"]
    scene0 = find_scene("scene0").data
    assert {key: made[key] for key in ("background", "fog", "march")} == {
        key: scene0[key] for key in ("background", "fog", "march")
    }


def test_the_small_file_draws_what_geometry_says(tmp_path: Path) -> None:
    """In the middle a ray meets the sphere head on, at 20 − 3; at the corner it meets the plane z = 50.

    With the plane alone, which casts no shadow, and the light at the camera, that corner's colour is
    0.01 c + 10/d (c cos + 0.2 cos²(2 angle)), times exp(−5e-6 d³); its mirror sees nothing but black."""
    theirs = copy.deepcopy(THEIRS)
    ours = tmp_path / "ours.json"
    ours.write_text(json.dumps(converted(written(tmp_path, theirs))))
    picture = drawn(ours, 41, 81, tmp_path)
    assert picture["Z"][20, 40] == pytest.approx(17, abs=1e-5) and picture["id"][20, 40] == 0
    x, y = 80 / 41 * math.tan(math.radians(15)), 40 / 41 * math.tan(math.radians(15))
    cos = 1 / math.sqrt(1 + x * x + y * y)
    assert picture["Z"][0, 0] == pytest.approx(50 / cos, rel=1e-5) and picture["id"][0, 0] == 1
    del theirs["geometric_objects"][0]
    ours.write_text(json.dumps(converted(written(tmp_path, theirs))))
    light = 10 * cos / 50
    green = 0.5 * (0.01 + cos * light) + 0.2 * (2 * cos * cos - 1) ** 2 * light
    seen = drawn(ours, 41, 81, tmp_path)["G"][0, 0]
    assert seen == pytest.approx(green * math.exp(-5e-6 * (50 / cos) ** 3), rel=1e-3)


def test_a_turned_camera_sees_a_wider_angle(tmp_path: Path) -> None:
    """Turned down by x and right by y, it looks along (cos x sin y, −sin x, cos x cos y), whose z its program
    takes for the focal length."""
    theirs = copy.deepcopy(THEIRS)
    theirs["camera"] |= {"position": point(1, 2, 3), "rotation": point(60, 0, 7), "fov": 90}
    camera = converted(written(tmp_path, theirs))["camera"]
    assert camera["look_at"] == pytest.approx([1, 2 - math.sqrt(3) / 2, 3.5])
    assert camera["vertical_fov_degrees"] == pytest.approx(2 * math.degrees(math.atan(2)))
    theirs["camera"]["rotation"] = point(0, 30, 0)
    camera = converted(written(tmp_path, theirs))["camera"]
    assert camera["look_at"] == pytest.approx([1.5, 2, 3 + math.sqrt(3) / 2])


def test_one_shape_alone_casts_no_shadow(tmp_path: Path) -> None:
    theirs = copy.deepcopy(THEIRS)
    del theirs["geometric_objects"][1]
    assert converted(written(tmp_path, theirs))["light"]["shadows"] == "none"


BAD: list[tuple[tuple, Any, str]] = [  # what, its value, the place that is named
    (("camera", "fov"), "wide", "$.camera.fov"),
    (("camera", "fov"), 175, "$.camera.fov"),
    (("camera", "lens"), 3, "$.camera"),
    (("camera", "rotation"), point(0, 180, 0), "$.camera.rotation"),
    (("camera", "rotation"), point(0, 89.9, 0), "$.camera.rotation"),
    (("pointlight",), None, "pointlight"),
    (("pointlight", "emission", "x"), -1, "$.pointlight.emission.x"),
    (("materials", 1, "reflection"), 1.5, "$.materials[1].reflection"),
    (("materials", 0, "shininess"), 0, "$.materials[0].shininess"),
    (("geometric_objects", 0, "name"), "prism", "$.geometric_objects[0].name"),
    (("geometric_objects", 0, "transform_idx"), 2, "$.geometric_objects[0].transform_idx"),
    (("geometric_objects", 1, "material_idx"), 7, "$.geometric_objects[1].material_idx"),
    (("geometric_objects", 0, "params"), [], "$.geometric_objects[0].params"),
    (("geometric_objects", 0, "params"), [-3], "$.geometric_objects[0].params[0]"),
    (("geometric_objects", 1, "params"), [0, 0, 0, 1], "$.geometric_objects[1].params"),
    (("geometric_objects",), [], "$.geometric_objects"),
]


@pytest.mark.parametrize(("where", "value", "said"), BAD, ids=[f"{place}={value}" for _, value, place in BAD])
def test_a_bad_key_is_named(where: tuple, value: Any, said: str, tmp_path: Path) -> None:
    theirs = copy.deepcopy(THEIRS)
    at = theirs
    for key in where[:-1]:
        at = at[key]
    if value is None:
        del at[where[-1]]
    else:
        at[where[-1]] = value
    path = written(tmp_path, theirs)
    with pytest.raises(StudyError) as caught:
        converted(path)
    assert str(caught.value).startswith(f"{path}: ") and said in str(caught.value)


def test_bad_files_are_named_and_none_is_written_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "ours.json"
    for text, said in (
        ('{"camera":\n {]}', "theirs.json:2:3"),
        ("[]", "theirs.json:1"),
        ('{"results": 3}', "theirs.json:1"),
    ):
        with pytest.raises(StudyError, match=said):
            called(written(tmp_path, text), "-o", out)
        assert not out.exists()
    path = written(tmp_path, THEIRS)
    monkeypatch.chdir(tmp_path)
    for words in ([path, "-o", path], [path]):
        with pytest.raises(StudyError, match="theirs"):
            called(*words)
    assert json.loads(path.read_text()) == THEIRS


@pytest.mark.slow
def test_every_scene_file_of_the_program_draws_its_picture(tmp_path: Path) -> None:
    """On all branches baseline's picture differs from the program's own by 1/255 at most, but for the bulb's
    chaotic pixels."""
    program = original.build(needs.papers_program(), "baseline", 36)
    folder = program.parents[1]
    git = ["git", "-C", str(original.folder_of(original.REPOSITORY))]
    files: dict[bytes, str] = {}
    for sha in original.COMMITS.values():
        listed = subprocess.check_output([*git, "ls-tree", "-r", "--name-only", sha], text=True)
        for name in (n for n in listed.splitlines() if n.endswith(".json")):
            files[subprocess.check_output([*git, "show", f"{sha}:{name}"])] = name
    assert len(files) >= 13
    for number, (text, name) in enumerate(files.items()):
        kept = folder / "scenes" / f"import-{number}.json"
        kept.write_bytes(text)
        ours = tmp_path / "ours.json"
        ours.write_text(json.dumps(converted(kept)))
        _, theirs = original.launch(program, kept.stem, run.FASTEST)
        display = tmp_path / "ours.ppm"
        high, wide = theirs.shape[:2]
        run.render("baseline", ours, high, wide, out=display, timed=False, display=True)
        off = np.abs(theirs.astype(int) - images.read_ppm(display)).max(axis=-1)
        allowed = 0.05 if "mandelbulb" in name else 0
        assert (off > 1).mean() <= allowed, f"{name}: {(off > 1).sum()} pixels, {off.max()}"
