"""What is known of the sources' version, in every kind of checkout."""

from __future__ import annotations

import json
import subprocess
import tarfile
from pathlib import Path

import pytest

from study.commands import publish
from study.core import provenance
from study.core.cli import StudyError
from study.core.host import checkout
from study.core.registry import ROOT


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


def state(monkeypatch: pytest.MonkeyPatch, root: Path) -> dict:
    monkeypatch.setattr(checkout, "ROOT", root)
    return checkout.state()


def test_kinds_of_checkout(monkeypatch, tmp_path, repository):
    clean = state(monkeypatch, repository)
    assert (clean["dirty"], clean["unknown"], clean["kind"]) == (False, None, "clone")
    git(repository, "worktree", "add", "-q", str(tmp_path / "tree"))
    assert state(monkeypatch, tmp_path / "tree") == clean | {"kind": "worktree"}
    git(tmp_path, "clone", "-q", "--depth=1", f"file://{repository}", "shallow")
    assert state(monkeypatch, tmp_path / "shallow") == clean | {"kind": "shallow clone"}
    (tmp_path / "outer").mkdir()
    git(tmp_path / "outer", "init", "-q")
    git(tmp_path / "outer", "submodule", "add", "-q", str(repository), "inner")
    assert state(monkeypatch, tmp_path / "outer" / "inner") == clean | {"kind": "submodule"}
    (tmp_path / "outer" / "inner" / "a").write_text("3")
    assert state(monkeypatch, tmp_path / "outer" / "inner")["dirty"] is True
    (tmp_path / "link").symlink_to(repository)
    assert state(monkeypatch, tmp_path / "link") == clean


def test_another_users_checkout_is_unknown(monkeypatch, repository):
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", "1")  # git's own, for tests
    found = state(monkeypatch, repository)
    assert (found["commit"], found["dirty"]) == (None, None)
    assert found["unknown"].startswith("the checkout belongs to another user: git config --global --add safe")
    assert not checkout.is_clean(found) and checkout.said(found) == "unknown commit"


def test_a_copy_inside_another_repository_has_not_its_commit(monkeypatch, repository):
    copy = repository / "third_party" / "stepwise"
    copy.mkdir(parents=True)
    found = state(monkeypatch, copy)
    assert (found["commit"], found["dirty"]) == (None, None)
    assert found["unknown"].startswith("a copy without .git, inside another repository (")


def test_a_tarball_knows_its_commit_and_not_whether_it_was_changed(monkeypatch, tmp_path, repository):
    known = state(monkeypatch, repository)["commit"]
    git(repository, "archive", "-o", str(tmp_path / "a.tar"), "HEAD")
    with tarfile.open(tmp_path / "a.tar") as archive:
        archive.extractall(tmp_path / "archive", filter="data")
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path))
    found = state(monkeypatch, tmp_path / "archive")
    assert (found["commit"], found["dirty"], found["kind"]) == (known, None, "archive")
    assert found["unknown"] == "no git repository: a copy or an archive"
    assert checkout.said(found) == f"{known[:10]}, changed or not is unknown"
    (tmp_path / "archive" / checkout.ARCHIVED).unlink()
    assert state(monkeypatch, tmp_path / "archive")["commit"] is None


def test_without_git_or_with_a_lost_repository(monkeypatch, tmp_path, repository):
    git(repository, "worktree", "add", "-q", str(tmp_path / "tree"))
    repository.rename(tmp_path / "moved")
    assert "not a git repository" in state(monkeypatch, tmp_path / "tree")["unknown"]
    monkeypatch.setenv("GIT_DIR", str(tmp_path / "moved" / ".git"))  # as in a hook
    assert state(monkeypatch, tmp_path / "tree")["commit"] is None
    monkeypatch.setenv("PATH", str(tmp_path))
    found = state(monkeypatch, tmp_path / "moved")
    assert (found["commit"], found["dirty"], found["unknown"]) == (None, None, "git is not installed")


UNCLEAN = [
    ({"commit": "1" * 40, "dirty": True}, "measured of 1111111111 with uncommitted changes; --unclean"),
    ({"commit": None, "dirty": False}, "measured of unknown commit; --unclean"),  # as older runs have it
    ({"commit": "1" * 40, "dirty": None, "unknown": "an archive"}, "is unknown .an archive.; --unclean"),
    ({}, "unknown commit"),
]


@pytest.mark.parametrize("git_state, message", UNCLEAN)
def test_what_is_not_clean_is_not_passed_on(monkeypatch, tmp_path, git_state, message):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "plan.json").write_text("{}")
    context = tmp_path / "run" / "context.json"
    context.write_text(json.dumps({"git": git_state}))
    for command, more in ((publish, [str(tmp_path / "out")]),):
        monkeypatch.setattr("sys.argv", ["stepwise", str(tmp_path / "run"), *more])
        with pytest.raises(StudyError, match=message):
            command.main()
    provenance.need_clean(tmp_path / "run", allowed=True)
    context.write_text(json.dumps({"git": {"commit": "1" * 40, "dirty": False}}))
    provenance.need_clean(tmp_path / "run", allowed=False)


def test_commit_sees_every_change(tmp_path, monkeypatch):
    monkeypatch.setattr(checkout, "ROOT", tmp_path)
    assert checkout.state()["commit"] is None or not (tmp_path / ".git").exists()

    git(tmp_path, "init")
    (tmp_path / "a").write_text("1")
    before_first = checkout.state()
    assert before_first["commit"] is None
    assert before_first["dirty"]
    git(tmp_path, "add", "a")
    git(tmp_path, "commit", "-m", "one")
    clean = checkout.state()
    assert len(clean["commit"]) == 40
    assert (clean["dirty"], clean["diff_sha256"]) == (False, None)

    seen = set()
    for name, text in [("a", "2"), ("a", "3"), ("new", "4"), ("new", "5")]:
        (tmp_path / name).write_text(text)
        state = checkout.state()
        assert state["dirty"]
        seen.add(state["diff_sha256"])
    assert len(seen) == 4
