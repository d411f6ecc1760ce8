"""Metrics of study.pictures.images against values known from mathematics."""

from __future__ import annotations

import math
import resource
import signal

import flip_evaluator
import numpy as np
import OpenImageIO as oiio
import pytest
from matplotlib.figure import Figure

from study.core import cli
from study.core.cli import StudyError
from study.pictures import draw, images, panels

# --- files


def test_a_ppm_is_read_or_refused(tmp_path):
    path = tmp_path / "shown.ppm"
    path.write_bytes(b"P6\n2 1\n255\n\n\1\2\3\4\5")  # a byte that is a line's end
    assert images.read_ppm(path).tolist() == [[[10, 1, 2], [3, 4, 5]]]
    for broken in (b"", b"P6\n2 1\n255\n\0\1\2\3\4", b"P5\n6 1\n255\n\0\1\2\3\4\5", b"P6\nx 1\n255\n\0\1\2"):
        path.write_bytes(broken)
        with pytest.raises(StudyError, match=r"shown\.ppm"):
            images.read_ppm(path)
    with pytest.raises(StudyError, match=r"none\.ppm"):
        images.read_ppm(tmp_path / "none.ppm")


def test_channels_are_read_by_name_in_any_order(tmp_path, write_exr):
    values = np.arange(21, dtype=np.float32).reshape(3, 7)
    made = {
        name: values + 100 * i
        for i, name in enumerate(("evals", "B", "Z", "N.y", "R", "id", "G", "N.x", "N.z"))
    }
    read = images.read(write_exr(tmp_path / "a.exr", made))
    assert read.keys() == made.keys()
    for name, plane in made.items():
        np.testing.assert_array_equal(read[name], plane)


def test_png_comes_back_and_leaves_no_other_file(tmp_path):
    made = np.random.default_rng(1).integers(0, 256, (5, 7, 3), dtype=np.uint8)
    images.write_png(tmp_path / "new" / "a.png", made)
    np.testing.assert_array_equal(oiio.ImageBuf(str(tmp_path / "new" / "a.png")).get_pixels(oiio.UINT8), made)
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["a.png"]


@pytest.mark.parametrize("write", ["png", "panels", "figure"])
def test_a_full_disk_is_one_line_and_leaves_what_was_there(write, tmp_path):
    """A limit on the size of a file stands for the disk; noise does not compress."""
    noise = np.random.default_rng(1).integers(0, 256, (200, 300, 3), dtype=np.uint8)
    figure = Figure(figsize=(3, 2))
    figure.add_subplot().imshow(noise)
    path = tmp_path / "a.png"
    for name in ("a.png", "a.svg"):
        (tmp_path / name).write_text("earlier")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    try:
        with pytest.raises(StudyError, match=r"a\.(png|svg): .*: File too large"):
            if write == "png":
                images.write_png(path, noise)
            elif write == "panels":
                panels.save(figure, path)
            else:
                draw.save(figure, path.with_suffix(""), "a note")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert sorted((p.name, p.read_text()) for p in tmp_path.iterdir()) == [
        ("a.png", "earlier"),
        ("a.svg", "earlier"),
    ]


# --- what is not finite


@pytest.mark.parametrize(
    "channel, value, hit, count",
    [
        ("R", math.nan, True, 1),
        ("B", math.inf, False, 1),
        ("N.y", -math.inf, True, 1),
        ("evals", math.nan, False, 1),
        ("id", math.nan, True, 1),
        ("Z", math.inf, False, 0),
        ("Z", math.inf, True, 1),
        ("Z", -math.inf, False, 1),
        ("Z", math.nan, False, 1),
    ],
)
def test_infinite_depth_is_right_on_a_miss_and_only_there(blank, miss, channel, value, hit, count):
    picture = blank()
    if not hit:
        miss(picture, (3, 4))
    picture[channel][3, 4] = value
    assert images.non_finite(picture) == count


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_the_same_wrong_sample_in_both_pictures_is_not_equality(blank, value):
    picture = blank()
    picture["G"][2, 2] = value
    found = images.compare(picture, images.Picture({name: plane.copy() for name, plane in picture.items()}))
    assert found["identical"] is True
    assert found["non_finite"] == 2
    metrics = (
        "psnr_db",
        "rmse",
        "fraction_over_1_255",
        "max_abs",
        "psnr_display_db",
        "flip_mean",
        "flip_max",
    )
    assert all(math.isnan(found[name]) for name in metrics)


def test_a_depth_that_is_not_a_number_agrees_with_nothing(blank):
    picture = blank()
    picture["Z"][0, 0] = math.nan
    found = images.compare(picture, picture)
    assert found["mask_mismatch_ppm"] == 1e4
    assert found["depth_agree_fraction"] == 0.99


