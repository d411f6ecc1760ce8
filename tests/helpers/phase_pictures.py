"""Pictures of phases, whatever the scene is given by, and whether two are the same to the bit."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from processes import only_warned

from conformance import harness
from conformance.feature_scenes import FEATURES
from study.core import registry
from study.core.build import build
from study.pictures import images


def needs(phase: str) -> pytest.MarkDecorator:
    """Leaves tests out where the CPU lacks what the phase needs."""
    lacking = bool(registry.missing_isa(registry.phases()[phase]))
    return pytest.mark.skipif(lacking, reason=f"the CPU lacks what {phase} needs")


def path_of(scene: str | Path | dict, folder: Path) -> Path:
    """A shipped scene or one of conformance's features by its name, a file, or what is written into one."""
    if isinstance(scene, Path):
        return scene
    if isinstance(scene, str) and scene in registry.scenes():
        return registry.scenes()[scene].path
    path = folder / (f"{scene}.json" if isinstance(scene, str) else "scene.json")
    path.write_text(json.dumps(FEATURES[scene] if isinstance(scene, str) else scene))
    return path


def render(
    phase: str | Path, scene: str | Path | dict, folder: Path, *options: object, size=(107, 61), **env: str
) -> subprocess.CompletedProcess[str]:
    """The driver's run; its picture is folder/picture.exr."""
    program, out = build(phase) if isinstance(phase, str) else phase, folder / "picture.exr"
    shape = ("-n", size[1], "-w", size[0])
    words = [program, path_of(scene, folder), *shape, "-o", out, "--json", "--aov", *options]
    how = {"env": os.environ | env, "timeout": 300}
    if phase in harness.BESIDE:
        return harness.drawn_once(list(map(str, words)), out, **how)
    return subprocess.run(list(map(str, words)), capture_output=True, text=True, **how)


def picture(
    phase: str | Path, scene: str | Path | dict, folder: Path, *options: object, size=(107, 61), **env: str
) -> images.Picture:
    done = render(phase, scene, folder, *options, size=size, **env)
    assert done.returncode == 0 and only_warned(done.stderr), done.stderr
    return images.read(folder / "picture.exr")


def check_bits(mine: dict, other: dict, where: object = "") -> None:
    """Every plane is the same to the bit."""
    assert mine.keys() == other.keys()
    for name in other:
        assert np.array_equal(mine[name].view(np.uint32), other[name].view(np.uint32)), f"{where}: {name}"
