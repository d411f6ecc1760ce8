"""Places that a checkout is put in: no network, a full disk, a read-only one, another user's, any path."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from study.bounds import analysers
from study.core.registry import ROOT

ODD = 'a "b" it\'s käfig × %s $x'
SETUP = "scripts/setup.sh study"
PARTS = [
    "common",
    "phases",
    "systems",
    "truth",
    "scripts",
    "Makefile",
    "requirements.lock",
    "requirements.in",
]


def allowed(*command: str) -> Sequence[str]:
    """The command, or the test is skipped where this machine forbids it."""
    program = shutil.which(command[0])
    if not program or subprocess.run([*command, "true"], capture_output=True).returncode:
        pytest.skip(f"this machine lacks {' '.join(command)}")
    return command


def checkout(folder: Path) -> Path:
    """A copy of what builds, without .git, .venv and build."""
    folder.mkdir(parents=True)
    for name in PARTS:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, folder)
    return folder


def run(folder: Path, script: str, prefix: Sequence[str] = (), **environment: str) -> tuple[int, str, str]:
    """Status and outputs of a shell's line in that folder."""
    kept = {key: value for key, value in os.environ.items() if "proxy" not in key.lower()}
    done = subprocess.run(
        [*prefix, "sh", "-c", script],
        cwd=folder,
        env=kept | environment,
        capture_output=True,
        text=True,
        timeout=500,
    )
    return done.returncode, done.stdout, done.stderr


def setup_fails(told: tuple[int, str, str], why: str) -> None:
    """With one line on standard error."""
    status, said, error = told
    assert status == 1 and error.count("\n") == 1 and error.startswith("setup: "), (said, error)
    assert why in error, error


@pytest.mark.slow
@pytest.mark.parametrize("how", ["no network", "no proxy", "a proxy that is none"])
def test_without_a_way_to_the_packages(tmp_path: Path, how: str) -> None:
    folder = checkout(tmp_path / "here")
    proxy = {"no proxy": "http://127.0.0.1:9", "a proxy that is none": "what is this"}.get(how)
    prefix = allowed("unshare", "--net", "--map-root-user") if proxy is None else ()
    more = {"https_proxy": proxy, "http_proxy": proxy} if proxy else {}
    told = run(folder, SETUP, prefix, HOME=str(tmp_path), PIP_FIND_LINKS="", **more)
    setup_fails(told, "no network, or a proxy that is none: no answer from http")


@pytest.mark.slow
def test_on_a_full_disk(tmp_path: Path) -> None:
    """30 MB, of which the checkout takes a half: not even pip fits."""
    prefix = allowed("unshare", "--mount", "--map-root-user")
    folder = checkout(tmp_path / "here")
    (tmp_path / "disk").mkdir()
    mounted = f"mount -t tmpfs -o size=30m none {tmp_path}/disk && cp -r {folder} {tmp_path}/disk/here"
    told = run(tmp_path, f"{mounted} && cd {tmp_path}/disk/here && {SETUP}", prefix)
    setup_fails(told, "the disk of . is too small: what is installed takes 700 MB, and")


@pytest.mark.slow
def test_on_a_read_only_disk(tmp_path: Path) -> None:
    prefix = allowed("unshare", "--mount", "--map-root-user")
    folder = checkout(tmp_path / "here")
    mounted = f"mount --bind {folder} {folder} && mount -o remount,ro,bind {folder} && cd {folder}"
    setup_fails(run(tmp_path, f"{mounted} && {SETUP}", prefix), "cannot be written (read-only, full, or")
    status, _, error = run(tmp_path, f"{mounted} && make -s phase-opt1", prefix)
    assert status == 2 and "Traceback" not in error
    assert error.splitlines()[0] == "phase_info: build: Read-only file system"


@pytest.mark.slow
def test_in_another_users_folder() -> None:
    if os.geteuid():
        pytest.skip("only root can become another user")
    prefix = allowed("setpriv", "--reuid=65534", "--regid=65534", "--clear-groups")
    with_all = subprocess.run(["mktemp", "-d", "/var/tmp/stepwise-XXXXXX"], capture_output=True, text=True)
    folder = Path(with_all.stdout.strip())
    try:
        folder.chmod(0o755)
        made = checkout(folder / "here")
        setup_fails(run(made, SETUP, prefix), "another user's")
    finally:
        shutil.rmtree(folder)


@pytest.mark.slow
def test_in_any_path_with_no_home_and_nothing_for_others(tmp_path: Path) -> None:
    """A phase is built and draws where the path has quotes, blanks and other letters, under umask 077."""
    folder = checkout(tmp_path / ODD)
    made = "umask 077; unset HOME; make -s phase-opt1 && "
    made += "build/opt1/render common/scenes/scene0.json -n 4 -o 'a b.exr'"
    for environment in ({}, {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}):
        shutil.rmtree(folder / "build", ignore_errors=True)
        status, _, error = run(folder, made, **environment)
        assert (status, error) == (0, "") and (folder / "a b.exr").stat().st_size > 500
        assert (folder / "build").stat().st_mode & 0o77 == 0


def test_osaca_is_no_script() -> None:
    """pip's scripts name their Python in a line that a quote in the path ends."""
    command = analysers.osaca_program()
    assert command is not None and command[1:] == ["-m", "osaca"]
    done = subprocess.run([*command, "--version"], capture_output=True, text=True)
    assert done.returncode == 0


def test_no_two_names_differ_in_case_alone() -> None:
    """A disk that takes Scene.json and scene.json for one file has one of them only."""
    done = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        pytest.skip("this checkout is no git repository, so its files are not known")
    names = done.stdout.splitlines()
    parts = {"/".join(name.split("/")[:n]) for name in names for n in range(1, name.count("/") + 2)}
    folded: dict[str, list[str]] = {}
    for part in parts:
        folded.setdefault(part.casefold(), []).append(part)
    assert len(names) > 500 and [same for same in folded.values() if len(same) > 1] == []
