"""Errors to truth (truth.judging, truth.where).

The synthetic pictures have errors that are known by counting, by trigonometry or by the definition of PSNR.
"""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from discs import HEIGHT, WIDTH, lengths, made_truth

from study.core import registry, store
from study.core.cli import plain
from study.numbers import accuracy
from study.pictures import gate
from study.pictures.images import Picture
from study.truth import judging, where

# --- below the picture


@pytest.mark.parametrize("shift", [0, 1, 3, 20])
def test_a_shifted_disc_has_the_false_hits_of_its_rows(disc, shift):
    found = judging.metrics(made_truth(disc()), disc(shift))
    # Each row of length l that moves by k leaves min(k, l) pixels and takes as many new ones.
    ppm = 1e6 * sum(min(shift, length) for length in lengths()) / (HEIGHT * WIDTH)
    assert found["false_misses_ppm"] == found["false_hits_ppm"] == pytest.approx(ppm)
    assert found["wrong_shape_ppm"] == 0
    assert found["proved_fraction"] == 1


def test_undecided_pixels_are_left_out_and_counted(disc):
    truth, image = made_truth(disc()), disc(3)
    truth["status"][:, :25] = 0
    truth["status"][0, 0] = np.nan
    found = judging.metrics(truth, image)
    # Misses lie at the left, hits at the right: only the hits remain, of fewer pixels.
    assert found["false_misses_ppm"] == 0
    assert found["false_hits_ppm"] == pytest.approx(1e6 * sum(min(3, n) for n in lengths()) / (HEIGHT * 35))
    assert found["undecided_pixels"] == HEIGHT * 25
    assert found["proved_fraction"] == pytest.approx(35 / 60)


def test_nothing_proved_has_no_hit_metric(disc):
    truth = made_truth(disc())
    truth["status"][:] = 1
    found = judging.metrics(truth, disc())
    assert math.isnan(found["false_hits_ppm"]) and math.isnan(found["dt_p99"])
    assert found["converged_pixels"] == HEIGHT * WIDTH and found["undecided_pixels"] == 0


def test_a_fatter_outline_lies_in_front():
    """A row of two shapes and the sky: hits one pixel beside their own, in front of truth's and behind it."""
    row = {"id": [0, 0, 1, 1, -1, -1], "Z": [1, 1, 5, 5, np.inf, np.inf], "status": [2] * 6}
    exact = Picture({name: np.array([values], np.float32) for name, values in row.items()})

    def beyond(pixel: int, shape: int, z: float) -> list[float]:
        made = Picture({name: plane.copy() for name, plane in exact.items()})
        made["id"][0, pixel], made["Z"][0, pixel] = shape, z
        found = judging.beyond_outlines(exact, made, 1)
        return [round(6 * found[f"{name}_ppm"] / 1e6) for name in ("false_hits", "wrong_shape")]

    assert beyond(2, 0, 1) == beyond(4, 1, 5) == [0, 0]  # fatter
    assert beyond(2, 0, np.nextafter(np.float32(5), np.float32(6))) == [0, 0]  # as far, rounded
    assert beyond(1, 1, 5) == beyond(2, 0, 5.00001) == [0, 1]  # a hole in what is in front
    assert beyond(3, 0, 1) == [0, 1] and beyond(5, 1, 5) == [1, 0]  # not beside it
    assert beyond(4, 1, np.nan) == [1, 0] and beyond(2, 0, np.nan) == [0, 0]  # the latter a false miss


def test_another_shape_is_neither_a_false_hit_nor_a_miss(disc):
    image = disc()
    image["id"][20, 20:25] = 3
    image["Z"][20, 20:25] = 99
    found = judging.metrics(made_truth(disc()), image)
    assert found["wrong_shape_ppm"] == pytest.approx(1e6 * 5 / (HEIGHT * WIDTH))
    assert found["false_hits_ppm"] == found["false_misses_ppm"] == found["dt_max"] == 0


