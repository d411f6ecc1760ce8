"""Sixteen lanes without AVX-512 (tests/emulate): what phases draw by them, 16 lanes against 8."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from programs import needs_emulation, needs_sixteen, sixteen

from study.core import registry
from study.core.build import build
from study.pictures import images

pytestmark = pytest.mark.slow


def picture(program: Path, path: Path, folder: Path, limit: str) -> tuple[dict, dict]:
    out = folder / "picture.exr"
    width = "61" if "mandelbulb" in path.stem else "64"  # of which rows may go past the caches
    words = [program, path, "-w", width, "-n", "33", "--aov", "--json", "-o", out]
    environment = os.environ | {"STEPWISE_ISA_LIMIT": limit, "STEPWISE_UNTIMED": "1"}
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, env=environment)
    assert done.returncode == 0 and not done.stderr, done.stderr
    return images.read(out), json.loads(done.stdout)


# opt9_convex's 16 lanes are opt10_scene's; packets and opt6_wide are drawn by tests of their own.
PHASES = {
    "opt7_tiles": ["scene0", "trio", "spheres40", "cubes"],
    "opt8_streams": ["scene0", "trio", "mandelbulb", "cubes"],
    "opt10_scene": ["scene0", "trio", "mandelbulb", "cubes", "lattice", "spheres40"],
    "opt11_ideal": ["scene0", "trio", "mandelbulb", "cubes", "spheres40"],
    "rods_simd": ["two_spheres", "trio"],
    "fixed_simd": ["spheres40"],
    "fixed_float": ["spheres40"],
}
ULP = {("opt10_scene", "trio"): 6e-8}  # a few pixels' colours by the last bit, 16 lanes against 8
ULP |= {("opt11_ideal", scene): 4e-6 for scene in ("scene0", "trio")}  # where a search ends (room_for)


@needs_emulation
@pytest.mark.parametrize("phase", [pytest.param(name, id=f"{name}, 16 lanes emulated") for name in PHASES])
def test_sixteen_lanes_draw_what_eight_draw(phase: str, tmp_path: Path) -> None:
    for name in PHASES[phase]:
        path = registry.scenes()[name].path
        eight, _ = picture(build(phase), path, tmp_path, "avx2")
        wide, record = picture(sixteen(phase), path, tmp_path, "")
        assert record["lanes"] == 16 and record["isa"].endswith("emulated")
        assert "avx512" not in record["flags"]
        if name == "mandelbulb":  # reciprocal roots differ: what is seen does not
            assert (wide["id"] == eight["id"]).mean() > 0.999
            hit = eight["id"] >= 0
            assert (np.abs(wide["Z"] - eight["Z"])[hit & (wide["id"] >= 0)] < 1e-3).mean() > 0.999
            off = np.abs(images.rgb(wide) - images.rgb(eight)).max(-1)
            assert np.isfinite(off).all() and np.mean(off > 1 / 255) < 0.002  # 4 pixels of 2,013; 1 seen
            continue
        for plane in eight:
            allowed = ULP.get((phase, name), 0) if plane in "RGB" else 0
            with np.errstate(invalid="ignore"):
                apart = np.abs(np.where(wide[plane] == eight[plane], 0, wide[plane] - eight[plane]))
            assert (apart <= allowed).all(), (name, plane, apart.max())


@needs_emulation
def test_an_emulated_build_takes_eight_where_it_must(tmp_path: Path) -> None:
    _, record = picture(sixteen("fixed_float"), registry.scenes()["spheres40"].path, tmp_path, "avx2")
    assert (record["lanes"], record["isa"]) == (8, "avx2+fma")


@needs_sixteen
@pytest.mark.parametrize("phase", ["opt9_convex", "opt10_scene"])
def test_a_frame_that_is_marched_leaves_nothing_behind_for_the_next(phase: str, tmp_path: Path) -> None:
    """A worker's approaches lie where the next frame's desk is: 16 lanes' of so many shapes on its counts."""
    scene, random = json.loads(registry.scenes()["spheres40"].path.read_text()), np.random.default_rng(3)
    scene["light"]["shadows"] = "soft"
    scene["march"] |= {"max_steps": 300, "max_bounces": 1}
    gone = {"type": "line", "to": [30, 0, 0.5], "period": 0.2}  # in the second frame
    beside = {"type": "box", "half_size": [0.05, 2, 0.05], "position": [0.3, 0, 0.5], "material": "c0"}
    places = random.uniform([-3, -2, 6], [3, 2, 14], (2999, 3)).tolist()
    balls = [{"type": "sphere", "radius": 0.05, "position": place, "material": "c1"} for place in places]
    scene["shapes"] = [beside | {"path": gone}, *balls]
    path = tmp_path / "moving.json"
    path.write_text(json.dumps(scene))
    out = tmp_path / "first.exr"
    words = [sixteen(phase), path, "-w", "4", "-n", "4", "--frames", "2", "--aov", "-o", out]
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (images.read(out)["evals"] > 1).all()  # else nothing is shown