# --- picture metrics


def offset(picture, amount, where=..., channels="RGB"):
    changed = images.Picture({name: plane.copy() for name, plane in picture.items()})
    for name in channels:
        changed[name][where] += np.float32(amount)
    return changed


@pytest.mark.parametrize("amount", [0.25, 2**-10, 2**-20])
def test_psnr_of_a_known_offset(blank, amount):
    found = images.compare(blank(), offset(blank(), amount))
    assert found["psnr_db"] == pytest.approx(-20 * math.log10(amount), abs=1e-9)
    assert found["rmse"] == pytest.approx(amount, rel=1e-9)
    assert found["max_abs"] == amount
    one = images.compare(blank(), offset(blank(), amount, channels="G"))
    assert one["psnr_db"] == pytest.approx(-10 * math.log10(amount**2 / 3), abs=1e-9)


def test_what_no_viewer_sees_is_clamped_and_reported_beside(blank):
    found = images.compare(blank(grey=1.5), blank(grey=3.0))
    assert (found["psnr_db"], found["fraction_over_1_255"], found["max_abs"]) == (math.inf, 0, 1.5)
    below = images.compare(blank(grey=0), blank(grey=-2.0))
    assert (below["psnr_db"], below["max_abs"]) == (math.inf, 2)
    assert found["identical"] is below["identical"] is False


def test_a_pixel_counts_once_when_any_channel_is_over(blank):
    changed = offset(blank(), 0.99 / 255)
    changed = offset(changed, 0.02 / 255, (0, slice(0, 3)), "R")
    changed = offset(changed, 0.02 / 255, (0, slice(2, 5)), "B")
    assert images.compare(blank(), changed)["fraction_over_1_255"] == 0.05


def test_identical_pictures(blank):
    found = images.compare(blank(), blank())
    assert found["identical"] is True
    assert found["psnr_db"] == found["psnr_display_db"] == math.inf
    assert cli.plain(found)["psnr_db"] is None
    assert found["sha256"] == found["reference_sha256"]
    zero = (
        "non_finite",
        "mask_mismatch_ppm",
        "id_mismatch_ppm",
        "dt_p99",
        "dt_max",
        "rmse",
        "max_abs",
        "flip_mean",
    )
    assert all(found[name] == 0 for name in zero)
    assert found["normal_p99_degrees"] == 0
    assert found["depth_agree_fraction"] == 1


# --- display space


def exact_display(value: float) -> int:
    return math.trunc(255 * min(1.0, math.pow(value, 0.4545))) if value > 0 else 0


def test_display_formula_around_each_of_its_thresholds():
    steps = np.arange(1, 256) / 255
    threshold = (steps ** (1 / 0.4545)).astype(np.float32)
    near = np.stack(
        [np.nextafter(threshold, np.float32(0)), threshold, np.nextafter(threshold, np.float32(2))]
    )
    assert images.to_display(near).tolist() == [[exact_display(float(c)) for c in row] for row in near]
    assert images.to_display(near)[0].max() == 254


def middle_of(code: int) -> float:
    return ((code + 0.5) / 255) ** (1 / 0.4545)


def test_display_space_counts_steps_of_8_bits(blank):
    dark, one, two = (blank(grey=middle_of(code)) for code in (10, 11, 12))
    assert images.compare(dark, one)["fraction_over_1_255_display"] == 0
    found = images.compare(dark, two)
    assert found["fraction_over_1_255_display"] == 1
    assert found["fraction_over_1_255"] == 0  # linear hides dark errors
    assert found["psnr_display_db"] == pytest.approx(20 * math.log10(255 / 2), abs=1e-9)


def test_flip_is_that_of_its_authors(blank, tmp_path):
    rng = np.random.default_rng(3)
    a, b = (rng.integers(0, 256, (24, 32, 3), dtype=np.uint8) for _ in range(2))
    for name, picture in (("a.png", a), ("b.png", b)):
        images.write_png(tmp_path / name, picture)
    files = str(tmp_path / "a.png"), str(tmp_path / "b.png")
    error, mean, _ = flip_evaluator.evaluate(*files, "LDR", applyMagma=False)
    assert images.flip(a, b) == pytest.approx((mean, float(error.max())), rel=1e-5)
    black, white = np.zeros((8, 8, 3), np.uint8), np.full((8, 8, 3), 255, np.uint8)
    assert images.flip(black, white)[0] > 0.9
    assert images.flip(a, a) == (0, 0)


# --- below the picture (10 × 10: one pixel is 10,000 ppm)


