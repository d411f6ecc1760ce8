"""What is known of the sources' version, in every kind of checkout."""

from __future__ import annotations

import json
import subprocess
import tarfile
from pathlib import Path

import pytest

from study.core import provenance
from study.core.cli import StudyError
from study.core.host import checkout
from study.core.registry import ROOT
from study.core.run_schema import Git


def git(where: Path, *arguments: str) -> None:
    who = ["-c", "user.name=A", "-c", "user.email=a@example.org", "-c", "protocol.file.allow=always"]
    subprocess.run(["git", "-C", where, *who, *arguments], check=True, capture_output=True)


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """With two commits."""
    made = tmp_path / "käfig's repository"
    made.mkdir()
    git(made, "init", "-q")
    for text in ("1", "2"):
        (made / "a").write_text(text)
        (made / checkout.ARCHIVED).write_text("$Format:%H$\n")
        (made / ".gitattributes").write_text((ROOT / ".gitattributes").read_text())
        git(made, "add", "-A")
        git(made, "commit", "-qm", text)
    return made


def state(monkeypatch: pytest.MonkeyPatch, root: Path) -> Git:
    monkeypatch.setattr(checkout, "ROOT", root)
    return checkout.state()


def test_kinds_of_checkout(monkeypatch, tmp_path, repository):
    clean = state(monkeypatch, repository)
    assert (clean.dirty, clean.unknown) == (False, None)
    git(repository, "worktree", "add", "-q", str(tmp_path / "tree"))
    git(tmp_path, "clone", "-q", "--depth=1", f"file://{repository}", "shallow")
    (tmp_path / "outer").mkdir()
    git(tmp_path / "outer", "init", "-q")
    git(tmp_path / "outer", "submodule", "add", "-q", str(repository), "inner")
    (tmp_path / "link").symlink_to(repository)
    for name in ("tree", "shallow", "outer/inner", "link"):
        assert state(monkeypatch, tmp_path / name) == clean


def test_unknown_commits_are_not_clean(monkeypatch, tmp_path, repository):
    known = state(monkeypatch, repository).commit
    assert known
    git(repository, "archive", "-o", str(tmp_path / "a.tar"), "HEAD")
    with tarfile.open(tmp_path / "a.tar") as archive:
        archive.extractall(tmp_path / "archive", filter="data")
    copy = repository / "third_party" / "stepwise"
    copy.mkdir(parents=True)
    inside = state(monkeypatch, copy)
    assert (inside.commit, inside.dirty) == (None, None) and inside.unknown
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path))
    found = state(monkeypatch, tmp_path / "archive")
    assert (found.commit, found.dirty) == (known, None)
    assert checkout.said(found).startswith(known[:10]) and not checkout.is_clean(found)
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", "1")  # git's own, for tests
    other = state(monkeypatch, repository)
    assert other.commit is None and other.unknown and "safe.directory" in other.unknown
    monkeypatch.setenv("PATH", str(tmp_path))
    assert state(monkeypatch, repository).commit is None


UNCLEAN = [
    ({"commit": "1" * 40, "dirty": True}, "1111111111 with uncommitted changes"),
    ({"commit": None, "dirty": False}, "unknown commit"),  # as older runs have it
    ({"commit": "1" * 40, "dirty": None, "unknown": "an archive"}, "an archive"),
    ({}, "unknown commit"),
]


@pytest.mark.parametrize("git_state, message", UNCLEAN)
def test_what_is_not_clean_is_not_passed_on(monkeypatch, tmp_path, git_state, message):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "plan.json").write_text("{}")
    context = tmp_path / "run" / "context.json"
    context.write_text(json.dumps({"git": git_state}))
    with pytest.raises(StudyError, match=message):
        provenance.need_clean(tmp_path / "run", allowed=False)
    provenance.need_clean(tmp_path / "run", allowed=True)
    context.write_text(json.dumps({"git": {"commit": "1" * 40, "dirty": False}}))
    provenance.need_clean(tmp_path / "run", allowed=False)


def test_commit_sees_every_change(tmp_path, monkeypatch):
    git(tmp_path, "init")
    (tmp_path / "a").write_text("1")
    assert state(monkeypatch, tmp_path).dirty and not checkout.state().commit
    git(tmp_path, "add", "a")
    git(tmp_path, "commit", "-m", "one")
    clean = checkout.state()
    assert (len(clean.commit or ""), clean.dirty, clean.diff_sha256) == (40, False, None)
    seen = set()
    for name, text in [("a", "2"), ("a", "3"), ("new", "4"), ("new", "5")]:
        (tmp_path / name).write_text(text)
        changed = checkout.state()
        assert changed.dirty
        seen.add(changed.diff_sha256)
    assert len(seen) == 4
