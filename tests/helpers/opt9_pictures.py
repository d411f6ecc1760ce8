"""Pictures of opt9_convex and of those that it is held against, at 107 × 61."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from study.core import registry
from study.core.build import build
from study.pictures import images

PHASE = "opt9_convex"

needs_opt9 = pytest.mark.skipif(
    bool(registry.missing_isa(registry.phases()[PHASE])), reason=f"the CPU lacks what {PHASE} needs"
)


def picture(
    whole: str | dict, folder: Path, *options: str, lanes: str | None = None, phase: str = PHASE
) -> dict[str, np.ndarray]:
    path = folder / "scene.json"
    path.write_text(
        registry.scenes()[whole].path.read_text() if isinstance(whole, str) else json.dumps(whole)
    )
    out = folder / "picture.exr"
    environment = os.environ | ({"STEPWISE_ISA_LIMIT": lanes} if lanes else {})
    command = [build(phase), path, "-n", "61", "-w", "107", "--aov", "-o", out, *options]
    subprocess.run(list(map(str, command)), check=True, env=environment, capture_output=True, timeout=60)
    return images.read(out)


def looks(position: list[float], at: list[float]) -> dict:
    return {"position": position, "look_at": at, "vertical_fov_degrees": 60}
