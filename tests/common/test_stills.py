"""A picture to look at: PNG and PPM of what the window shows, and several rays a pixel."""

from __future__ import annotations

from pathlib import Path

import emitted
import numpy as np
import pytest

from conformance.harness import REFERENCE, call
from study.core import registry
from study.pictures import images

SCENE = registry.scenes()["scene0"].path
SIZE = "-n", 24, "-w", 41  # rows of 123 bytes
DISPLAYING = "opt9_convex"  # makes the bytes itself with --display


def drawn(phase: str, out: Path, *options: str | int) -> Path:
    run = call(phase, SCENE, *SIZE, "-o", out, *options)
    assert (run.status, run.stderr) == (0, ""), f"{run}"
    return out


@pytest.mark.parametrize("options", [[], ["--display"]], ids=["", "display"])
@pytest.mark.parametrize("phase", [REFERENCE, DISPLAYING])
def test_png_and_ppm_are_what_the_window_shows(phase: str, options: list[str], tmp_path: Path) -> None:
    """The same colours: by the formula, read by another library than the one that wrote them."""
    linear = images.rgb(images.read(drawn(phase, tmp_path / "a.exr")))
    png = images.read_png(drawn(phase, tmp_path / "a.PNG", *options))
    ppm = images.read_ppm(drawn(phase, tmp_path / "a.ppm", *options))
    assert png.shape == (24, 41, 3) and len(np.unique(png)) > 50
    np.testing.assert_array_equal(png, images.to_display(linear))
    np.testing.assert_array_equal(ppm, png)


@pytest.mark.parametrize("phase", [REFERENCE, DISPLAYING, pytest.param("truth", marks=pytest.mark.slow)])
def test_samples_are_the_mean_of_a_larger_picture(phase: str, tmp_path: Path) -> None:
    """To a float's last digit that of images.box_average, by which fractals are judged."""
    large = call(phase, SCENE, "-n", 3 * 24, "-w", 3 * 41, "-o", tmp_path / "large.exr")
    assert large.status == 0, f"{large}"
    mean = images.box_average(images.rgb(images.read(tmp_path / "large.exr")), 3)
    made = images.rgb(images.read(drawn(phase, tmp_path / "a.exr", "--samples", 3)))
    np.testing.assert_allclose(made, mean, rtol=2**-23, atol=0)
    shown = images.read_png(drawn(phase, tmp_path / "a.png", "--samples", 3, "--display"))
    np.testing.assert_array_equal(shown, images.to_display(made))
    one = images.read(drawn(phase, tmp_path / "b.exr"))
    assert images.sha256(one) == images.sha256(images.read(drawn(phase, tmp_path / "c.exr", "--samples", 1)))


def test_the_record_says_how_many_samples_there_are() -> None:
    several = call(REFERENCE, SCENE, *SIZE, "--samples", 2, "--json").record
    assert (several["width"], several["height"], several["samples"]) == (41, 24, 2)
    assert "samples" not in call(REFERENCE, SCENE, *SIZE, "--json").record


def test_an_exr_becomes_a_png(write_exr, blank, tmp_path: Path) -> None:
    exr = drawn(REFERENCE, tmp_path / "a.exr", "--aov")
    done = emitted.ran("png", exr)
    assert (done.returncode, done.stdout) == (0, f"{tmp_path / 'a.png'}\n")
    shown = images.to_display(images.rgb(images.read(exr)))
    np.testing.assert_array_equal(images.read_png(tmp_path / "a.png"), shown)
    assert emitted.ran("png", exr, "-o", tmp_path / "new" / "b.png").returncode == 0
    assert (tmp_path / "new" / "b.png").read_bytes() == (tmp_path / "a.png").read_bytes()
    grey = write_exr(tmp_path / "grey.exr", {"Y": blank()["R"]})
    for words in ([grey], [SCENE], [tmp_path / "none.exr"], [exr, exr, "-o", tmp_path / "c.png"]):
        done = emitted.ran("png", *words)
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
