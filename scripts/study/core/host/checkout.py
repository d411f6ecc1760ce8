"""What is known of the sources' version: the commit, what differs from it, and why one is not known."""

import hashlib
import os
import re
import subprocess
from pathlib import Path

from study.core.host import read_text
from study.core.registry import ROOT
from study.core.run_schema import Git

ARCHIVED = ".git_archival.txt"  # git archive puts the commit into it (.gitattributes)
_OF_A_HOOK = ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE")  # they would name another repository


def _bytes(*arguments: str) -> tuple[bytes | None, str]:
    """Standard output, or None and git's words."""
    environment = {k: v for k, v in os.environ.items() if k not in _OF_A_HOOK} | {"LC_ALL": "C"}
    command = ("git", "-C", str(ROOT), *arguments)
    try:
        done = subprocess.run(command, capture_output=True, timeout=60, env=environment)
    except FileNotFoundError:
        return None, "git is not installed"
    except (OSError, subprocess.TimeoutExpired):
        return None, "git does not answer"
    said = done.stderr.decode(errors="replace").strip().splitlines() or ["git fails"]
    return (done.stdout if done.returncode == 0 else None), said[0]


def _git(*arguments: str) -> tuple[str | None, str]:
    """The same as text."""
    found, said = _bytes(*arguments)
    return None if found is None else found.decode(errors="replace").strip(), said


def _unknown() -> str | None:
    """Why git cannot speak of this tree; None if it can."""
    top, said = _git("rev-parse", "--show-toplevel")
    if top is None and "dubious ownership" in said:
        return f"the checkout belongs to another user: git config --global --add safe.directory {ROOT}"
    if top is None:
        return "no git repository: a copy or an archive" if not (ROOT / ".git").exists() else said
    if Path(top).resolve() != ROOT.resolve():
        return f"a copy without .git, inside another repository ({top})"
    return None


def _archived() -> str | None:
    """The commit that `git archive` wrote into a tarball."""
    text = read_text(ROOT / ARCHIVED)
    return text if re.fullmatch("[0-9a-f]{40}", text) else None


def archive() -> tuple[bytes | None, str]:
    """The last commit as a tar file, or None and git's words."""
    return _bytes("archive", "--format=tar", "HEAD")


def state() -> Git:
    """Commit; whether the tree differs from it (None: not known), with a SHA-256 over what differs or is new;
    `unknown`: why something is not known."""
    if why := _unknown():
        return Git(commit=_archived(), unknown=why)
    status, _ = _git("status", "--porcelain")
    dirty = None if status is None else bool(status)
    return Git(
        commit=_git("rev-parse", "--verify", "-q", "HEAD")[0] or None,
        dirty=dirty,
        diff_sha256=_digest() if dirty else None,
        unknown="git status fails" if dirty is None else None,
    )


def _digest() -> str:
    digest = hashlib.sha256((_git("diff", "HEAD", "--binary")[0] or "").encode())
    new = (_git("ls-files", "--others", "--exclude-standard", "-z")[0] or "").split("\0")
    for name in sorted(filter(None, new)):
        file = ROOT / name  # a link to a folder is listed too, and has no bytes
        digest.update(
            name.encode() + b"\0" + hashlib.sha256(file.read_bytes() if file.is_file() else b"").digest()
        )
    return digest.hexdigest()


def said(git: Git) -> str:
    """Ten digits, and whether sources were changed; "unknown" is not "clean"."""
    if not git.commit:
        return "unknown commit"
    if git.dirty is None:
        return f"{git.commit[:10]}, changed or not is unknown"
    return git.commit[:10] + (" with uncommitted changes" if git.dirty else "")


def is_clean(git: Git) -> bool:
    """A known commit, known to be all there was."""
    return bool(git.commit) and git.dirty is False
