"""What a scene may say and no picture shows: a line each, and the picture all the same."""

from __future__ import annotations

import json
from pathlib import Path

import emitted
import pytest

from conformance.feature_scenes import scene, shape
from conformance.harness import REFERENCE, call
from study.core import registry

SHIPPED = registry.shipped()
WARNING = "render: warning: "


def warned(phase: str, path: Path, *options: str | int) -> list[str]:
    run = call(phase, path, "-n", 2, *options)
    assert run.status == 0 and run.stdout, f"{run}"
    return run.stderr.splitlines()


@pytest.mark.parametrize("phase", [REFERENCE, "opt4", "opt9_convex", "rods", "fixed"])
@pytest.mark.parametrize("name", SHIPPED)
def test_no_scene_of_ours_is_warned_of(name: str, phase: str) -> None:
    run = call(phase, SHIPPED[name].path, "-n", 2)
    assert run.status in (0, 4) and WARNING not in run.stderr, f"{run}"


WIDE = {"bounds_radius": 1e9, "surface_offset": 1e-3}


def placed(x: float) -> dict:
    """A sphere before the camera, both at `x`: what is between them is exact."""
    camera = {"position": [x, 0, -5], "look_at": [x, 0, 0]}
    return scene([shape("sphere", position=[x, 0, 0])], camera=camera, march=WIDE)


def away(z: float, **march: float) -> dict:
    """A sphere that far away: the float after 2^14 is 2^-9 = 0.002 behind it."""
    return scene([shape("sphere", position=[0, 0, z], radius=z / 20)], march=WIDE | march)


def sized(kind: str, **sizes: object) -> dict:
    return scene([shape("sphere"), shape(kind, position=[9, 0, 0]) | sizes], march={"hit_distance": 0.01})


COARSE = {"hit_distance": 1e-3}
INSIDE = {
    kind: scene([shape("plane", offset=-9), shape(kind, position=[0.4, 1.1, -5])], march=COARSE)
    for kind in ("sphere", "box", "cone", "octahedron", "mandelbulb")
}
# Each scene, and what its line names.
WARNED = {
    **{f"camera in a {kind}": (whole, "$.shapes[1]") for kind, whole in INSIDE.items()},
    "camera close": (scene([shape("sphere", position=[0.4, 1.1, -3.6999])], march=COARSE), "$.shapes[0]"),
    "camera under a plane": (scene([shape("plane", normal=[0, 1, 0], offset=2)]), "$.shapes[0]"),
    "sphere": (sized("sphere", radius=0.009), "$.march.hit_distance"),
    "box": (sized("box", half_size=[1, 1, 0.009]), "$.march.hit_distance"),
    "torus": (sized("torus", minor_radius=0.009), "$.march.hit_distance"),
    "cone": (sized("cone", half_height=0.009), "$.march.hit_distance"),
    "octahedron": (sized("octahedron", radius=0.017), "$.march.hit_distance"),
    "far": (away(2e4), "$.march.surface_offset"),
    "far plane": (scene([shape("plane", offset=-2e4)], march=WIDE), "$.march.surface_offset"),
    "at large numbers": (placed(1e8), "$.shapes[0]"),
}
SILENT = {
    "camera outside": scene([shape("sphere", position=[0.4, 1.1, -3.69])], march=COARSE),
    "box": sized("box", half_size=[1, 1, 0.011]),
    "rounded": sized("box", half_size=[1, 1, 0.009], rounding=0.002),
    "octahedron": sized("octahedron", radius=0.018),
    "far": away(5e3),
    "beyond the bounds": away(2e4, bounds_radius=5e3),
    "at large numbers": placed(1e6),
}


@pytest.mark.parametrize("phase", ["opt4", "opt9_convex"])
@pytest.mark.parametrize("name", WARNED)
def test_what_the_picture_cannot_show_is_a_line(name: str, phase: str, tmp_path: Path) -> None:
    whole, named = WARNED[name]
    (path := tmp_path / "a.json").write_text(json.dumps(whole))
    [line] = warned(phase, path)
    assert line.startswith(WARNING) and named in line, line


@pytest.mark.parametrize("name", SILENT)
def test_what_it_can_show_is_none(name: str, tmp_path: Path) -> None:
    (path := tmp_path / "a.json").write_text(json.dumps(SILENT[name]))
    assert warned("opt4", path) == []


@pytest.mark.parametrize("whole", [away(2e4), placed(1e8)], ids=["far", "at large numbers"])
def test_doubles_go_further_than_floats(whole: dict, tmp_path: Path) -> None:
    (path := tmp_path / "a.json").write_text(json.dumps(whole))
    assert warned(REFERENCE, path) == []


def test_a_limit_of_the_command_line_counts(tmp_path: Path) -> None:
    (path := tmp_path / "a.json").write_text(json.dumps(scene([shape("sphere", radius=0.5)])))
    assert warned("opt4", path) == []
    [line] = warned("opt4", path, "--hit-distance", 0.6)
    assert "0.6" in line and "0.5" in line


def test_a_script_hands_the_warning_on_once(tmp_path: Path) -> None:
    (path := tmp_path / "inside.json").write_text(json.dumps(INSIDE["sphere"]))
    words = ["--phase", "opt4", "opt3", "-n", 4, "--run", tmp_path / "run"]
    done = emitted.ran("verify", "--scene", path, *words)
    assert sum(line.startswith(WARNING) for line in done.stderr.splitlines()) == 1, done.stderr
