"""The viewer without a window: its pictures are the drivers', its false colours as documented."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import programs
import pytest
import viewer

from study.core import patches
from study.pictures import images

ROOT = viewer.ROOT
SCENES = ROOT / "common" / "scenes"
SCENE0 = SCENES / "scene0.json"
SIZE, HEIGHT, WIDTH = "160x90", 90, 160


@pytest.fixture(scope="module", autouse=True)
def program() -> Path:
    return viewer.build("libpng")


def planes(folder: Path, phase: str) -> dict[str, np.ndarray]:
    out = folder / "planes.exr"
    words = [programs.built(f"{phase}/render"), SCENE0, "-n", str(HEIGHT), "--aov", "-o", out]
    subprocess.run(words, check=True, capture_output=True)
    return images.read(out)


def test_pictures_are_the_drivers(tmp_path: Path) -> None:
    names = ["opt2", "opt4", "opt9_convex"]
    frames = viewer.headless(tmp_path, [{"phase": name} for name in names], SIZE)
    for name, frame in zip(names, frames, strict=True):
        assert np.array_equal(frame, viewer.displayed(tmp_path, name, SCENE0, HEIGHT)), name


def test_an_animation_is_where_the_driver_has_it(tmp_path: Path) -> None:
    scene = SCENES / "animated" / "spheres40_animated.json"
    line = {"scene": "spheres40_animated", "phase": "opt9_convex", "seconds": 0.5}
    [frame] = viewer.headless(tmp_path, [line], SIZE)
    driver = viewer.displayed(tmp_path, "opt9_convex", scene, HEIGHT, "--frames", "31", "--first-frame", "30")
    assert np.array_equal(frame, driver)
    assert not np.array_equal(frame, viewer.displayed(tmp_path, "opt9_convex", scene, HEIGHT))


def test_a_flight_is_where_the_driver_has_it(tmp_path: Path) -> None:
    """By the path at first; from a line with a position on, by the script."""
    scene = SCENES / "animated" / "flythrough.json"
    lines = [
        {"scene": "flythrough", "phase": "opt9_convex"},
        {"seconds": 5, "frames": 2},
        {"position": [0.15, 0.35, 4.2]},
    ]
    still, halfway, end, back = viewer.headless(tmp_path, lines, SIZE)
    for frame, number in ((still, 0), (halfway, 150), (end, 300)):
        words = ["--frames", str(number + 1), "--first-frame", str(number)]
        assert np.array_equal(frame, viewer.displayed(tmp_path, "opt9_convex", scene, HEIGHT, *words)), number
    assert np.array_equal(back, still) and not np.array_equal(end, still)


def test_differences_and_the_divider(tmp_path: Path) -> None:
    plain = SCENES / "scene0_plain.json"
    fast, exact = (viewer.displayed(tmp_path, name, plain, HEIGHT) for name in ("opt9_convex", "opt2"))
    lines = [
        {"scene": "scene0_plain", "phase": "opt9_convex", "mode": "difference", "amplify": 8},
        {"mode": "colours", "divider": 0.25},
        {"mode": "difference", "divider": 0.5},
    ]
    difference, split, both = viewer.headless(tmp_path, lines, SIZE)
    amplified = np.minimum(255, 8 * np.abs(fast.astype(int) - exact)).astype(np.uint8)
    assert amplified.any() and np.array_equal(difference, amplified)
    at = WIDTH // 4  # the last column of the left and the first of the right are the white line
    assert np.array_equal(split[:, : at - 1], fast[:, : at - 1]) and (split[:, at - 1 : at + 1] == 255).all()
    assert np.array_equal(split[:, at + 1 :], exact[:, at + 1 :])
    begin, end = WIDTH // 2 - WIDTH // 6, WIDTH // 2 + WIDTH // 6
    assert np.array_equal(both[:, : begin - 1], fast[:, : begin - 1])
    assert np.array_equal(both[:, begin:end], amplified[:, begin:end])
    assert np.array_equal(both[:, end + 1 :], exact[:, end + 1 :])


def near(frame: np.ndarray, expected: np.ndarray) -> bool:
    """Within one step of 255: the last bit of a rounded logarithm is anyone's."""
    return bool((np.abs(frame.astype(int) - np.rint(255 * expected)) <= 1).all())


