"""A checkout in any path, with other people's settings."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import copied
import pytest

from study.core.registry import ROOT

ODD = 'a "b" it\'s käfig × %s $x'


@pytest.mark.slow
def test_in_any_path_with_no_home_and_nothing_for_others(tmp_path: Path) -> None:
    """A phase is built and draws where the path has quotes, blanks and other letters, under umask 077."""
    folder = copied.folders(tmp_path / ODD, "common", "phases", "systems", "truth", "scripts")
    shutil.copy(ROOT / "Makefile", folder)
    made = "umask 077; unset HOME; make -s phase-opt1 && "
    made += "build/opt1/render common/scenes/scene0.json -n 4 -o 'a b.exr'"
    for more in ({}, {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}):
        shutil.rmtree(folder / "build", ignore_errors=True)
        done = subprocess.run(["sh", "-c", made], cwd=folder, env=os.environ | more, capture_output=True)
        assert (done.returncode, done.stderr) == (0, b"") and (folder / "a b.exr").stat().st_size > 500
        assert (folder / "build").stat().st_mode & 0o77 == 0


def test_a_clone_for_windows_has_no_carriage_return(tmp_path: Path) -> None:
    """Text has none; a picture and what is packed are the same bytes."""
    names = [".gitattributes", "scripts/setup.sh", "scripts/stepwise", "common/scenes/scene0.json"]
    names += ["requirements.lock", "results/reference/pareto.png"]
    names += [str(next(ROOT.glob("results/reference/*/*.gz")).relative_to(ROOT))]
    for name in names:
        (tmp_path / "first" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / "first" / name)
    who = ["-c", "user.name=x", "-c", "user.email=x@y"]
    for words in (["init", "-q"], ["add", "."], [*who, "commit", "-q", "-m", "x"]):
        subprocess.run(["git", *words], cwd=tmp_path / "first", check=True)
    clone = ["git", "clone", "-q", "-c", "core.autocrlf=true", "first", "second"]
    subprocess.run(clone, cwd=tmp_path, check=True)
    for name in names:
        assert (tmp_path / "second" / name).read_bytes() == (ROOT / name).read_bytes(), name


def test_no_recipe_is_led_elsewhere(tmp_path: Path) -> None:
    """By CDPATH, as fuzz.mk's cd would be, and no Python of one by PYTHONPATH."""
    (tmp_path / "common" / "scenes").mkdir(parents=True)
    (tmp_path / "json.py").write_text("raise SystemError('the wrong json')\n")
    recipe = "where:\n\t@cd common/scenes && pwd\n\t@$(PYTHON3) -c 'import json'\n"
    words = ["make", "-s", "-C", ROOT, "--eval", recipe, "where"]
    environment = os.environ | {"CDPATH": str(tmp_path), "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(words, env=environment, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == (f"{ROOT}/common/scenes\n", "")


def test_a_container_takes_along_nothing_that_git_ignores() -> None:
    """Neither the host's .venv nor its build: both would be of another system."""

    def patterns(name: str) -> list[str]:
        lines = (ROOT / name).read_text(encoding="utf-8").splitlines()
        return [line.strip("/").replace("!/", "!") for line in lines if line and not line.startswith("#")]

    ignored = [
        f"**/{one}" if one.startswith(("__", ".")) and one != ".venv" else one
        for one in patterns(".gitignore")
    ]
    assert patterns(".containerignore") == ignored
    assert os.readlink(ROOT / ".dockerignore") == ".containerignore"


@pytest.mark.parametrize(("said", "compiler"), [("", "gcc"), (" ", "gcc"), ("ccache gcc", "ccache gcc")])
def test_the_compiler_is_what_the_shell_exports(said: str, compiler: str) -> None:
    words = ["make", "-s", "-C", ROOT, "--eval", "which:\n\t@echo '$(CC)'\n", "which"]
    done = subprocess.run(words, env=os.environ | {"CC": said}, capture_output=True, text=True)
    assert done.stdout == f"{compiler}\n"
