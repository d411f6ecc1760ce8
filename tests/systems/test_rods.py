"""Rod marching (phases rods, rods_simd): against the article's words in Python, truth, and the parents.

What the article's step does wrong is asserted too: it passes surfaces; the step less the radius never does.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import sys

import emitted
import numpy as np
import pytest
import started

from conformance.feature_scenes import FEATURES, ROOM, scene
from study.core import registry
from study.core.registry import ROOT
from study.pictures import gate, images
from study.pictures.images import Picture
from study.truth import judging, truth

SIMD_LACKS = bool(registry.missing_isa(registry.phases()["rods_simd"]))
needs_simd = pytest.mark.skipif(SIMD_LACKS, reason="the CPU lacks what rods_simd needs")
TWO = ROOT / "common" / "scenes" / "two_spheres.json"


SIZE = (48, 27)
SCENES = {"room": scene(ROOM), "many": FEATURES["shapes_64"], "edges": FEATURES["everything"]}


# --- the article, in Python, for spheres


class Article:
    """Rod marching by the article's words with a perspective radius, for this test: nothing is shared."""

    def __init__(self, data: dict, width: int, height: int, down: int, least: int, safe: bool) -> None:
        camera, self.march = data["camera"], data["march"]
        self.spheres = [(np.array(s["position"], float), s["radius"]) for s in data["shapes"]]
        self.eye = np.array(camera["position"], float)
        ahead = np.array(camera["look_at"], float) - self.eye
        self.ahead = ahead / np.linalg.norm(ahead)
        right = np.cross(camera["up"], self.ahead)
        self.right = right / np.linalg.norm(right)
        self.up = np.cross(self.ahead, self.right)
        self.pixel = (
            2 * math.tan(math.radians(camera["vertical_fov_degrees"] / 2)) / height
        )  # its side, 1 away
        self.size, self.least, self.safe = (width, height), least, safe
        self.planes = {k: np.full((height, width), np.nan) for k in ("steps", "last", "left", "id")}
        self.evaluations = 0
        side = math.ceil(height / down)
        for y in range(0, height, side):
            for x in range(0, width, side):
                self.rod(x, y, min(x + side, width), min(y + side, height), 0.0, 0, 0.0)

    def rod(self, x0: int, y0: int, x1: int, y1: int, t: float, steps: int, known: float) -> None:
        across, up = ((x0 + x1) - self.size[0]) / 2, (self.size[1] - (y0 + y1)) / 2
        axis = self.ahead + self.pixel * (across * self.right + up * self.up)
        axis /= np.linalg.norm(axis)
        widening = self.pixel * math.hypot(x1 - x0, y1 - y0) / 2
        near, shape_hit = False, -1
        while steps < self.march["max_steps"]:
            all_of_them = [np.linalg.norm(self.eye + t * axis - c) - r for c, r in self.spheres]
            known, nearest = min(all_of_them), int(np.argmin(all_of_them))
            steps += 1
            self.evaluations += 1
            radius = max(widening * t, self.march["hit_distance"])
            go = known - radius if self.safe else known
            if go < radius:
                near, shape_hit = True, nearest
                break
            t += go
            edge = self.march["bounds_radius"] + (widening * t if self.safe else 0)
            if np.linalg.norm(self.eye + t * axis) > edge:
                break
        if near and max(x1 - x0, y1 - y0) > self.least:
            xs, ys = (x0, x0 + (x1 - x0 + 1) // 2, x1), (y0, y0 + (y1 - y0 + 1) // 2, y1)
            for (ya, yb), (xa, xb) in [
                (p, q) for p in itertools.pairwise(ys) for q in itertools.pairwise(xs)
            ]:
                if xa < xb and ya < yb:
                    self.rod(xa, ya, xb, yb, t, steps, known)
            return
        for name, value in {"steps": steps, "last": t, "left": known, "id": shape_hit}.items():
            self.planes[name][y0:y1, x0:x1] = value


@pytest.mark.parametrize(
    ("size", "down", "least", "safe"),
    [((40, 40), 16, 1, False), ((37, 23), 3, 1, False), ((40, 40), 4, 3, True), ((50, 7), 1, 1, True)],
)
def test_rods_are_what_the_article_says(draw, size, down, least, safe):
    mine = Article(json.loads(TWO.read_text()), *size, down, least, safe)
    words = f"down={down} least={least} step={'safe' if safe else 'whole'}"
    p, record = draw("rods", "two_spheres", words, size)
    assert set(record["settings"].split()) == {"march=rods", "picture=shaded", *words.split()}
    for name in ("steps", "id"):
        assert np.array_equal(p[name], mine.planes[name]), name
    for name in ("last", "left"):
        assert np.allclose(p[name], mine.planes[name], rtol=2e-6, atol=1e-5), name
    assert p["evals"].sum() == mine.evaluations


def test_the_map_is_the_planes(draw):
    """picture=map: R, G, B are last, left, steps."""
    p, _ = draw("rods", "two_spheres", "picture=map", (40, 40))
    for channel, plane in {"R": "last", "G": "left", "B": "steps"}.items():
        assert np.array_equal(p[channel], p[plane])


@pytest.mark.parametrize("name", ["trio", "cubes", "room", "two_spheres"])
def test_marching_pixels_is_the_parents_picture(draw, name):
    mine, _ = draw("rods", name, "march=pixels", (24, 14))
    theirs, _ = draw("opt2", name, size=(24, 14))
    for channel in images.AOVS:
        assert np.array_equal(mine[channel].view(np.uint32), theirs[channel].view(np.uint32)), channel
    assert np.array_equal(mine["steps"], mine["evals"])


PROOF = ["scene0", "trio", "cubes", "room", "many"]


@pytest.mark.parametrize("name", PROOF)
def test_a_step_less_the_radius_passes_no_surface(draw, name):
    """The last point of a pixel's march is before the true hit, whatever rod it was of; nothing is lost."""
    true, _ = draw("truth", name)
    mine, _ = draw("rods", name, words="down=2 step=safe")
    hit = (true["status"] > 0) & np.isfinite(true["Z"])
    past = hit & ~(mine["last"] <= true["Z"] * (1 + 1e-6))
    assert not past.any(), f"{past.sum()} last points are past the hit"
    assert not (hit & (mine["id"] < 0)).any() and hit.sum() > 100


def test_the_articles_step_does(draw):
    """So the test above can fail, and the phase's NOTES.md say so."""
    true, _ = draw("truth", "scene0")
    mine, _ = draw("rods", "scene0", words="down=2")
    assert (np.isfinite(true["Z"]) & (mine["last"] > true["Z"] * (1 + 1e-6))).sum() > 10


def test_rods_take_fewer_evaluations_and_no_more_steps_than_the_scene_allows(draw):
    rods, rays = (draw("rods", "two_spheres", w, (200, 200))[0] for w in ("", "march=pixels"))
    assert rods["evals"].sum() < rays["evals"].sum() / 5
    assert rods["steps"].max() == rays["steps"].max() == 20
    wrong = (rods["id"] != rays["id"]).mean()
    assert wrong < 0.05, f"{wrong:.3f} of the hits are others: no near picture"


# --- the hybrid


@needs_simd
@pytest.mark.parametrize("name", ["trio", "mandelbulb", "two_spheres"])
def test_packets_alone_are_the_parents_picture(draw, name):
    mine, _ = draw("rods_simd", name, "march=pixels", (40, 22))
    theirs, _ = draw("opt6_wide", name, size=(40, 22))
    for channel in images.AOVS:
        assert np.array_equal(mine[channel].view(np.uint32), theirs[channel].view(np.uint32)), channel


@needs_simd
@pytest.mark.parametrize("words", ["", "size=64 least=1", "size=8 least=8"])
@pytest.mark.parametrize("name", PROOF)
def test_no_ray_begins_past_its_hit(draw, name, words):
    """Where rods have sent a ray, nothing lies before it; where they say nothing is hit, nothing is."""
    true, _ = draw("truth", name)
    mine, _ = draw("rods_simd", name, words=words)
    known, start = true["status"] > 0, mine["start"]
    assert ((start >= 0) | (start == -1)).all() and (start > 0).any()
    past = known & np.isfinite(true["Z"]) & ((start < 0) | ~(start <= true["Z"] * (1 + 1e-6)))
    assert not past.any(), f"{past.sum()} begin past the hit"


@needs_simd
def test_without_caps_the_picture_is_the_parents_but_for_rounding(draw):
    for name in PROOF:
        mine, _ = draw("rods_simd", name)
        theirs, _ = draw("opt6_wide", name)
        assert np.array_equal(mine["id"], theirs["id"]), name
        hit = mine["id"] >= 0
        assert np.allclose(mine["Z"][hit], theirs["Z"][hit], rtol=3e-7), name
        off = np.abs(images.rgb(mine) - images.rgb(theirs)).max(axis=-1)
        assert (off > 1 / 255).mean() < 0.002, name


@pytest.mark.slow
@needs_simd
def test_what_rods_take_is_counted(draw):
    """Plane rods (a rod's evaluations are told with its first pixel) against the counting build."""
    for words in ("size=64 least=1", "steps=3", "march=pixels"):
        p, record = draw("rods_simd", "trio", words, (70, 41), target="render-count")
        lanes = record["by_function"]["rod_step"]["lanes"]
        assert p["rods"].sum() == lanes and (lanes > 0) == (words != "march=pixels")


@needs_simd
def test_both_widths_draw_the_same_bits(draw):
    for words in ("", "size=64 least=2 steps=9 finish=7"):
        wide, record = draw("rods_simd", "edges", words, (70, 41))
        narrow, other = draw("rods_simd", "edges", words, (70, 41), "avx2")
        assert other["lanes"] == 8 and record["settings"] == other["settings"]
        for channel in wide:
            assert np.array_equal(wide[channel].view(np.uint32), narrow[channel].view(np.uint32)), channel


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lattice", "spheres40"])
def test_their_hits_are_what_is_seen_within_the_footprint(name, tmp_path):
    """The gate of stepwise accuracy as declared: kept by rods down to the pixel, broken by coarse ones."""
    words = [sys.executable, str(ROOT / "scripts" / "stepwise"), "accuracy", "--phase", "rods"]
    words += ["--scene", name, "-n", "64", "--json", "--jobs", "1", "--run"]
    done = started.run([*words, str(tmp_path / "own")], timeout=300)
    (row,) = emitted.result(done.stdout)["rows"]
    assert done.returncode == 0 and row["gated"] and row["worse"] == [], done.stderr
    assert max(row["beyond_outlines"].values()) <= 2_000
    assert row["false_hits_ppm"] + row["wrong_shape_ppm"] > 60_000, "nothing was granted: why declare it?"
    env = os.environ | {"STEPWISE_RODS": "least=4"}
    done = started.run([*words, str(tmp_path / "coarse")], timeout=300, env=env)
    (row,) = emitted.result(done.stdout)["rows"]
    assert done.returncode == 1 and {"false_hits_ppm", "wrong_shape_ppm"} & set(row["worse"]), row["worse"]


@pytest.mark.parametrize(
    "name", ["scene0", *(pytest.param(name, marks=pytest.mark.slow) for name in ("lattice", "trio"))]
)
def test_a_picture_one_pixel_aside_is_not_rods(name):
    """Truth's own, rolled by a pixel: every hit has its shape beside it, but where it uncovers what is behind
    it lies farther than truth's.
    """
    scene = registry.find_scene(name)
    exact = truth.picture(scene, scene.size(64))
    granted = gate.margins(registry.find_phase("rods"))
    rolled = Picture({plane: np.roll(values, 1, axis=1) for plane, values in exact.items()})
    beyond = judging.beyond_outlines(exact, rolled, granted[gate.OUTLINE])
    assert beyond["wrong_shape_ppm"] > granted["wrong_shape_ppm"], beyond
