"""Builds: what is built, and what is said when it cannot be."""

import fcntl
import os
import re
import shutil
import subprocess
import sys
import threading

import pytest

from study import build as module
from study.cli import CANNOT_RUN, StudyError
from study.registry import ROOT, Spec

TOOLS = (
    "make",
    "head",
    "sh",
    "python3",
    "sed",
    "mkdir",
    "rm",
    "basename",
    "ld",
    "pkg-config",
    "dirname",
    "mv",
    "cmp",
)


@pytest.fixture
def root(tmp_path, monkeypatch):
    """A small tree of its own, and no binary remembered."""
    shutil.copytree(ROOT / "common", tmp_path / "common")
    shutil.copytree(ROOT / "phases" / "baseline", tmp_path / "phases" / "baseline")
    shutil.copy(ROOT / "Makefile", tmp_path)
    monkeypatch.setattr(module, "ROOT", tmp_path)
    module._build.cache_clear()
    yield tmp_path
    module._build.cache_clear()


def test_render_and_probe_are_built():
    for target in ("render", "probe"):
        path = module.build(Spec("baseline", "baseline"), target)
        assert path == ROOT / "build" / "baseline" / target
        assert os.access(path, os.X_OK)


def test_a_phase_that_does_not_compile_shows_the_compilers_lines(root):
    with open(root / "phases/baseline/march.c", "a") as source:
        source.write("int broken(void) { return undeclared_thing; }\n")
    with pytest.raises(StudyError, match="cannot build baseline:") as error:
        module.build("baseline")
    assert "undeclared_thing" in str(error.value)
    assert error.value.exit_status == 2


def test_a_missing_compiler_is_named(root, monkeypatch):
    tools = root / "tools"
    tools.mkdir()
    for name in TOOLS:
        if found := shutil.which(name):
            (tools / name).symlink_to(found)
    (tools / "python3").unlink(missing_ok=True)
    (tools / "python3").symlink_to(os.path.realpath(sys.executable))
    monkeypatch.setenv("PATH", str(tools))
    with pytest.raises(StudyError, match="cannot build baseline: gcc is missing; run `make setup`") as error:
        module.build("baseline")
    assert error.value.exit_status == CANNOT_RUN


def test_a_missing_make_is_named(root, monkeypatch):
    monkeypatch.setenv("PATH", str(root))
    with pytest.raises(StudyError, match="make is missing") as error:
        module.build("baseline")
    assert error.value.exit_status == CANNOT_RUN


def test_two_scripts_make_nothing_in_one_folder_at_once(root):
    made = module.build("baseline")
    made.unlink()  # to be linked again: a moment
    module._build.cache_clear()
    with open(made.parent / ".making", "w") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        waiting = threading.Thread(target=module.build, args=("baseline",))
        waiting.start()
        waiting.join(2)
        assert waiting.is_alive() and not made.exists()
    waiting.join()
    assert made.exists()


def test_presenting_leaves_no_upper_half_in_use():
    """As the renderers' own objects do it: sanitizers clear what an optimised build may leave."""
    program = "build/tests/test_upper_halves"
    subprocess.run(["make", "-s", program], cwd=ROOT, check=True)
    done = subprocess.run([ROOT / program], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    if skipped := re.search("^skipped: (.*)", done.stdout, re.MULTILINE):
        pytest.skip(skipped[1])
