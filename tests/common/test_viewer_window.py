"""The viewer's window under Xvfb, driven by real key and mouse events (xdotool, XTEST).

What it shows is read from its screenshots (K), its scene files (F), its recordings (L) and the X server's own
memory. A recording's last line says what was shown.
"""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import viewer

from study.pictures import images

SCREEN, WIDTH, HEIGHT = (640, 480), 320, 180
LEFT, TOP = (SCREEN[0] - WIDTH) // 2, (SCREEN[1] - HEIGHT) // 2
SCENE0 = viewer.ROOT / "common/scenes/scene0.json"
pytestmark = pytest.mark.slow


class Window:
    """A viewer on an X server of its own; its files are in `folder`."""

    def __init__(self, folder: Path, words: list[str]) -> None:
        self.folder = folder
        self.screen = folder / "Xvfb_screen0"
        read, write = os.pipe()
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write), "-screen", "0", "640x480x24", "-fbdir", str(folder)],
            pass_fds=[write],
            stderr=subprocess.DEVNULL,
        )
        os.close(write)
        with os.fdopen(read) as number:
            self.environment = os.environ | {"DISPLAY": f":{number.readline().strip()}"}
        self.viewer = subprocess.Popen(
            [viewer.PROGRAM, *words, "--size", f"{WIDTH}x{HEIGHT}", "--threads", "1"],
            cwd=folder,
            env=self.environment,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.until(lambda: (self.grab() != 0).any(), "a picture")
        self.do("mousemove", str(LEFT + 80), str(TOP + 90))

    def said(self) -> str:
        """Standard error, after its end."""
        return self.viewer.stderr.read() if self.viewer.stderr else ""

    def do(self, *words: str) -> None:
        subprocess.run(["xdotool", *words], env=self.environment, check=True)

    def key(self, *keys: str) -> None:
        """Presses keys one after the other; each lasts until the window can have seen it."""
        for key in keys:
            self.do("key", "--delay", "60", key)

    def hold(self, seconds: float, *keys: str) -> None:
        self.do("keydown", *keys)
        time.sleep(seconds)
        self.do("keyup", *keys)

    def until(self, holds: Callable[[], bool], what: str) -> None:
        end = time.monotonic() + 20
        while not holds():
            assert self.viewer.poll() is None, self.said()
            assert time.monotonic() < end, f"no {what} in 20 s"
            time.sleep(0.05)

    def grab(self) -> np.ndarray:
        """The window as the X server has it (an XWD file): height × width × 3."""
        head = np.fromfile(self.screen, ">u4", 25)
        start, row = head[0] + 12 * head[19], head[12]
        rows = np.fromfile(self.screen, np.uint8, offset=int(start))[: int(row) * SCREEN[1]]
        screen = rows.reshape(SCREEN[1], -1)[:, : 4 * SCREEN[0]].reshape(SCREEN[1], SCREEN[0], 4)
        return screen[TOP : TOP + HEIGHT, LEFT : LEFT + WIDTH, 2::-1]

    def file(self, key: str, name: str) -> Path:
        """Presses a key that writes a file, and waits until it is whole."""
        path = self.folder / name
        self.key(key)
        self.until(lambda: path.exists() and path.stat().st_size > 0, name)
        time.sleep(0.2)
        return path

    def recorded(self) -> dict[str, Any]:
        """What is shown now, by a short recording."""
        number = len(list(self.folder.glob("path-*.jsonl"))) + 1
        path = self.folder / f"path-{number:04}.jsonl"
        self.key("l")
        self.until(path.exists, path.name)
        time.sleep(0.6)  # a frame at rest takes a fifth of a second
        self.key("l")
        self.until(lambda: path.stat().st_size > 0, path.name)
        time.sleep(0.3)
        return json.loads(path.read_text().splitlines()[-1])

    def screenshot(self) -> np.ndarray:
        """Without text, with every pixel rendered."""
        number = len(list(self.folder.glob("view-*.png"))) + 1
        return images.read_png(self.file("k", f"view-{number:04}.png"))

    def end(self) -> None:
        for process in (self.viewer, self.server):
            process.kill()
            process.wait()


@pytest.fixture(scope="module", autouse=True)
def program() -> None:
    viewer.window_tools()
    viewer.build("libpng", "sdl2")


@pytest.fixture
def window(tmp_path: Path) -> Iterator[Callable[..., Window]]:
    opened = []

    def open_window(*words: str) -> Window:
        opened.append(Window(tmp_path, list(words) or ["--phase", "opt4", "--reference", "opt2"]))
        return opened[-1]

    yield open_window
    for one in opened:
        one.end()


def bare(one: Window) -> Window:
    """Takes the text away, and waits until every pixel is rendered."""
    one.key("r", "o")
    time.sleep(2)
    return one


def test_a_screenshot_is_what_the_screen_has_and_the_driver_draws(
    window: Callable[..., Window], tmp_path: Path
) -> None:
    one = bare(window())
    shot = one.screenshot()
    assert np.array_equal(shot, viewer.displayed(tmp_path, "opt4", SCENE0, HEIGHT))
    time.sleep(4.5)  # the line that says the file's name goes
    assert np.array_equal(one.grab(), shot)


def scene_of(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text())


def test_moving_and_a_scene_file_of_the_view(window: Callable[..., Window], tmp_path: Path) -> None:
    one = bare(window())
    one.hold(0.7, "w")
    one.hold(0.7, "d")
    one.hold(0.7, "Right")
    moved = scene_of(one.file("f", "view-0001.json"))
    at, light = moved["camera"]["position"], moved["light"]["position"]
    assert at[2] > 0.05 and at[0] > 0.05 and at[1] == 0  # forward is z, right is x
    assert np.allclose(np.subtract(moved["camera"]["look_at"], at), [0, 0, 1])
    assert light[0] > 0.1 and light[1:] == [100, 0]
    time.sleep(4.5)
    shot = one.screenshot()
    assert np.array_equal(shot, viewer.displayed(tmp_path, "opt4", tmp_path / "view-0001.json", HEIGHT))
    assert scene_of(SCENE0)["shapes"] == moved["shapes"]
    one.key("Home")
    assert one.recorded()["position"] == [0, 0, 0]


def test_the_mouse_looks_around_and_moves_the_divider(window: Callable[..., Window]) -> None:
    one = window()
    one.do("mousedown", "1")
    for _ in range(10):
        one.do("mousemove_relative", "6", "0")
    one.do("mouseup", "1")
    time.sleep(0.3)
    look = one.recorded()["look_at"]
    angle = 60 * 2 * np.tan(np.radians(15)) / HEIGHT  # of 60 pixels, at 30 degrees of view
    assert np.allclose(look, [-np.sin(angle), 0, np.cos(angle)], atol=1e-9)
    one.key("v")
    one.do("keydown", "shift", "keydown", "d", "keyup", "shift")
    time.sleep(0.4)  # Shift is let go first
    one.do("keyup", "d")
    one.key("plus")
    one.do("mousemove", str(LEFT + 240), str(TOP + 90))
    time.sleep(0.5)
    shown = one.recorded()
    assert shown["divider"] == 240 / WIDTH and shown["mode"] == "difference" and shown["amplify"] == 32
    assert shown["position"] == [0, 0, 0]  # Shift+D does not move


def test_keys_choose_phases_scenes_and_modes(window: Callable[..., Window]) -> None:
    one = window()
    shown = []
    for keys in (["2", "ctrl+3"], ["b"], ["p", "e"], ["Tab"], ["shift+Tab", "z"], ["n"], ["i"], ["c"]):
        one.key(*keys)
        time.sleep(0.5)
        line = one.recorded()
        shown.append((line["phase"], line["reference"], line["mode"], Path(line["scene"]).stem))
    assert shown == [
        ("opt2", "opt3", "colours", "scene0"),
        ("baseline", "opt3", "colours", "scene0"),
        ("opt1", "opt3", "evals", "scene0"),
        ("opt1", "opt3", "evals", "scene0_plain"),
        ("opt1", "opt3", "depth", "scene0"),
        ("opt1", "opt3", "normals", "scene0"),
        ("opt1", "opt3", "ids", "scene0"),
        ("opt1", "opt3", "colours", "scene0"),
    ]


def test_a_recording_plays_bit_for_bit(window: Callable[..., Window], tmp_path: Path) -> None:
    one = bare(window("spheres40_animated", "--phase", "opt9_convex", "--reference", "opt2"))
    one.key("l")
    one.hold(0.5, "w")
    one.key("space", "l")
    path = tmp_path / "path-0001.jsonl"
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert len(lines) > 5 and lines[-1]["seconds"] > lines[0]["seconds"] > 0
    assert lines[-1]["position"] != lines[0]["position"]
    time.sleep(4.5)
    shot = one.screenshot()
    frames = viewer.headless(tmp_path, lines, f"{WIDTH}x{HEIGHT}")
    assert np.array_equal(frames[-1], shot) and not np.array_equal(frames[0], shot)


def test_a_camera_flies_until_one_steers(window: Callable[..., Window]) -> None:
    one = window("flythrough", "--phase", "opt9_convex", "--reference", "opt2")
    camera = scene_of(viewer.ROOT / "common/scenes/animated/flythrough.json")["camera"]
    line = one.recorded()
    part = (1 - np.cos(2 * np.pi * line["seconds"] / camera["path"]["period"])) / 2
    start, to = np.array(camera["position"]), np.array(camera["path"]["to"])
    assert line["seconds"] > 0 and np.allclose(line["position"], start + part * (to - start), atol=1e-12)
    one.hold(0.5, "s")
    left, later = one.recorded(), one.recorded()
    assert left["position"] == later["position"] and left["seconds"] == later["seconds"]
    saved = scene_of(one.file("f", "view-0001.json"))["camera"]
    assert saved["position"] == later["position"]
    assert not saved.get("path")
    one.key("Home")
    again, later = one.recorded(), one.recorded()
    assert again["position"] != later["position"] and again["seconds"] < later["seconds"]


def test_the_throttle_is_of_rods_and_is_on_the_screen(window: Callable[..., Window]) -> None:
    """Text on the second row of blocks appears with T and goes with it; another phase ends it."""
    one = window("mandelbulb_closeup", "--phase", "rods_simd", "--reference", "opt2")
    one.key("o")
    time.sleep(1)
    one.key("o")
    time.sleep(1)
    text = slice(58, 66), slice(4, 250)  # below the five lines of figures

    def white() -> int:
        return int((one.grab()[text] == 255).all(-1).sum())

    before = white()
    one.key("t")
    one.until(lambda: white() > before + 50, "line of the throttle")
    assert one.viewer.poll() is None
    one.key("t")
    one.until(lambda: white() <= before + 5, "end of the line")
    one.key("4", "t")
    time.sleep(1)
    assert one.recorded()["phase"] == "opt4" and one.viewer.poll() is None


def test_a_phase_that_refuses_the_scene_leaves_the_picture(window: Callable[..., Window]) -> None:
    """A reference that cannot draw a soft shadow: said, and nothing changes."""
    one = window("scene0_plain", "--phase", "opt4", "--reference", "fixed_float")
    one.key("v", "Tab")
    time.sleep(2)
    line = one.recorded()
    assert line["divider"] is False and Path(line["scene"]).stem != "scene0_plain"
    assert one.viewer.poll() is None
