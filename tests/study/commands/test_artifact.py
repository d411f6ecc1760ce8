"""The artifact's zip: the same bytes for one commit, a whole MANIFEST, and work from the zip alone."""

import hashlib
import os
import re
import stat
import subprocess
import time
import zipfile
from pathlib import Path

import pytest

from study.commands.upkeep import artifact
from study.core import cli
from study.core.host import checkout
from study.core.registry import ROOT

GIT = ["git", "-c", "user.name=A", "-c", "user.email=a@example.org", "-c", "core.umask=077"]


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """With a program, a link and a file that is not committed."""
    made = tmp_path / "one"
    (made / "bin").mkdir(parents=True)
    (made / "bin" / "run").write_text("#!/bin/sh\necho ran\n")
    (made / "bin" / "run").chmod(0o755)
    (made / "a b").write_text("1\n")
    (made / "link").symlink_to("a b")
    for words in (["init", "-q"], ["add", "-A"], ["commit", "-qm", "x"]):
        subprocess.run([*GIT, "-C", made, *words], check=True, capture_output=True)
    (made / "later").write_text("2\n")
    monkeypatch.setattr(checkout, "ROOT", made)
    return made


def packed(stepwise, out: Path) -> bytes:
    done = stepwise("artifact", "-o", out)
    assert done.returncode == 0 and hashlib.sha256(out.read_bytes()).hexdigest() in done.stdout, done.stderr
    return out.read_bytes()


def unpacked(path: Path, folder: Path) -> Path:
    """As unzip does: with rights and links."""
    with zipfile.ZipFile(path) as archive:
        for one in archive.infolist():
            mode, made = one.external_attr >> 16, Path(archive.extract(one, folder))
            if stat.S_ISLNK(mode):
                made.unlink()
                made.symlink_to(archive.read(one).decode())
            else:
                made.chmod(stat.S_IMODE(mode))
    assert [one.name for one in folder.iterdir()] == [artifact.FOLDER]
    made = folder / artifact.FOLDER
    subprocess.run(["sha256sum", "--quiet", "--check", "--strict", artifact.MANIFEST], cwd=made, check=True)
    return made


def test_one_commit_has_one_zip(repository, tmp_path, monkeypatch, stepwise) -> None:
    """In another checkout too, of another time, under another umask. What is not committed is said."""
    first = stepwise("artifact", "-o", tmp_path / "a.zip")
    assert first.returncode == 0 and first.stderr.count("\n") == 1
    subprocess.run([*GIT, "clone", "-q", repository, tmp_path / "two"], check=True)
    monkeypatch.setattr(checkout, "ROOT", tmp_path / "two")
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    time.tzset()
    assert packed(stepwise, tmp_path / "b.zip") == (tmp_path / "a.zip").read_bytes()
    monkeypatch.undo()
    time.tzset()
    made = unpacked(tmp_path / "a.zip", tmp_path / "out")
    names = {str(path.relative_to(made)) for path in made.rglob("*") if not path.is_dir()}
    listed = {line.partition("  ")[2] for line in (made / "MANIFEST").read_text().splitlines()}
    assert names == {"bin/run", "a b", "link", "MANIFEST"} == {*listed, "MANIFEST"}
    assert os.readlink(made / "link") == "a b"
    assert subprocess.check_output([made / "bin" / "run"], text=True) == "ran\n"


def test_without_a_repository_there_is_none(tmp_path, monkeypatch, stepwise) -> None:
    monkeypatch.setattr(checkout, "ROOT", tmp_path)
    done = stepwise("artifact", "-o", tmp_path / "a.zip")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (cli.CANNOT_RUN, "", 1)
    assert not (tmp_path / "a.zip").exists()


def test_the_image_is_named_by_its_digest() -> None:
    text = (ROOT / "Containerfile").read_text()
    assert re.search(r"^FROM [\w./]+@sha256:[0-9a-f]{64}$", text, re.MULTILINE)


@pytest.mark.slow
def test_the_renderer_is_built_and_draws_from_the_zip_alone(tmp_path, stepwise) -> None:
    """Without git, with a home of its own; the packages are this project's. The commit is known there."""
    if not (ROOT / ".git").exists():
        pytest.skip("this is an artifact itself")
    packed(stepwise, tmp_path / "a.zip")
    folder = unpacked(tmp_path / "a.zip", tmp_path / "out")
    for name in ("docs/artifact.md", "requirements.lock", "Containerfile", "results/reference/README.md"):
        assert (folder / name).is_file()
    (folder / ".venv").symlink_to(ROOT / ".venv")
    (tmp_path / "home").mkdir()
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("GIT_", "STEPWISE_"))}
    environment |= {"HOME": str(tmp_path / "home")}
    words = ["make", "demo", "PHASE=opt2", "ARGS=--budget 2"]
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0 and (folder / "build" / "demo.png").stat().st_size > 10_000, done.stderr
    said = "from study.core.host import checkout; print(checkout.state().commit)"
    told = ["env", f"PYTHONPATH={folder / 'scripts'}", ROOT / ".venv/bin/python", "-c", said]
    head = subprocess.check_output(["git", "rev-parse", "HEAD"], cwd=ROOT, text=True)
    assert subprocess.check_output(told, cwd=folder, env=environment, text=True) == head
