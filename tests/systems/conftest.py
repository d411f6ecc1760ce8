"""Pictures of the systems, under the settings that each takes from its environment."""

from __future__ import annotations

import functools
import json
import os
import subprocess

import pytest
from processes import only_warned

from conformance import harness
from study.core import registry, store
from study.core.build import build
from study.core.registry import ROOT
from study.pictures import images

SETTINGS = ("STEPWISE_FIXED", "STEPWISE_PACKETS", "STEPWISE_RODS")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A scene as a file, once."""
    folder = tmp_path_factory.mktemp("scenes")

    def write(name, data):
        path = folder / f"{name}.json"
        if not path.exists():
            store.write_json(path, data)
        return path

    return write


@pytest.fixture(scope="session")
def called():
    """A driver under settings `words` and a CPU's limit: the process when it has ended."""

    def call(program, path, size, words="", *more, limit=""):
        env = os.environ | dict.fromkeys(SETTINGS, words) | {"STEPWISE_UNTIMED": "1"}
        env |= {"STEPWISE_ISA_LIMIT": limit} if limit else {}
        command = [program, path, "-w", size[0], "-n", size[1], *more]
        return subprocess.run([str(w) for w in command], capture_output=True, text=True, env=env)

    return call


@pytest.fixture(scope="module")
def draw(tmp_path_factory, written, called, request):
    """Every plane of a picture of a shipped scene, or one of the module's SCENES; and the driver's record."""
    out = tmp_path_factory.mktemp("pictures") / "picture.exr"

    @functools.cache
    def one(phase, name, words="", size=request.module.SIZE, limit="", target="render", program=None):
        path = ROOT / "common" / "scenes" / f"{name}.json"
        path = path if path.exists() else written(name, request.module.SCENES[name])
        program = program or build(phase, target)
        if phase in harness.BESIDE:
            command = [program, path, "-n", size[1], "-w", size[0], "-o", out, "--json", "--aov"]
            env = os.environ | {"STEPWISE_UNTIMED": "1"}
            done = harness.drawn_once([str(word) for word in command], out, env=env)
        else:
            done = called(program, path, size, words, "--aov", "--json", "-o", out, limit=limit)
        assert done.returncode == 0 and only_warned(done.stderr), done.stderr
        return images.read(out), json.loads(done.stdout)

    return one


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skips the test of a phase where the CPU lacks what it needs."""
    phase = getattr(item, "callspec", None) and item.callspec.params.get("phase")
    if phase and (lacking := registry.missing_isa(registry.find_phase(phase))):
        pytest.skip(f"the CPU lacks {' '.join(lacking)}")
