"""The polynomials of opt9_convex in place of the Mandelbulb's first iteration (opt10_scene has the same),
against the map by angles; and a camera within its bounding sphere.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from phase_pictures import needs, picture

from study.core import patches, registry
from study.pictures import images

PHASE = "opt9_convex"
TERMS = 6


def source() -> str:
    """The files of the polynomials as one text."""
    return "".join(
        path.read_text() for name, path in sorted(patches.files(PHASE).items()) if "chebyshev" in name
    )


def constant(text: str, name: str) -> float:
    number = re.search(rf"#define {name} (\S+)f", text)[1]
    return float.fromhex(number) if number.startswith("0x") else float(number)


def table(text: str, name: str) -> np.ndarray:
    body = re.search(rf"static const double {name}(?:\[\w+\])+ = (\{{.*?\}});", text, re.DOTALL)[1]
    return np.array([float(number) for number in re.findall(r"-?\d[\d.e-]*", body)])


def mapped(p: np.ndarray) -> np.ndarray:
    """White and Nylander's power 8, then + p: by angles. p: 3 × N."""
    x, y, z = p
    r, up, round_y = np.linalg.norm(p, axis=0), np.arctan2(y, np.hypot(x, z)), np.arctan2(x, z)
    across = r**8 * np.sin(8 * up)
    return p + np.array([across * np.sin(8 * round_y), r**8 * np.cos(8 * up), -across * np.cos(8 * round_y)])


def test_polynomials_are_the_first_iteration() -> None:
    """Off by less than 2^-24 on pieces of 20,000 rays within |p| < 1.15, half of them near the axis. The
    derivative, by a cubic: by less than 2^-19 of itself.
    """
    text = source()
    nodes, factors = table(text, "nodes"), [table(text, name).reshape(3, 3) for name in ("even", "odd")]
    random = np.random.default_rng(8)
    count = 20_000
    start = random.normal(size=(3, count))
    start *= random.uniform(0, 1.15, count) / np.linalg.norm(start, axis=0)
    start[::2, ::2] *= 10 ** random.uniform(-4.6, 0, count // 2)
    way = random.normal(size=(3, count))
    way /= np.linalg.norm(way, axis=0)
    start, way = (v[:, np.hypot(start[0], start[2]) > 1e-5] for v in (start, way))
    rho = np.hypot(start[0], start[2])
    assert rho.min() < 2e-5
    half = np.minimum(constant(text, "CLOSE_PIECE_SHARE") * rho, constant(text, "CLOSE_PIECE"))
    half = np.maximum(half, constant(text, "CLOSE_PIECE_MIN"))
    middle = start + way * half
    behind, before = (np.array([mapped(middle + sign * way * half * u) for u in nodes]) for sign in (1, -1))
    values = behind + before, behind - before
    terms = [np.tensordot(factors[k % 2][k // 2], values[k % 2], 1) for k in range(TERMS)]
    for u in np.linspace(-1, 1, 41):
        told = sum(term * u**k for k, term in enumerate(terms))
        assert np.abs(told - mapped(middle + way * half * u)).max() < 2**-24

    def slope(p: np.ndarray) -> np.ndarray:
        return 12 * np.linalg.norm(p, axis=0) ** 7 + 1  # 8·|p|⁷·1.5 + 1: scales the estimate alone

    behind, before = (np.array([slope(middle + sign * way * half * u) for u in nodes]) for sign in (1, -1))
    values = behind + before, behind - before
    own = table(text, "slope").reshape(-1, 3)  # fewer terms: it scales a step's length alone
    assert len(own) < TERMS
    terms = [row @ values[k % 2] for k, row in enumerate(own)]
    for u in np.linspace(-1, 1, 41):
        told, true = sum(term * u**k for k, term in enumerate(terms)), slope(middle + way * half * u)
        assert (np.abs(told - true) / true).max() < 2**-19


@needs(PHASE)
@pytest.mark.parametrize("phase", ["opt8_streams", PHASE])
def test_a_camera_within_the_bounding_sphere(phase: str, tmp_path: Path) -> None:
    """Its picture is baseline's, in depth as much as opt4's is, averaged over 4 × 4 as well."""
    scene = json.loads(registry.scenes()["mandelbulb_closeup"].path.read_text())
    scene["camera"]["position"] = [0.09, 0.31, 4.93]  # 1.12 from the centre
    scene["camera"]["look_at"] = [-0.06, 0.21, 6.7]
    pictures = {name: picture(name, scene, tmp_path, size=(114, 64)) for name in ("baseline", "opt4", phase)}
    base = pictures.pop("baseline")
    assert (base["id"] >= 0).sum() > 5000

    def error(image: images.Picture) -> tuple[float, float]:
        agree = (image["id"] == base["id"]) & (np.abs(image["Z"] - base["Z"]) <= 1e-3 * base["Z"])
        return 1 - agree.mean(), images.antialiased(base, image)["rmse"]

    ours, opt4 = error(pictures[phase]), error(pictures["opt4"])
    assert ours[0] <= opt4[0]
    assert ours[1] <= opt4[1]
