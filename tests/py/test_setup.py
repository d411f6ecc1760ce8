"""scripts/setup.sh with a stand-in apt-get: what it asks for, and what it remembers. Nothing is installed."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TOOLS = (
    *("sh", "dirname", "mkdir", "flock", "grep", "cut", "cat", "rm", "id", "tail", "sha256sum", "env", "gcc"),
    *("make", "pkg-config"),
)
PYTHON = os.path.realpath(sys.executable)  # which("python3") may be a script that asks what it stands for
UNREACHABLE = "echo 'W: Failed to fetch http://deb.example/InRelease'"  # with status 0, as apt-get does
CUT_OFF = "echo 'E: Failed to fetch http://deb.example/perf.deb'; exit 100"


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A tree where all is there but perf and llvm-mca, and a PATH and headers of its own: bin/, include/."""
    (tmp_path / "scripts").mkdir()
    shutil.copy(ROOT / "scripts" / "setup.sh", tmp_path / "scripts")
    (tmp_path / "bin").mkdir()
    for tool in TOOLS:
        found = shutil.which(tool)
        assert found, tool
        (tmp_path / "bin" / tool).symlink_to(found)
    (tmp_path / "bin" / "python3").symlink_to(PYTHON)
    (tmp_path / "include" / "embree3").mkdir(parents=True)
    (tmp_path / "include" / "embree3" / "rtcore.h").touch()
    (tmp_path / "requirements.lock").write_text("")
    (tmp_path / ".venv" / "bin").mkdir(parents=True)
    (tmp_path / ".venv" / "bin" / "python").symlink_to(PYTHON)
    (tmp_path / ".venv" / ".installed-from").write_text(hashlib.sha256(b"").hexdigest())
    for name in ("sudo", "apt-cache"):
        command(tmp_path, name, 'shift; exec "$@"' if name == "sudo" else "exit 0")
    return tmp_path


def command(tree: Path, name: str, body: str) -> None:
    (tree / "bin" / name).write_text(f"#!/bin/sh\n{body}\n")
    (tree / "bin" / name).chmod(0o755)


def setup(tree: Path, update: str = "", install: str = "exit 100") -> tuple[str, list[str], bool]:
    """What it says, what it asked apt-get for, and whether it will not ask for perf again."""
    log = tree / "asked"
    log.write_text("")
    case = f'case "$1" in update) {update or ":"} ;; install) {install} ;; esac'
    command(tree, "apt-get", f'echo "$*" >>{log}\n{case}')
    done = subprocess.run(
        [tree / "bin" / "sh", tree / "scripts" / "setup.sh", "study"],
        env={"PATH": str(tree / "bin"), "STEPWISE_INCLUDE": str(tree / "include")},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    kept = tree / "build" / "setup.without"
    return done.stdout, log.read_text().splitlines(), kept.exists() and "perf\n" in kept.read_text()


def test_what_apt_does_not_have_is_asked_for_once(tree: Path) -> None:
    said, asked, remembered = setup(tree)
    assert remembered and "perf is not here and could not be installed" in said
    assert [line.split()[0] for line in asked] == ["update", "install", "install", "install"]
    assert setup(tree) == ("", [], True)


@pytest.mark.parametrize("version", [3, 4])
def test_a_library_is_known_by_its_header(tree: Path, version: int) -> None:
    for name in ("perf", "llvm-mca"):
        command(tree, name, ":")
    header = tree / "include" / "embree3" / "rtcore.h"
    header.unlink()
    said, asked, _ = setup(tree)
    assert "rtcore.h is not here" in said and "beside Embree" in said
    assert [line.split()[-1] for line in asked] == ["update", "libembree-dev"] or "-q" in asked[0]
    assert asked[-1].endswith("libembree-dev") and setup(tree) == ("", [], False)
    (tree / "build" / "setup.without").unlink()
    header = tree / "include" / f"embree{version}" / "rtcore.h"
    said, _, _ = setup(tree, install=f"/bin/mkdir -p {header.parent}; /bin/touch {header}")
    assert "could not" not in said and setup(tree) == ("", [], False)


@pytest.mark.parametrize("trouble", [{"update": UNREACHABLE}, {"update": "exit 100"}, {"install": CUT_OFF}])
def test_what_the_network_kept_back_is_tried_again(tree: Path, trouble: dict[str, str]) -> None:
    said, asked, remembered = setup(tree, **trouble)
    assert not remembered and "could not be installed" in said
    assert sum(line.startswith("update") for line in asked) == 1
    make = "/bin/touch {0}; /bin/chmod 755 {0}"
    said, asked, _ = setup(
        tree, install="; ".join(make.format(tree / "bin" / name) for name in ("perf", "llvm-mca"))
    )
    assert "could not" not in said and len(asked) == 2  # the lists, and one package: it brought both here
