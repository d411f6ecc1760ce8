"""Rays of the camera, to the light, mirrored, scattered: by hand; and where their program runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from conformance import geometry
from conformance.feature_scenes import FLOOR, scene, shape
from study.core import run
from study.measuring import rays

DATA = scene([FLOOR, shape("sphere", radius=1, position=[0, 0, 4])], light={"shadows": "hard"})
INF = np.inf


def test_camera_rays_are_the_camera_s_in_blocks() -> None:
    """Each of geometry's, once; 16 in a row are 4×4 neighbours."""
    made = rays.camera(DATA, 40, 24)
    eye, expected = geometry.rays(DATA, 40, 24)
    assert made.shape == (960, 7) and np.allclose(made[:, :3], eye) and np.isinf(made[:, 6]).all()
    flat = expected.reshape(-1, 3)
    nearest = (made[:, 3:6].astype(float) @ flat.T).argmax(1)
    assert sorted(nearest) == list(range(960)) and np.allclose(made[:, 3:6], flat[nearest], atol=1e-6)
    assert set(nearest[:16]) == {40 * y + x for y in range(4) for x in range(4)}


def test_secondary_rays_by_hand() -> None:
    """A ray straight down onto the floor goes straight up; one that misses makes none."""
    down = np.array([[0, 1, 0, 0, -1, 0, INF], [0, 1, 0, 0, 1, 0, INF]], "<f4")
    found = rays.secondary(DATA, down, np.array([2.5, INF]), np.array([0.0, -1.0]), 1)
    offset = DATA["march"]["surface_offset"]
    assert np.allclose(found["mirror"], [[0, -1.5 + offset, 0, 0, 1, 0, INF]])
    light = np.array(DATA["light"]["position"], float)
    to = np.array([0, -1.5, 0]) - light
    shadow = found["shadow"][0]
    assert np.allclose(shadow[:3], light) and np.allclose(shadow[3:6], to / np.linalg.norm(to), atol=1e-6)
    assert np.isclose(shadow[6], np.linalg.norm(to) - 10 * offset)
    assert found["scattered"][0, 4] > 0


def test_the_program_runs_where_it_is_put(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A program that writes its own affinity and padding in the place of the build's."""
    program = tmp_path / "hits"
    program.write_text(
        "#!/usr/bin/env python3\nimport json, os, sys\n"
        "open(sys.argv[-1], 'wb').write(bytes(8))\n"
        "pad = len(os.environ.get('STEPWISE_PADDING', ''))\n"
        "ns = [*map(float, sorted(os.sched_getaffinity(0)))]\n"
        "print(json.dumps({'ns': ns, 'lanes': pad, 'settings': '', 'embree': ''}))\n"
    )
    program.chmod(0o755)
    monkeypatch.setattr(rays, "build", lambda *_: program)
    one = np.zeros((1, 7), "<f4")
    for cpu in run.USABLE:
        record, _ = rays.hits(tmp_path, one, "primary", cpu=cpu, env_bytes=77)
        assert (record.ns, record.lanes) == ([cpu], 77)
    record, _ = rays.hits(tmp_path, one, "primary")
    assert (record.ns, record.lanes) == (run.USABLE, 0)