@pytest.mark.parametrize(
    ("plane", "spot", "metric"),
    [
        ("Z", (20, 25), "false_misses_ppm"),
        ("id", (20, 25), "false_misses_ppm"),
        ("id", (0, 0), "false_hits_ppm"),
        ("Z", (0, 0), "false_hits_ppm"),
    ],
)
def test_nan_is_a_wrong_hit_whatever_truth_says(disc, plane, spot, metric):
    image = disc()
    image[plane][spot] = np.nan
    found = judging.metrics(made_truth(disc()), image)
    assert found[metric] == pytest.approx(1e6 / (HEIGHT * WIDTH))
    assert found["non_finite"] >= 1
    assert where.bad(made_truth(disc()), image).sum() == 1


def test_depth_and_normals_have_their_own_errors(blank):
    truth, image = made_truth(blank(10, 20)), blank(10, 20)
    image["Z"][:2] += 0.5  # a fifth of the pixels
    image["Z"][5, 5] += 1.5
    angle = math.radians(3)
    image["N.x"][:], image["N.z"][:] = math.sin(angle), -math.cos(angle)
    found = judging.metrics(truth, image)
    assert (found["dt_p99"], found["dt_max"]) == (0.5, 1.5)
    assert found["normal_p99_degrees"] == pytest.approx(3, abs=1e-4)


def test_distances_are_compared_over_as_many_hits(blank):
    """Who hits more of the true hits is not further for it: the hits that it won are its worst here."""
    truth, base, more = (blank(10, 20) for _ in range(3))
    truth = made_truth(truth)
    base["Z"][:] += 0.25  # everywhere but in the row that it misses
    base["Z"][0], base["id"][0] = np.inf, -1
    base["Z"][1, 0] += 4
    more["Z"][:] += 0.125
    more["Z"][0] += 4
    others = judging.right_distances(truth, base)
    assert len(others) == 180 and others[-1] == 4.25
    assert judging.metrics(truth, more)["dt_p99"] > 4
    assert judging.dt_p99_of(others, truth, more) == 0.125
    assert judging.dt_p99_of(others, truth, base) == judging.metrics(truth, base)["dt_p99"] == 0.25
    all_of_fewer = np.full(1000, 0.25)
    assert judging.dt_p99_of(all_of_fewer, truth, more) == judging.metrics(truth, more)["dt_p99"]
    more["Z"][3, :4] += 8  # what is further off than all of the other's hides behind nothing
    assert judging.dt_p99_of(others, truth, more) == 8.125
    more["id"][:, 5:] = 7  # another shape is no right hit
    assert len(judging.right_distances(truth, more)) == 50
    assert math.isnan(judging.dt_p99_of(others[:0], truth, base | {"id": base["id"] * 0 + 7}))
    more["Z"][:, :] = np.nan
    assert math.isnan(judging.dt_p99_of(others, truth, more))


def test_where_every_ray_misses_nothing_is_off(blank, miss):
    """Nothing was hit, so no hit is at the wrong distance; a picture that hits is wrong by its false hits."""
    empty, hits = blank(), blank()
    miss(empty)
    truth = made_truth(empty)
    assert judging.dt_p99_of(judging.right_distances(truth, empty), truth, empty) == 0
    found = judging.metrics(truth, empty, empty)
    assert (found["dt_p99"], found["false_hits_ppm"]) == (0, 0)
    assert gate.inferior(found, {"baseline": found}, {}) == {}
    assert "false_hits_ppm" in gate.inferior(judging.metrics(truth, hits, hits), {"baseline": found}, {})


# --- colours


def test_each_truth_has_its_own_psnr(blank):
    image, truth = blank(8, 8, 0.5), made_truth(blank(8, 8, 0.5))
    for name in "RGB":
        truth[name] += np.float32(0.1)
        truth[f"ideal.{name}"] -= np.float32(0.01)
    dark = blank(8, 8, 0.501)
    found = judging.metrics(truth, image, dark)
    assert found["psnr_db"] == pytest.approx(20, abs=1e-4)
    assert found["psnr_ideal_db"] == pytest.approx(40, abs=1e-3)
    assert found["psnr_none_db"] == pytest.approx(60, abs=1e-2)
    assert found["rmse"] == pytest.approx(0.1, abs=1e-6)
    levels = [math.trunc(255 * grey**0.4545) for grey in (0.5, 0.6, 0.49, 0.501)]
    for key, level in (("psnr_display_db", levels[1]), ("psnr_ideal_display_db", levels[2])):
        assert found[key] == pytest.approx(20 * math.log10(255 / abs(level - levels[0])), abs=1e-3)
    assert "psnr_none_db" not in judging.metrics(truth, image)


