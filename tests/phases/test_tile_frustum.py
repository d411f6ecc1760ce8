"""Whether a tile's rays can fall towards a plane (tile_frustum.h): never a wrong no."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np

from study.core import registry

WIDE = np.tan(np.radians(85))  # half the widest field of view


def test_plane_in_frustum(tmp_path: Path) -> None:
    """Rays that just fall towards one are in, up to the widest picture's corner; what is well off is not."""
    (tmp_path / "frustum.c").write_text(
        f'#include "{registry.find_phase("opt9_convex").file("hit/tile_frustum.h")}"\n'
        "int asked(const float *corner, const float *normal) {\n"
        "    struct tile_frustum w = {corner[0], corner[0], corner[1], corner[1]};\n"
        "    return plane_in_frustum(&w, normal);\n}\n"
    )
    library = tmp_path / "frustum.so"
    words = ["gcc", "-std=c11", "-O2", "-ffp-contract=off", "-shared", "-fPIC"]
    subprocess.run([*words, tmp_path / "frustum.c", "-o", library], check=True)
    asked = ctypes.CDLL(str(library)).asked

    def is_in(corner: np.ndarray, normal: np.ndarray) -> bool:
        floats = [np.ascontiguousarray(v, dtype=np.float32) for v in (corner, normal)]
        return bool(asked(*(ctypes.c_void_p(v.ctypes.data) for v in floats)))

    random = np.random.default_rng(3)
    for _ in range(20_000):
        corner = (random.uniform(-1, 1, 2) * [WIDE * 16 / 9, WIDE]).astype(np.float32)
        ray = np.append(corner.astype(float), 1)
        normal = np.cross(ray, random.normal(size=3))
        normal /= np.linalg.norm(normal)  # at right angles to it
        assert is_in(corner, normal - 1e-12 * ray), (corner, normal)
        assert not is_in(corner, normal + 1e-4 * ray / np.linalg.norm(ray)), (corner, normal)
