"""Further views of a scene: cameras known by geometry."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from study.core import registry
from study.core.cli import StudyError
from study.measuring import views


def scene(*places: tuple, **camera: object) -> dict:
    made = {"position": [0, 0, 0], "look_at": [0, 0, 1], "up": [0, 1, 0]} | camera
    shapes = [{"type": "sphere", "radius": 1, "position": list(place)} for place in places]
    return {"camera": made, "shapes": [*shapes, {"type": "plane", "normal": [0, 1, 0], "offset": -3}]}


def test_the_pivot_is_ahead_at_the_mean_distance_of_what_has_a_place() -> None:
    assert views.pivot(scene((1, 0, 10), (-5, 2, 20))) == pytest.approx([0, 0, 15])
    assert views.pivot(scene((0, 0, 10), (0, 0, -90))) == pytest.approx([0, 0, 10])  # behind: no matter
    assert views.pivot(scene(look_at=[0, 0, 4])) == pytest.approx([0, 0, 4])  # planes have no place
    behind = scene((0, 0, 10), position=[0, 0, -20], look_at=[0, 0, 0])  # the plane's 0, 0, 0 is no place
    assert views.pivot(behind) == pytest.approx([0, 0, 10])
    slanted = scene((6, 0, 8), look_at=[3, 0, 4])  # along (0.6, 0, 0.8)
    assert views.pivot(slanted) == pytest.approx([6, 0, 8])


def test_the_camera_goes_round_the_pivot_and_looks_at_it() -> None:
    for degrees, side in ((40, -1), (-40, 1)):
        camera = views.turned(scene((0, 0, 10)), degrees)["camera"]
        arm = np.subtract(camera["position"], [0, 0, 10])
        assert camera["look_at"] == [0, 0, 10] and camera["up"] == [0, 1, 0]
        assert np.linalg.norm(arm) == pytest.approx(10)
        assert math.degrees(math.acos(arm @ [0, 0, -10] / 100)) == pytest.approx(40)
        assert math.copysign(1, arm[0]) == side  # right is normalize(up × forward), +x here
    near = views.turned(scene((0, 0, 10)), 0, 0.6)["camera"]
    assert near["position"] == pytest.approx([0, 0, 4])


def test_nothing_but_the_camera_changes_and_the_same_view_is_made_each_time(tmp_path: Path) -> None:
    trio = registry.find_scene("trio")
    made, again = (views.of(trio, tmp_path, lambda path, point: 1.0) for _ in range(2))
    assert [view.name for view in made] == ["own", "left", "right", "near"] and made == again
    assert made[1].scene.data["camera"]["position"][0] < 0 < made[2].scene.data["camera"]["position"][0]
    for view in made[1:]:
        kept = {key: value for key, value in view.scene.data.items() if key != "camera"}
        assert kept == {key: value for key, value in trio.data.items() if key != "camera"}
        assert json.loads(view.scene.path.read_text()) == view.scene.data
    assert not any(view.tuned for view in made)
    scene0 = views.of(registry.find_scene("scene0"), tmp_path, lambda path, point: 1.0)
    assert [view.name for view in scene0 if view.tuned] == ["own"]
    square = views.of(registry.find_scene("two_spheres"), tmp_path, lambda path, point: 1.0)
    assert {view.size(9) for view in square} == {(9, 9)} and {view.size(9) for view in made} == {(16, 9)}


def test_a_camera_in_a_shape_takes_a_lesser_change_or_says_so(tmp_path: Path) -> None:
    asked: list[float] = []

    def near_at_first(path: Path, point: np.ndarray) -> float:
        asked.append(point[0])
        return 0.001 if len(asked) <= 2 else 1.0

    made = views.of(registry.find_scene("trio"), tmp_path, near_at_first)
    assert [re.findall(r"[\d.]+", view.change) for view in made] == [[], ["20"], ["40"], ["0.6"]]
    with pytest.raises(StudyError, match="trio"):
        views.of(registry.find_scene("trio"), tmp_path, lambda path, point: math.nan)
    assert not (tmp_path / "trio-left.json").exists()


def test_the_distance_is_that_of_geometry(tmp_path: Path) -> None:
    made = views.of(registry.find_scene("two_spheres"), tmp_path)
    for view in made:
        point = np.array(view.scene.data["camera"]["position"])
        away = min(np.linalg.norm(point - s["position"]) - s["radius"] for s in view.scene.data["shapes"])
        assert views.probed(view.scene.path, point) == pytest.approx(away, abs=1e-12) and away > 0.1
    assert views.probed(made[0].scene.path, np.array([-0.8, 0, 0])) == pytest.approx(-1)