def test_evaluations_are_a_logarithmic_ramp(tmp_path: Path) -> None:
    [frame] = viewer.headless(tmp_path, [{"mode": "evals"}], SIZE)
    at = np.minimum(np.log2(1 + planes(tmp_path, "opt4")["evals"]) / 8, 1)
    stops = np.array([[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0], [1, 1, 0], [1, 0, 0]])
    ramp = [np.interp(at, np.linspace(0, 1, 6), stops[:, channel]) for channel in range(3)]
    assert near(frame, np.stack(ramp, -1)) and len(np.unique(frame.reshape(-1, 3), axis=0)) > 50


def test_depth_normals_and_ids(tmp_path: Path) -> None:
    lines = [{"mode": "depth"}, {"mode": "normals"}, {"mode": "ids"}]
    depth, normals, ids = viewer.headless(tmp_path, lines, SIZE)
    found = planes(tmp_path, "opt4")
    hit, t = found["id"] >= 0, found["Z"]
    near_1, far_1 = 1 / t[hit].min(), 1 / t[hit].max()
    grey = 0.15 + 0.85 * (1 / t - far_1) / (near_1 - far_1)
    assert near(depth, np.where(hit, grey, 0)[..., None])
    normal = np.stack([found[f"N.{axis}"] for axis in "xyz"], -1)
    assert near(normals, np.where(hit[..., None], (normal + 1) / 2, 0))
    colours = {tuple(map(int, ids[found["id"] == shape][0])) for shape in np.unique(found["id"])}
    assert len(colours) == 7 and len(np.unique(ids.reshape(-1, 3), axis=0)) == 7  # six shapes and none
    assert (0, 0, 0) in colours


def test_frames_go_there_in_a_straight_line(tmp_path: Path) -> None:
    begin = {"position": [0, 0, 0], "look_at": [0, 0, 1], "light": [0, 100, 0]}
    end = {"position": [1, 0.5, 2], "look_at": [0, 0, 9], "light": [40, 60, 0]}
    half = {key: [(a + b) / 2 for a, b in zip(begin[key], end[key], strict=True)] for key in begin}
    frames = viewer.headless(tmp_path, [begin, end | {"frames": 2}, half, end], SIZE)
    assert len(frames) == 5 and not np.array_equal(frames[0], frames[1])
    assert np.array_equal(frames[1], frames[3]) and np.array_equal(frames[2], frames[4])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"phase": "opt4"}\n{"mode": "grey"}\n', ":2: mode: "),
        ('{"position": [0, 1]}\n', ":1: position: "),
        ('{"phase": "opt99"}\n', 'phase: "opt99"'),
        ('{"up": [0, 0, 1]}\n', "look_at"),
        ('{"mod": "ids"}\n', ":1: mod "),
        ('{"divider": 1.5}\n', ":1: divider: "),
        ('{"phase": "fixed"}\n', "soft shadows"),
        ('{"frames": 2\n', ":1: "),
        ("\n", "no frame"),
    ],
)
def test_a_bad_script_is_one_line(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "bad.jsonl").write_text(text)
    done = viewer.run(
        ["--script", tmp_path / "bad.jsonl", "--headless", "-o", tmp_path / "out", "--phase", "opt4"]
    )
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert done.stderr.startswith("viewer: ") and said in done.stderr


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (["nowhere"], 2, "nowhere"),
        (["--phase", "opt99"], 2, '"opt99"'),
        (["--phase", "fixed"], 4, "soft shadows"),
        (["--size", "3"], 2, "64x36 to 8192x8192"),
        (["--threads", "0"], 2, "--threads: 1 to 4096"),
        (["--headless"], 2, "--script"),
        (["--nothing"], 2, "--nothing"),
        (["a", "b"], 2, "SCENE"),
    ],
)
def test_bad_arguments_are_one_line(words: list[str], status: int, said: str) -> None:
    done = viewer.run(words)
    assert done.returncode == status and done.stderr.count("\n") == 1 and said in done.stderr


def test_without_a_display_it_is_one_line() -> None:
    done = viewer.run([])
    assert done.returncode == 2 and done.stdout == "" and done.stderr.count("\n") == 1
    assert "no display" in done.stderr or "built without SDL2" in done.stderr


def test_the_list_has_every_phase_that_runs_here() -> None:
    listed = viewer.run(["--list"]).stdout.split()
    assert listed[:4] == ["baseline", "opt1", "opt2", "opt3"]
    assert set(listed) <= set(patches.folders()) - {"truth"}
