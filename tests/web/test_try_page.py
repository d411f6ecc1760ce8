"""The page of `make web` in headless Chromium: its pictures, and what it does with mouse, keys and text."""

from __future__ import annotations

import http.server
import json
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import needs
import numpy as np
import pytest
from phase_pictures import picture

from study.core import registry
from study.core.build import build
from study.core.registry import ROOT
from study.pictures import gate, images

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
LACKS = [
    name for name in ("emcc", "chromium") if not (shutil.which(name) or (name == "chromium" and CHROMIUM))
]
pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(LACKS), reason=f"needs {', '.join(LACKS)}")]

PHASES = ["baseline", "opt1", "opt2", "opt6_wide", "opt7_tiles", "opt8_streams", "opt9_convex", "opt11_ideal"]
# What is drawn: scene0 by all, a Mandelbulb, and rays in batches among more shapes than lists hold.
DRAWN = [
    *((phase, "scene0") for phase in PHASES),
    ("opt8_streams", "mandelbulb"),
    ("opt9_convex", "crowd256"),
]
WIDTH, HEIGHT = 128, 72
PLANES = {"R": 0, "G": 1, "B": 2, "Z": 3, "id": 4, "N.x": 5, "N.y": 6, "N.z": 7, "evals": 8}
BROKEN = ('{"camera": 1', '{"camera": {}, "lights": 1}', "[]")
USE = Path(__file__).with_name("use.js")  # behind the page's own scripts


class Told(http.server.ThreadingHTTPServer):
    """Keeps what the page tells, by its name."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Answer)
        self.bodies: dict[str, bytes] = {}
        self.done = threading.Event()


class Answer(http.server.BaseHTTPRequestHandler):
    server: Told

    def do_POST(self) -> None:
        name = self.path[1:]
        self.server.bodies[name] = self.rfile.read(int(self.headers["Content-Length"]))
        self.send_response(204)
        self.end_headers()
        if name == "done":
            self.server.done.set()

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture(scope="module")
def page() -> Path:
    done = subprocess.run(["make", "web"], cwd=ROOT, capture_output=True, text=True, timeout=1800)
    if "cannot be fetched" in done.stderr:
        pytest.skip("needs the source of jansson (apt-get)")
    assert done.returncode == 0, done.stdout + done.stderr
    return ROOT / "report" / "out" / "try.html"


@pytest.fixture(scope="module")
def told(page: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, bytes]]:
    """What the page told after it was used, in a window of 1280 pixels."""
    folder = tmp_path_factory.mktemp("web")
    server = Told()
    threading.Thread(target=server.serve_forever, daemon=True).start()
    script = USE.read_text()
    for name, value in {
        "PORT": server.server_port,
        "BROKEN": BROKEN,
        "DRAWN": DRAWN,
        "WIDTH": WIDTH,
        "HEIGHT": HEIGHT,
    }.items():
        script = script.replace(name, json.dumps(value))
    (folder / "try.html").write_text(page.read_text().replace("</body>", f"<script>{script}</script></body>"))
    command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--window-size=1280,1000"]
    command += ["--disable-background-networking", f"--user-data-dir={folder / 'browser'}"]
    browser = subprocess.Popen(
        [*command, (folder / "try.html").as_uri()], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        assert server.done.wait(300), f"the page told only {sorted(server.bodies)}"
        yield server.bodies
    finally:
        browser.kill()
        browser.wait()
        server.shutdown()


@pytest.fixture(scope="module")
def said(told: dict[str, bytes]) -> dict:
    found = json.loads(told["done"])
    assert "stopped" not in found, found["stopped"]
    return found


@pytest.fixture(scope="module")
def drawn(said: dict, told: dict[str, bytes]) -> Callable[[str, str], images.Picture]:
    """A phase's picture of a scene in the browser."""

    def of(phase: str, scene: str) -> images.Picture:
        pixels, at, planes = WIDTH * HEIGHT, 0, []
        samples = np.frombuffer(told[f"{phase}-{scene}"], np.float32)
        for channels in (3, 1, 1, 3, 1):
            planes.append(samples[at : at + channels * pixels].reshape(HEIGHT, WIDTH, channels))
            at += channels * pixels
        every = np.concatenate(planes, axis=-1)
        return images.Picture({name: np.ascontiguousarray(every[..., i]) for name, i in PLANES.items()})

    return of