def test_the_exact_estimator_errs_from_the_ideal_shadow_alone(blank):
    truth = made_truth(blank(8, 8, grey=0.5))
    for name in "RGB":
        truth["ideal." + name] += np.float32(0.01)
        truth["none." + name] += np.float32(0.1)
    found = judging.estimator(truth)
    assert found["psnr_db"] == found["psnr_none_db"] == math.inf
    assert found["psnr_ideal_db"] == pytest.approx(40, abs=1e-4)
    assert [found[name] for name in gate.HITS] == [0, 0, 0, 0]


def test_shadow_error_is_of_what_the_shadow_takes(blank):
    """Truth takes 0.25 in the upper half, the phase 0.35 there: √(½·0.1²), whatever else they are off by."""
    truth, lit, shaded = made_truth(blank(10, 10, 0.8)), blank(10, 10, 0.7), blank(10, 10, 0.7)
    for name in "RGB":
        truth[name][:5] -= np.float32(0.25)
        truth[f"ideal.{name}"][:5] -= np.float32(0.35)
        shaded[name][:5] -= np.float32(0.35)
    found = judging.metrics(truth, shaded, lit)
    assert found["shadow_rmse"] == pytest.approx(math.sqrt(0.005), abs=1e-6)
    assert found["shadow_ideal_rmse"] == pytest.approx(0, abs=1e-6)


def test_a_shadow_that_nobody_can_see_is_no_error(blank):
    """Linear and clamped: from 3.0 down to 1.5 nothing changes on a screen."""
    truth, lit, shaded = made_truth(blank(4, 4, 3.0)), blank(4, 4, 3.0), blank(4, 4, 1.5)
    assert judging.metrics(truth, shaded, lit)["shadow_rmse"] == 0
    shaded["R"][0, 0] = np.inf
    assert math.isnan(judging.metrics(truth, shaded, lit)["shadow_rmse"])


def test_identical_is_infinite_in_memory_null_in_json_and_infinite_again(blank, tmp_path):
    found = judging.metrics(made_truth(blank()), blank(), blank(), fractal=True)
    assert found["psnr_db"] == found["psnr_none_display_db"] == math.inf
    broken = blank()
    broken["R"][0, 0] = np.nan
    row, size = {"phase": "opt4", "scene": "trio", **found}, {"width": 10, "height": 10}
    bad = {**row, **judging.metrics(made_truth(blank()), broken, blank(), fractal=True)}
    assert plain(row)["psnr_db"] is None
    store.write_json(tmp_path / "accuracy.json", {"rows": [size | row, size | bad]})
    again, nan = accuracy.rows(tmp_path)
    assert again.psnr_db == again.psnr_display_db == again.colours.psnr_ideal_db == math.inf
    assert math.isnan(nan.psnr_db) and math.isnan(nan.colours.psnr_db)
    assert again.psnr_none_db == nan.psnr_none_db == math.inf


def test_a_fractal_is_judged_averaged_and_by_depth(blank):
    """Sparkle that averages out: ±0.1 on a chessboard, and a twentieth of the depths off by a hundredth."""
    truth, image = made_truth(blank(40, 40)), blank(40, 40)
    board = 0.1 * (-1.0) ** np.add.outer(np.arange(40), np.arange(40))
    for name in "RGB":
        image[name] += board.astype(np.float32)
    image["Z"][:2] *= 1.01
    truth["status"][:] = 1
    found = judging.metrics(truth, image, image, fractal=True)
    assert found["converged_only"] is True and found["proved_fraction"] == 0
    assert found["psnr_db"] == pytest.approx(20, abs=1e-3)
    assert found["antialiased"]["psnr_db"] > 120
    assert found["depth_agree_fraction"] == pytest.approx(0.95)


