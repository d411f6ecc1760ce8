"""Flights along a camera's path: where the camera is, what is measured there, the chapter."""

from __future__ import annotations

import json
import math
import sys

import numpy as np
import pytest
import started

from conformance.feature_scenes import scene, shape
from conformance.harness import REFERENCE, keep, render
from study.core import registry
from study.core.cli import StudyError
from study.experiments.flight import measure as flight
from study.experiments.flight import tables

PROGRAM = (sys.executable, registry.ROOT / "scripts" / "stepwise")
CHOSEN = "march=rods size=16 least=2 steps=0 finish=0"
LINE = {"type": "line", "to": [1.5, 1, -3], "period": 2}
CIRCLE = {"type": "circle", "centre": [0.5, 0, 3], "axis": [0.2, 1, 0], "period": 2}


def flying(path: dict) -> dict:
    """Two spheres from a camera that moves."""
    made = scene(
        [shape("sphere", radius=0.75, position=[0, 0, 3]), shape("sphere", radius=0.5, position=[1, 0.5, 0])]
    )
    camera = made["camera"] | {"position": [0, 0.5, -4], "look_at": [0, 0, 3], "path": path}
    return made | {"camera": camera}


@pytest.mark.parametrize("path", [LINE, CIRCLE], ids=lambda path: path["type"])
@pytest.mark.parametrize("frame", [0, 23, 60, 95])
def test_a_place_is_where_the_driver_has_the_camera(path: dict, frame: int, tmp_path) -> None:
    """The driver's frame of the animation beside its still picture from the place computed here."""
    moving = registry.scene_at(keep(f"flight_{path['type']}", flying(path)))
    there = flight.still(moving, frame / 60, tmp_path)
    assert "path" not in there.data["camera"]
    drawn = render(REFERENCE, moving.path, 32, 18, "--frames", frame + 1, "--first-frame", frame).picture
    still = render(REFERENCE, there.path, 32, 18).picture
    assert np.array_equal(drawn["id"], still["id"])
    hit = drawn["id"] >= 0
    assert hit.mean() > 0.01 and np.allclose(drawn["Z"][hit], still["Z"][hit], rtol=1e-6)


def test_places_by_hand() -> None:
    """A line's other end after half a period; a circle's quarter turn about y takes x towards -z."""
    camera = {"position": [1, 2, 3], "path": LINE}
    assert np.allclose(flight.position(camera, 1), LINE["to"], atol=1e-15)
    camera = {"position": [1, 2, 0], "path": {"type": "circle", "axis": [0, 2, 0], "period": 4}}
    assert np.allclose(flight.position(camera, 1), [0, 2, -1], atol=1e-15)


def test_times_are_spread_over_a_path() -> None:
    assert flight.times({"type": "line", "period": 10}, 6) == [0, 1, 2, 3, 4, 5]
    assert flight.times({"type": "circle", "period": 10}, 5) == [0, 2, 4, 6, 8]
    assert flight.times({"type": "line", "period": 10}, 1) == [0]


def test_a_scene_without_a_path_is_refused() -> None:
    with pytest.raises(
        StudyError, match=r"scene0: is no scene whose camera has a path; there are .*flythrough"
    ):
        flight.find("scene0")
    done = started.run([*PROGRAM, "flight", "--scene", "scene0"])
    assert done.returncode == 2 and "flythrough" in done.stderr


def way(name: str, ms: float, psnr: float | None, **more) -> dict:
    made = {"name": name, "phase": "rods_simd", "settings": "march=pixels", "ms": ms, "psnr_db": psnr}
    return made | {"wrong_ppm": 10.0, "evaluations": 5.0, "non_finite": 0, "ms_low": ms, "ms_high": ms} | more


RESULT = {
    "article": flight.ARTICLE,
    "psnr_db": 40.0,
    "wrong_ppm": 1000.0,
    "launches": 6,
    "rows": [
        {
            "scene": "there",
            "width": 320,
            "n": 180,
            "period": 4,
            "places": [
                {
                    "seconds": seconds,
                    "position": [0, 0, 0],
                    "within": 3,
                    "ways": [
                        way("rods", slow, 30.0),
                        way("packets", slow / 2, 61.0),
                        *([way("throttle", slow / 4, 45.0, settings=CHOSEN)]
                          if seconds else []),
                        way("fastest", 5.0, None, phase="opt10_scene"),
                    ],
                }
                for seconds, slow in ((0, 100.0), (2, 50.0))
            ],
        }
    ],
}  # fmt: skip


def test_the_chapter_says_the_range_and_the_worst_error() -> None:
    found = tables._found(RESULT)
    assert "rods, as in the article: 10.0 to 20.0 frames a second, 30.0 dB or more to gr" in found.answer
    assert "by the throttle: 80.0 to 80.0 frames a second in 1 of 2 places, 45.0 dB or more" in found.answer
    assert "opt10_scene: 200 to 200 frames a second, equal to ground truth." in found.answer
    summary, places = (part.markdown for part in found.parts)
    assert "| 1 of 2 |" in summary and "1.2 frames a second" in summary
    assert "rods of 16 to 2 pixels, the scene's cap of steps" in places and "none of 3" in places
    assert list(found.drawn) == ["flight-there"]
    lines = found.drawn["flight-there"].make().axes[0].lines
    assert [list(line.get_ydata()) for line in lines[:2]] == [[10, 20], [20, 40]]


@pytest.mark.slow
@pytest.mark.skipif(bool(registry.missing_isa(registry.phases()["rods_simd"])), reason="the CPU lacks AVX2")
def test_for_real(tmp_path) -> None:
    """Two places of the shipped flight: four ways each, the fastest phase near packets alone."""
    words = ["--places", "2", "-n", "24", "--launches", "2", "--phase", "opt8_streams"]
    done = started.run([*PROGRAM, "flight", *words, "--run", tmp_path])
    assert done.returncode == 0, done.stderr
    (row,) = [
        one
        for one in json.loads((tmp_path / flight.FILE).read_text())["rows"]
        if one["scene"] == "flythrough"
    ]
    assert [place["seconds"] for place in row["places"]] == [0, 5]
    for place in row["places"]:
        made = {one["name"]: one for one in place["ways"]}
        assert {"rods", "packets", "fastest"} <= set(made)
        assert all(one["ms"] > 0 and math.isfinite(one["wrong_ppm"]) for one in made.values())
        assert made["fastest"]["psnr_db"] > 25