def test_mask_and_id_mismatches_are_counted_apart(blank, miss):
    changed = blank()
    miss(changed, (0, slice(0, 3)))
    changed["id"][1, :2] = 4
    changed["Z"][1, :2] = 99  # of another shape: no part of dt
    found = images.compare(blank(), changed)
    assert (found["mask_mismatch_ppm"], found["id_mismatch_ppm"]) == (3e4, 2e4)
    assert found["dt_max"] == 0
    back = images.compare(changed, blank())
    assert (back["mask_mismatch_ppm"], back["id_mismatch_ppm"]) == (3e4, 2e4)


def test_a_depth_where_there_is_no_shape_is_a_mask_mismatch(blank, miss):
    empty, wrong = blank(), blank()
    miss(empty)
    miss(wrong)
    wrong["Z"][5, 5] = 10
    assert images.compare(empty, wrong)["mask_mismatch_ppm"] == 1e4


def test_percentiles_of_the_hit_distance(blank):
    far = blank(1, 101)
    far["Z"][0] += np.arange(101, dtype=np.float32) / 128
    found = images.compare(blank(1, 101), far)
    assert (found["dt_p99"], found["dt_max"]) == (99 / 128, 100 / 128)


def test_without_a_common_hit_there_is_no_distance_to_pass_with(blank, miss):
    empty = blank()
    miss(empty)
    found = images.compare(blank(), empty)
    assert found["mask_mismatch_ppm"] == 1e6
    assert (
        math.isnan(found["dt_p99"])
        and math.isnan(found["dt_max"])
        and math.isnan(found["normal_p99_degrees"])
    )
    both = images.compare(empty, empty)
    assert both["dt_p99"] == both["dt_max"] == both["normal_p99_degrees"] == 0


@pytest.mark.parametrize("degrees", [1e-3, 0.5, 90, 179])
def test_angle_of_normals(blank, degrees):
    turned = blank()
    turned["N.x"][...] = math.sin(math.radians(degrees))
    turned["N.z"][...] = -math.cos(math.radians(degrees))
    assert images.compare(blank(), turned)["normal_p99_degrees"] == pytest.approx(degrees, rel=1e-4)


def test_a_normal_of_no_length_is_as_wrong_as_can_be(blank):
    flat = blank()
    flat["N.z"][...] = 0
    assert images.compare(blank(), flat)["normal_p99_degrees"] == 180
    assert images.compare(flat, flat)["normal_p99_degrees"] == 180


def test_depth_agrees_to_a_thousandth_or_where_both_miss(blank, miss):
    a, b = blank(), blank()
    b["Z"][0, :3] = 10.0099  # agrees: 0.99e-3 of 10
    b["Z"][1, :5] = 10.0101  # does not
    b["id"][2, 0] = 3  # agrees: another shape at the same depth
    for picture in (a, b):
        miss(picture, (3, slice(0, 4)))
    miss(b, (4, slice(0, 2)))  # does not
    assert images.compare(a, b)["depth_agree_fraction"] == 0.93


# --- anti-aliased


def test_box_average_is_the_mean_of_each_block():
    blocks = np.arange(6, dtype=np.float32).reshape(2, 3) / 8
    large = np.repeat(np.repeat(blocks, 4, 0), 4, 1)[..., None] * np.ones(3, np.float32)
    large[0, 0] += 0.5
    expected = blocks[..., None] * np.ones(3)
    expected[0, 0] += 0.5 / 16
    np.testing.assert_allclose(images.box_average(large, 4), expected, rtol=1e-7)


def test_box_average_cuts_off_what_fills_no_block():
    large = np.zeros((9, 6, 3), np.float32)
    large[8:], large[:, 4:] = 1, 1
    np.testing.assert_array_equal(images.box_average(large, 4), np.zeros((2, 1, 3), np.float32))


def test_chaos_within_the_blocks_disappears(blank):
    board = np.indices((40, 40)).sum(0) % 2
    a, b = blank(40, 40), blank(40, 40)
    for name in "RGB":
        a[name], b[name] = board.astype(np.float32), 1 - board.astype(np.float32)
    found = images.compare(a, b, (a, b))
    assert found["psnr_db"] == 0
    assert found["antialiased"]["psnr_db"] == math.inf
    assert found["antialiased"]["fraction_over_1_255"] == 0
    shifted = images.antialiased(a, offset(a, 1, (0, 0)))
    assert shifted["fraction_over_1_255"] == 0.01
    assert shifted["psnr_db"] == pytest.approx(-10 * math.log10((1 / 16) ** 2 / 100), abs=1e-5)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_large_pictures_must_be_finite_too(blank, value):
    broken = blank(40, 40)
    broken["R"][7, 7] = value
    found = images.compare(blank(), blank(), (blank(40, 40), broken))
    assert found["non_finite"] == 0
    assert found["antialiased"]["non_finite"] == 1
    assert math.isnan(found["antialiased"]["psnr_db"])