def test_hits_lost_and_wrong_of_an_exact_surface(blank):
    """100 pixels: behind, missed and NaN are lost; before, and a hit of nothing, are wrong."""
    truth, image = made_truth(blank(10, 10)), blank(10, 10)
    assert judging.surface(truth, image) is None
    truth |= {f"surface.{name}": truth[name].copy() for name in ("Z", "id", "N.x", "N.y", "N.z", *"RGB")}
    truth |= {f"surface.ideal.{name}": truth[name] + np.float32(0.01) for name in "RGB"}
    truth["surface.status"] = np.full((10, 10), 2, np.float32)
    truth["surface.status"][9] = 0  # undecided: of none of these
    truth["surface.Z"][1, :2], truth["surface.id"][1, :2] = np.inf, -1
    image["Z"][1, 1] = np.inf  # rightly; the pixel before it is a hit of nothing
    image["Z"][0, :4] += np.array([0.0009, 0.0011, np.inf, np.nan], np.float32)
    image["Z"][2, :2] -= np.array([0.0009, 0.0011], np.float32)
    image["Z"][9] += 1
    for name in "RGB":
        image[name] += np.float32(0.1)
        truth[f"surface.{name}"][9] = np.nan
    found = judging.surface(truth, image)
    assert (found["proved_fraction"], found["proved_hits"]) == (0.9, 88)
    assert found["lost_ppm"] == pytest.approx(3e6 / 90) and found["wrong_ppm"] == pytest.approx(2e6 / 90)
    assert found["psnr_db"] == pytest.approx(20, abs=1e-3) == found["antialiased"]["psnr_db"]
    assert found["psnr_ideal_db"] == pytest.approx(-20 * math.log10(0.09), abs=1e-2)
    assert found["normal_p50_degrees"] == 0


def test_what_truth_does_not_know_is_no_agreement(blank):
    """A tenth off everywhere is 20 dB, however many pixels are judged; of none there is no error."""
    truth, image = made_truth(blank(64, 64)), blank(64, 64)
    for axis in "RGB":
        image[axis] += np.float32(0.1)
    whole = judging.metrics(truth, image, blank(64, 64))
    truth["ideal.G"][:48] = np.nan
    truth["status.all"][:48] = 0
    found = judging.metrics(truth, image, blank(64, 64))
    assert found["unjudged_colours"] == 48 * 64 and whole["psnr_db"] == pytest.approx(20, abs=1e-3)
    for name in ("psnr_db", "psnr_display_db", "rmse", "fraction_over_1_255", "shadow_rmse"):
        assert found[name] == pytest.approx(whole[name], rel=1e-5, abs=1e-7), name
    assert found["flip_mean"] == pytest.approx(whole["flip_mean"], rel=0.25), "its filter mixes neighbours"
    averaged = judging.metrics(truth, image, fractal=True)["antialiased"]
    assert averaged["psnr_db"] == pytest.approx(20, abs=1e-3)
    truth["ideal.G"][:], truth["status.all"][:] = np.nan, 0
    found = judging.metrics(truth, image, blank(64, 64))
    assert all(math.isnan(found[n]) for n in ("psnr_db", "rmse", "max_abs", "flip_max", "shadow_rmse"))


# --- where


def test_classes_by_truths_own_planes(blank, miss):
    truth = made_truth(blank(30, 30))
    miss(truth, np.s_[:, 25:])  # background
    truth["id"][:, :10] = 1
    truth["N.x"][:15, 10:20], truth["N.z"][:15, 10:20] = 1, 0  # a face at right angles
    truth["shadow"][22:, 10:20] = 0.5
    found = where.classes(truth, mirrors={1})
    names = np.array(where.CLASSES)[found]
    assert set(names[5, 9:11]) == {"silhouette"} and set(names[5, 24:26]) == {"silhouette"}
    assert names[14, 12] == names[15, 12] == "edge" and names[13, 12] == names[17, 12] == "interior"
    assert names[21, 15] == names[22, 15] == "shadow_boundary"
    assert names[5, 5] == "reflection" and names[5, 28] == "interior"
    assert (np.array(where.CLASSES)[where.classes(truth)] != "reflection").all()


