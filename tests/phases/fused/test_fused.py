"""opt12_fused: the spans that its kernel draws, against the tiles of its general code."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import phase_pictures
import pytest

from study.core import registry
from study.core.build import build
from study.pictures import images

PHASE = "opt12_fused"
SIZE = (427, 61)  # rows of polynomials, no whole packets, and a last row without a second one

pytestmark = [
    pytest.mark.slow,
    phase_pictures.needs(PHASE),
    pytest.mark.skipif(not shutil.which("gcc"), reason="gcc would compile kernels"),
]


def scene(name: str) -> dict:
    """A scene; tilted: scene0 with a mirroring slope, a wall, a low lamp, no fog and a rolled camera."""
    tilted = name == "tilted"
    data = json.loads(registry.scenes()["scene0" if tilted else name].path.read_text())
    if tilted:
        data["camera"]["up"] = [math.sin(0.3), math.cos(0.3), 0]
        data["light"]["position"] = [20, 8, 0]
        data["fog"] = 0
        data["materials"]["clay"] = {"color": [0.8, 0.5, 0.3], "reflectivity": 0.4, "shininess": 11.5}
        data["materials"]["blue"]["shininess"] = 0.05
        data["shapes"][0] |= {"normal": [0.2, 1, -0.1], "material": "clay"}
        data["shapes"].append({"type": "plane", "normal": [1, 0, 0], "offset": -9, "material": "blue"})
    return data


def picture(data: dict, folder: Path, *options: str, **env: str) -> tuple[images.Picture, str]:
    """The picture, and what the record says of the kernel."""
    path, out = folder / "scene.json", folder / "picture.exr"
    path.write_text(json.dumps(data))
    words = [build(PHASE), path, "-w", SIZE[0], "-n", SIZE[1], "-o", out, "--json", *options]
    env = (
        os.environ
        | {"STEPWISE_CACHE": str(folder / "cache"), "STEPWISE_CC": "gcc", "STEPWISE_CC_SECONDS": "250"}
        | env
    )
    run = subprocess.run(list(map(str, words)), capture_output=True, text=True, env=env, timeout=300)
    assert run.returncode == 0, run.stderr
    return images.read(out), json.loads(run.stdout)["kernel"]


@pytest.mark.parametrize(("name", "lanes"), [("scene0", "avx2"), ("tilted", ""), ("scene0_plain", "")])
def test_spans_draw_what_tiles_draw(
    name: str, lanes: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Hits of closed forms to the bit: else a ray that grazes a solid hits it here and misses it there."""
    monkeypatch.setenv("STEPWISE_ISA_LIMIT", lanes)
    data = scene(name)
    tiles, kernel = picture(data, tmp_path, "--aov", STEPWISE_CC="none")
    assert kernel != "generated"
    wanted = images.rgb(tiles).astype(float)
    made, kernel = picture(data, tmp_path)
    assert kernel == "generated"
    off = abs(images.rgb(made) - wanted) / max(1.0, wanted.max())
    assert off.max() < 1e-3
    assert -10 * math.log10((off**2).mean()) > 100
    for options in ("--threads", "3"), ("--aov",):
        again, _ = picture(data, tmp_path, *options)
        assert np.array_equal(images.rgb(made), images.rgb(again)), options
    closed = [i for i, shape in enumerate(data["shapes"]) if shape["type"] not in ("plane", "torus")]
    found = np.isin(tiles["id"], closed)
    assert found.sum() > 500 and np.array_equal(tiles["Z"][found], again["Z"][found])


@pytest.mark.parametrize("width", [601, 608])
def test_long_spans_are_displayed_and_end_at_an_edge(width: int, tmp_path: Path) -> None:
    """Spans of more pixels than a row waits with, and a background at both edges, with channels too."""
    scene, size = registry.scenes()["scene0"].path, ["-w", str(width), "-n", "45"]
    env = os.environ | {"STEPWISE_CACHE": str(tmp_path), "STEPWISE_CC": "gcc", "STEPWISE_CC_SECONDS": "250"}
    made = {}
    for name, options in ("plain.exr", []), ("all.exr", ["--aov"]), ("shown.ppm", ["--display"]):
        made[name] = tmp_path / name
        words = [build(PHASE), scene, *size, "-o", made[name], *options]
        subprocess.run(list(map(str, words)), env=env, check=True, capture_output=True, timeout=300)
    plain, whole = images.read(made["plain.exr"]), images.read(made["all.exr"])
    assert np.array_equal(images.rgb(plain), images.rgb(whole))
    assert np.array_equal(np.isinf(whole["Z"]), whole["id"] < 0)
    assert np.isinf(whole["Z"][0]).all()
    assert np.array_equal(images.read_ppm(made["shown.ppm"]), images.to_display(images.rgb(plain)))
