"""Flights along a camera's path: where the camera is, what is measured there, the chapter."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from conformance.feature_scenes import scene, shape
from conformance.harness import REFERENCE, keep, render
from study.core import commands, registry
from study.core.cli import StudyError
from study.core.scene_json import Motion
from study.experiments.flight import measure as flight
from study.experiments.flight import tables
from study.experiments.flight.schema import FILE, Flight

RUN = registry.ROOT / "results" / "reference" / "zen4-2026-11-28-flight"
LINE = {"type": "line", "to": [1.5, 1, -3], "period": 2}
CIRCLE = {"type": "circle", "centre": [0.5, 0, 3], "axis": [0.2, 1, 0], "period": 2}


def flying(path: dict[str, Any]) -> dict[str, Any]:
    """Two spheres from a camera that moves."""
    made = scene(
        [shape("sphere", radius=0.75, position=[0, 0, 3]), shape("sphere", radius=0.5, position=[1, 0.5, 0])]
    )
    camera = made["camera"] | {"position": [0, 0.5, -4], "look_at": [0, 0, 3], "path": path}
    return made | {"camera": camera}


@pytest.mark.parametrize("path", [LINE, CIRCLE], ids=lambda path: path["type"])
@pytest.mark.parametrize("frame", [0, 23, 95])
def test_a_place_is_where_the_driver_has_the_camera(path: dict[str, Any], frame: int, tmp_path: Path) -> None:
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
    assert np.allclose(flight.position((1, 2, 3), Motion(**LINE), 1), LINE["to"], atol=1e-15)
    circle = Motion("circle", period=4, axis=(0, 2, 0))
    assert np.allclose(flight.position((1, 2, 0), circle, 1), [0, 2, -1], atol=1e-15)


def test_times_are_spread_over_a_path() -> None:
    assert flight.times(Motion("line", 10), 6) == [0, 1, 2, 3, 4, 5]
    assert flight.times(Motion("circle", 10), 5) == [0, 2, 4, 6, 8]
    assert flight.times(Motion("line", 10), 1) == [0]


def test_a_scene_without_a_path_is_refused() -> None:
    with pytest.raises(StudyError, match=r"scene0: .*flythrough"):
        flight.find("scene0")


def test_the_chapter_of_a_published_run() -> None:
    result, section = Flight.load(RUN / FILE), tables.section(SimpleNamespace(path=RUN))
    assert [part.name for part in section.parts] == ["flight", "flight-places"]
    assert len(section.parts[1].rows) == sum(len(row.places) for row in result.rows)
    row = result.rows[0]
    least = min(1e3 / way.ms for way in tables.ways(row, "rods").values())
    assert section.parts[0].rows[0]["least"] == least
    assert list(section.drawn) == [f"flight-{row.scene}" for row in result.rows]
    lines = section.drawn[f"flight-{row.scene}"].make().axes[0].lines
    assert list(lines[0].get_ydata()) == tables.rates(row, "rods")


@pytest.mark.slow
@pytest.mark.skipif(bool(registry.missing_isa(registry.phases()["rods_simd"])), reason="the CPU lacks AVX2")
def test_for_real(tmp_path: Path) -> None:
    """Two places of the shipped flight: four ways each, the fastest phase near packets alone."""
    words = ["--scene", "flythrough", "--places", "2", "-n", "24", "--launches", "2"]
    outcome, _ = commands.called("flight", [*words, "--phase", "opt8_streams", "--run", str(tmp_path)])
    (row,) = Flight.load(tmp_path / FILE).rows
    assert outcome.ended == 0 and [place.seconds for place in row.places] == [0, 5]
    for place in row.places:
        made = {one.name: one for one in place.ways}
        assert {"rods", "packets", "fastest"} <= set(made)
        assert all(one.ms > 0 and math.isfinite(one.wrong_ppm) for one in made.values())
        assert made["fastest"].psnr_db > 25