def test_one_small_file_needs_nothing_else(page: Path) -> None:
    text = page.read_text()
    assert len(text.encode()) <= 3_000_000
    assert "http" not in text.partition("<script")[0].replace("http-equiv", "") and "src=" not in text


def test_a_full_disk_is_one_line_and_leaves_what_was_there(tmp_path: Path) -> None:
    """A limit on the size of a file stands for the disk."""
    page = tmp_path / "try.html"
    page.write_text("earlier")
    command = ["sh", "-c", 'ulimit -f 8; exec "$@"', "sh", sys.executable, ROOT / "web" / "build.py"]
    done = subprocess.run([*command, tmp_path, page], capture_output=True, text=True)  # without a phase
    assert (done.returncode, done.stderr.count("\n")) == (1, 1), done.stderr
    assert f"{page}: cannot be written" in done.stderr
    assert [path.read_text() for path in tmp_path.iterdir()] == ["earlier"]


def test_no_script_fails_and_the_first_picture_comes_soon(said: dict) -> None:
    assert said["failed"] == [] and said["overflow"] <= 0 and said["cut"] == []
    assert said["wide"][0] == said["wide"][1]  # the controls are as wide as the picture
    assert said["first"] < 10_000  # ms
    assert "opt11_ideal" in said["figures"] and "baseline" in said["figures"]


def test_mouse_keys_and_fingers_move_the_camera(said: dict) -> None:
    """The view: position, right, up, forward, tangent, light, emission."""
    views = {name: np.array(view) for name, view in said["views"].items()}
    start, turned, walked, pinched, lit = (
        views[name] for name in ("start", "turned", "walked", "pinched", "lit")
    )
    assert np.array_equal(turned[:3], start[:3]) and not np.allclose(turned[9:12], start[9:12])
    for before, after in ((turned, walked), (walked, pinched)):
        step = after[:3] - before[:3]  # fingers slip sideways too
        assert np.dot(step, turned[9:12]) > 0.9 * np.linalg.norm(step) > 0
        assert np.allclose(after[9:12], turned[9:12], atol=1e-12)
    assert (
        np.allclose(lit[:13], pinched[:13], atol=1e-12) and np.dot(lit[13:16] - pinched[13:16], lit[3:6]) > 0
    )
    assert np.array_equal(views["home"], start) and said["focused"]
    assert said["divider"] == "25%" and said["flies"]


def test_the_difference_and_the_evaluations_are_shown(said: dict) -> None:
    """opt11_ideal draws other shadows than opt6_wide; opt1 and opt2 evaluate equally often."""
    assert said["beside"] == "split"
    assert said["difference"] > 100 and 20 < float(said["db"].partition("PSNR ")[2].split()[0]) < 60
    assert said["evaluations"][0] == pytest.approx(said["evaluations"][1], rel=1e-2)
    assert said["evaluations"][0] > 5
    assert "1.0" not in said["uncounted"]  # of a phase that does not count


def test_a_wrong_scene_gets_the_readers_own_message(said: dict, tmp_path: Path) -> None:
    for text, told in zip(BROKEN, said["errors"], strict=True):
        (tmp_path / "scene.json").write_text(text)
        done = subprocess.run(
            [build("opt1"), "scene.json", "-n", "8"], cwd=tmp_path, capture_output=True, text=True
        )
        assert done.returncode and done.stderr.strip().endswith(told) and told.startswith("scene.json:")
    assert said["error"] == "" and said["sky"] == [0, 255, 0, 255]


@pytest.mark.parametrize(("phase", "scene"), DRAWN)
def test_a_picture_is_within_its_phases_tolerance(
    phase: str, scene: str, drawn: Callable[[str, str], images.Picture], tmp_path: Path
) -> None:
    """To baseline's in the browser; held to truth alone, and on other scenes, to its own native one's."""
    one = registry.phases()[phase]
    found = drawn(phase, scene)
    if phase == "baseline" or scene != "scene0" or gate.left_to_truth(one):
        needs.cpu_for(phase)
        path = next((ROOT / "common" / "scenes").rglob(f"{scene}.json"))
        native = picture(phase, path, tmp_path, size=(WIDTH, HEIGHT))
        metrics = images.compare(images.Picture({name: native[name] for name in PLANES}), found)
        assert metrics["psnr_db"] > 60 and metrics["mask_mismatch_ppm"] == 0, metrics
    else:
        metrics = images.compare(drawn("baseline", scene), found)
        assert not gate.failures(metrics, gate.tolerance(one, registry.scenes()[scene])), metrics
