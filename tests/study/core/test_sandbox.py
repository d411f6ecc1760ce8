"""The sandbox: what a child may not do in it, and what holds where bubblewrap does not work."""

from __future__ import annotations

import signal
import sys
import uuid
from collections.abc import Iterator
from pathlib import Path

import needs
import processes
import pytest

from study.core.cli import StudyError
from study.core.host import child, sandbox

CONNECT = "import socket; socket.create_connection(('127.0.0.1', 9), 5)"


def said(*command: object) -> tuple[int, str]:
    done = child.run(list(map(str, command)), capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


@pytest.fixture
def inside(tmp_path: Path) -> Iterator[Path]:
    """The folder that may be written, entered; left out where bubblewrap does not work."""
    writable = tmp_path / "build"
    writable.mkdir()
    needs.sandbox(writable)
    with sandbox.entered(writable) as lacking:
        assert not lacking
        yield writable


def test_only_the_folder_is_written(inside: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert said("sh", "-c", f"echo here >{inside}/file") == (0, "")
    assert (inside / "file").read_text() == "here\n"
    for place in (tmp_path / "file", Path("/tmp/stepwise-file"), Path.home() / "file", Path("/etc/file")):
        status, why = said("sh", "-c", f"echo there >{place}")
        assert status and "Read-only file system" in why and not place.exists()


def test_no_network(inside: Path) -> None:
    """Not even the machine's own: no interface but a loopback device that nobody else is on, no daemon."""
    assert said("ls", "-A", "/run") == (0, "")
    status, names = said("sh", "-c", "tail -n +3 /proc/net/dev | cut -d: -f1")
    assert (status, names.split()) == (0, ["lo"])
    status, why = said(sys.executable, "-c", CONNECT.replace("127.0.0.1", "192.0.2.1"))
    assert status and "Network is unreachable" in why


def test_no_rights_even_for_root(inside: Path) -> None:
    status, _ = said("mount", "-o", "remount,rw", "/")
    assert status
    _, caps = said("sh", "-c", "grep CapEff /proc/self/status")
    assert int(caps.split()[1], 16) == 0


def test_how_a_child_ends(inside: Path) -> None:
    assert said("sh", "-c", "exit 3")[0] == 3
    assert said("sh", "-c", "kill -SEGV $$")[0] == -signal.SIGSEGV


def test_what_hangs_goes_with_what_it_started(inside: Path) -> None:
    mark = f"0.{uuid.uuid4().int}"
    with pytest.raises(StudyError, match=r"sh: .* 1 s"):
        child.run(["sh", "-c", f"sleep 77{mark} & sleep 78{mark}"], capture_output=True, timeout=1)
    left = [pid.name for pid in Path("/proc").glob("[0-9]*") if mark in arguments(pid)]
    assert all(processes.ends(pid) for pid in left)


def arguments(pid: Path) -> str:
    try:
        return (pid / "cmdline").read_bytes().decode(errors="replace")
    except OSError:
        return ""


@pytest.mark.parametrize("how", ["missing", "refused"])
def test_limits_hold_without_it(how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Made up: no bwrap, or one that the kernel refuses."""
    monkeypatch.setattr(sandbox, "TOOL", "bwrap-that-is-not-there")
    if how == "refused":
        tool = tmp_path / "refused"
        tool.write_text("#!/bin/sh\necho namespaces >&2\nexit 1\n")
        tool.chmod(0o755)
        monkeypatch.setattr(sandbox, "TOOL", str(tool))
    with sandbox.entered(tmp_path) as lacking:
        assert ("namespaces" if how == "refused" else "bubblewrap") in lacking
        limits = {"v": sandbox.MEMORY // 1024, "f": sandbox.FILE // 1024, "t": sandbox.CPU, "c": 0}
        assert said("bash", "-c", "ulimit -v -t -c; ulimit -f")[0] == 0
        for letter, limit in limits.items():
            assert said("bash", "-c", f"ulimit -{letter}") == (0, f"{limit}\n")
        with sandbox.unlimited_memory():
            assert said("bash", "-c", "ulimit -v") == (0, "unlimited\n")
        wasted = f"x = bytearray({2 * sandbox.MEMORY})"
        assert "MemoryError" in said(sys.executable, "-c", wasted)[1]
    assert not sandbox.active() and sandbox.around(["true"]) == ["true"]