def test_depth_that_jumps_is_a_silhouette_and_a_slanted_plane_is_not(blank):
    truth = made_truth(blank(12, 40))
    # 1/t of a plane is linear over the picture: here t goes from 10 to over 200.
    truth["Z"][:] = 1 / np.linspace(0.1, 0.005, 40, dtype=np.float32)
    assert (where.classes(truth) == where.CLASSES.index("interior")).all()
    truth["Z"][:, 20:] *= 1.5
    names = np.array(where.CLASSES)[where.classes(truth)]
    assert (names[:, 19:21] == "silhouette").all() and (names[:, :18] == "interior").all()


def test_neighbours_in_all_eight_directions(blank):
    for spot in [(4, 4), (0, 0), (8, 8), (0, 8), (8, 0)]:
        truth = made_truth(blank(9, 9))
        truth["id"][spot] = 2
        marked = where.classes(truth) == 0
        rows, columns = np.mgrid[:9, :9]
        near = np.maximum(abs(rows - spot[0]), abs(columns - spot[1])) <= 1
        assert (marked == near).all()


def test_bad_pixels_and_their_shares(disc):
    truth, image = made_truth(disc()), disc()
    image["R"][20, 20:24] += np.float32(0.1)
    image["G"][20, 24] += np.float32(1 / 300)  # less than one step
    image["id"][20, 25] = 5
    image["B"][21, 25] = np.nan
    truth["B"][22, 25], image["B"][22, 25] = 1, np.inf  # which looks like 1 once clamped
    wrong = where.bad(truth, image)
    assert wrong.sum() == 7 and not wrong[20, 24]
    found = where.shares(where.classes(truth, {0}), wrong)
    assert found["bad_pixels"] == 7 and found["bad_reflection"] == 1
    assert sum(found[f"bad_{name}"] for name in where.CLASSES) == pytest.approx(1)
    none = where.shares(where.classes(truth), np.zeros_like(wrong))
    assert none["bad_pixels"] == 0 and none["bad_interior"] == 0


def test_the_map_has_the_classes_colour_and_loses_no_pixel(blank):
    truth, wrong = made_truth(blank(9, 14)), np.zeros((9, 14), bool)
    wrong[8, 13] = wrong[0, 0] = True
    classed = np.full((9, 14), where.CLASSES.index("edge"))
    classed[0, 0] = where.CLASSES.index("interior")
    for factor in (1, 4):
        made = where.painted(truth, classed, wrong, factor)
        bytes_ = np.round(255 * made).astype(int)
        assert made.shape == (-(-9 // factor), -(-14 // factor), 3)
        assert "#{:02X}{:02X}{:02X}".format(*bytes_[-1, -1]) == where.COLOURS["edge"]
        assert "#{:02X}{:02X}{:02X}".format(*bytes_[0, 0]) == where.COLOURS["interior"]
        assert made[1, 1].max() <= where.DIM
    large = where.painted(made_truth(blank(50, 400)), np.zeros((50, 400), int), np.eye(50, 400) > 0)
    assert (large[20, 21] != large[20, 25]).any()


# --- scenes


def test_mirrors_are_the_shapes_whose_material_reflects():
    assert judging.mirrors(registry.find_scene("scene0")) == {2}  # its sphere
    assert judging.mirrors(registry.find_scene("scene0_plain")) == frozenset()
    scene = registry.find_scene("scene0")
    still = {**scene.data, "march": {**scene.data["march"], "max_bounces": 0}}
    assert judging.mirrors(dataclasses.replace(scene, data=still)) == frozenset()


def test_a_scene_without_its_shadows(tmp_path):
    scene = registry.find_scene("scene0")
    made = judging.without_shadows(scene, tmp_path)
    data = json.loads(made.path.read_text())
    assert data["light"].pop("shadows") == "none" and scene.data["light"]["shadows"] == "soft"
    assert data == {**scene.data, "light": {k: v for k, v in scene.data["light"].items() if k != "shadows"}}
    age = made.path.stat().st_mtime_ns
    assert judging.without_shadows(scene, tmp_path).path.stat().st_mtime_ns == age
    cubes = registry.find_scene("cubes")
    assert judging.without_shadows(cubes, tmp_path) is cubes
