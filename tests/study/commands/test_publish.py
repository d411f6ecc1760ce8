"""stepwise publish: a small folder from which the report makes every chapter that it makes of the run."""

import gzip
import html
import json
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import complete
import numpy as np
import pytest

from study.commands.upkeep import publish as publishing
from study.core import store
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.experiments.rods import pictures as rods_pictures
from study.experiments.systems import pictures as systems_pictures
from study.pictures import images

pytestmark = pytest.mark.slow

FIXTURE = ROOT / "tests" / "fixtures" / "run"


@pytest.fixture
def made(tmp_path) -> Path:
    """A run with files of the systems and a picture that is too large."""
    run = tmp_path / "run"
    shutil.copytree(FIXTURE, run)
    for name in ("fixed.json", "rods.json", "throttle.json"):
        complete.write(run / name, complete.published(name))
    complete.write(run / "counts.json", {"schema": 1, "declared": [], "measured": []})
    noise = np.random.default_rng(1).integers(0, 256, (300, 480, 3), dtype=np.uint8)
    images.write_png(run / "images" / f"{rods_pictures.PICTURES}.png", noise)
    return run


def test_a_published_folder_makes_the_whole_chapter(made, tmp_path, stepwise):
    """With the picture of the systems that the run has, rays and rods, but not the sheet of all."""
    complete.write(made / "packets.json", complete.published("packets.json"))
    folder = tmp_path / "published"
    content = json.loads((made / "rods.json").read_text())
    content["context"] = {"git": {"commit": "f" * 40, "dirty": False}, "time": "2026-01-01T00:00:00+00:00"}
    store.write_json(made / "rods.json", content)
    told = ("--command", "make study", "make systems", "--caveat", 'a "busy" machine')
    done = stepwise("publish", made, folder, "--unclean", *told)
    assert done.returncode == 0, done.stderr
    assert "ffffffffff: rods\n" in done.stdout
    assert gzip.decompress((folder / "frames.jsonl.gz").read_bytes()) == (made / "frames.jsonl").read_bytes()
    packed = folder / "counts.json.gz"
    assert not (folder / "counts.json").exists()
    assert store.read_json(packed) == store.read_json(made / "counts.json")
    again = tmp_path / "again"
    again.mkdir()
    publishing.copy_files(folder, again)
    assert (again / packed.name).read_bytes() == packed.read_bytes()
    picture = folder / "images" / f"{rods_pictures.PICTURES}.png"
    small = images.oiio.ImageBuf(str(picture)).spec()
    found = {file.name: file.stat().st_size for file in (folder / "images").iterdir()}
    assert found.keys() == {picture.name}
    assert all(100_000 < size <= 300_000 for size in found.values()), "as large as fits"
    assert small.width / small.height == pytest.approx(1.6, rel=0.01) and small.nchannels == 3
    assert not (folder / "tables").exists()
    said = tomllib.loads((folder / "run.toml").read_text())
    assert said["commands"] == ["make study", "make systems"] and said["caveat"] == 'a "busy" machine'
    assert said["commit"].endswith("ffffffffff")
    page = tmp_path / "page" / "index.html"
    done = stepwise("report", folder, "-o", page)
    assert done.returncode == 0, done.stderr
    text = html.unescape(page.read_text())
    assert "the throttle's choice" in text and rods_pictures.CAPTION in text
    assert systems_pictures.CAPTION not in text
    assert (page.parent / "tables" / "throttle.md").is_file()


def test_what_is_there_is_not_written_over(made, tmp_path, stepwise):
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "mine").write_text("")
    done = stepwise("publish", made, tmp_path / "there", "--unclean")
    assert done.returncode == 2 and "not empty" in done.stderr
    done = stepwise("publish", tmp_path / "there", tmp_path / "new", "--unclean")
    assert done.returncode == 2 and "plan.json" in done.stderr


def test_a_failure_leaves_nothing_and_the_next_try_goes_through(tmp_path, monkeypatch):
    folder = tmp_path / "new" / "published"
    for step in ("copy_files", "copy_pictures", "about", "shown"):
        copied = OSError(28, "No space left on device", "a file of the run", None, "its copy")
        for error in (StudyError("lost"), OSError(28, "No space left on device"), copied):
            with monkeypatch.context() as patch:

                def fail(*_, error=error):
                    raise error

                patch.setattr(publishing, step, fail)
                with pytest.raises(StudyError, match=f"^lost|^{folder}: .*No space left"):
                    publishing.publish(FIXTURE, folder, [], "")
            assert list(folder.parent.iterdir()) == []
    folder.mkdir()  # an empty one is made use of
    publishing.publish(FIXTURE, folder, [], "")
    assert [path.name for path in folder.parent.iterdir()] == ["published"]
    assert (folder / "plan.json").exists() and folder.stat().st_mode == folder.parent.stat().st_mode


def ended(command, folder):
    """The status of a publication that gets SIGTERM once its first file is there."""
    script = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        latest = time.monotonic() + 60
        while not (folder.parent.exists() and list(folder.parent.iterdir())):
            assert script.poll() is None and time.monotonic() < latest
            time.sleep(0.01)
        script.send_signal(signal.SIGTERM)
        said = script.communicate(timeout=60)[1]
        assert script.returncode == 0 or said.endswith("ended by SIGTERM\n")
    finally:
        script.kill()
        script.wait()
    return script.returncode


def test_one_that_is_ended_leaves_nothing(made, tmp_path):
    """One that was done when the signal came is whole, and another is tried."""
    for attempt in range(5):
        folder = tmp_path / str(attempt) / "published"
        status = ended(
            [sys.executable, ROOT / "scripts" / "stepwise", "publish", made, folder, "--unclean"], folder
        )
        if status or not (folder / "run.toml").exists():
            break
    assert status == 128 + signal.SIGTERM
    assert list(folder.parent.iterdir()) == []


def test_a_run_that_is_measured_is_refused_and_a_torn_line_dropped(tmp_path, stepwise):
    run, folder = tmp_path / "run", tmp_path / "published"
    shutil.copytree(FIXTURE, run)
    whole = (run / "frames.jsonl").read_bytes()
    measuring = store.Run(run)
    measuring.lock()
    done = stepwise("publish", run, folder, "--unclean")
    assert done.returncode == 2
    assert not folder.exists()
    measuring.close()
    torn = whole + b'{"phase": "bas'
    (run / "frames.jsonl").write_bytes(torn)
    done = stepwise("publish", run, folder, "--unclean")
    assert done.returncode == 0
    assert gzip.decompress((folder / "frames.jsonl.gz").read_bytes()) == whole
    assert (run / "frames.jsonl").read_bytes() == torn


def test_a_chapter_that_is_lost_is_an_error(made, tmp_path, monkeypatch):
    monkeypatch.setattr(publishing, "copy_pictures", lambda *_: [])  # of systems
    with pytest.raises(StudyError, match=": systems"):
        publishing.publish(made, tmp_path / "published", [], "")
    assert not (tmp_path / "published").exists()
