"""Declared costs and counted calls: build/NAME/render-count of every phase that has a costs.def.

Expected calls come from the geometry of small scenes and from the pictures' own evals and id planes.
"""

import functools
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import copied
import numpy as np
import pytest

from builds import READ
from conformance.feature_scenes import CELLS, FLOOR, ROOM, TURNED, scene, shape
from study.core import registry, run, store
from study.core.build import build
from study.core.registry import ROOT
from study.counting import costs
from study.pictures import images

pytestmark = pytest.mark.slow

DECLARED = {
    name: p for name, p in registry.phases().items() if p.file("costs.def").exists() and name not in READ
}
SCALAR = [name for name, phase in DECLARED.items() if phase.lanes == 1 and phase.family == "ladder"]
CLASSES = ("add", "mul", "fma", "div", "sqrt", "rsqrt", "minmax", "compare", "call")
MACHINE = dict(zip(CLASSES, (1, 1, 2, 1, 1, 1, 1, 0, 0), strict=True))

MANY = [
    shape("sphere", radius=0.5, position=[-1, 0, 0]),
    shape("sphere", radius=0.4, position=[1, 1, 0], material="mirror"),
    shape("box", position=[2, 0, 2], **{"rotation_degrees": [0, 30, 0]}),
    shape("torus", rotation_degrees=[20, 0, 40]),
    shape("torus", position=[0, 2, 1]),
    shape("torus", position=[0, -1, 3], repeat=[5, 0, 0]),
    shape("cone", position=[-2, 0, 1]),
    shape("octahedron", position=[-1, 1.5, 0], rotation_degrees=TURNED["rotation_degrees"]),
    shape("mandelbulb", position=[1.5, -0.5, -0.5], repeat=[0, 6, 0]),
    shape("mandelbox", position=[-3, 2, 3], iterations=3),
    FLOOR,
]
OTHER = "spheres40"  # where a system refuses a scene
SCENES = {
    "many": scene(MANY, light={"shadows": "soft"}, fog=1e-4),
    "bare": scene(MANY[:2] + ROOM),  # no shadow, no fog; its mirror is taken out below
    "hard": scene(ROOM, light={"shadows": "hard"}),
    "ideal": scene(ROOM, light={"shadows": "ideal"}),
    "turned": scene([shape("box", repeat=CELLS, **TURNED), FLOOR]),
    "ball": scene([shape("sphere")]),
}
SCENES["bare"]["shapes"][1] = MANY[1] | {"material": "plain"}


@pytest.fixture(scope="session")
def scene_path(tmp_path_factory):
    """Writes one of SCENES and gives its path."""
    folder = tmp_path_factory.mktemp("counted")

    @functools.cache
    def path(name: str) -> Path:
        if name not in SCENES:
            return ROOT / "common" / "scenes" / f"{name}.json"
        store.write_json(folder / f"{name}.json", SCENES[name])
        return folder / f"{name}.json"

    return path


@pytest.fixture(scope="session")
def counted(scene_path, tmp_path_factory):
    """Counts of a phase on a scene, and its picture; `again` makes another run of the same.

    Of OTHER, where a system refuses the scene: what it draws, it counts."""
    folder = tmp_path_factory.mktemp("pictures")

    @functools.cache
    def count(phase: str, name: str, height: int = 24, again: int = 0, threads: int = 1):
        if lacking := registry.missing_isa(DECLARED[phase]):
            pytest.skip(f"this CPU lacks {', '.join(lacking)}, which {phase} needs")
        out = folder / f"{phase}-{name}-{height}-{again}-{threads}.exr"
        try:
            made = run.render(
                phase,
                scene_path(name),
                height,
                aov=True,
                out=out,
                threads=threads,
                target="render-count",
                timed=False,
            )
        except run.DriverError as error:
            may_refuse = DECLARED[phase].family == registry.SYSTEMS and name != OTHER
            if error.status != run.UNSUPPORTED or not may_refuse:
                raise
            return count(phase, OTHER, height, again, threads)
        return made, images.read(out)

    return count


def calls(made: dict[str, Any], function: str, part: str = "call") -> int:
    return made["by_function"][function]["parts"][part]


# --- what holds of every phase


@pytest.mark.parametrize("name", ["many", "mandelbulb"])
@pytest.mark.parametrize("phase", DECLARED)
def test_functions_add_up(counted, phase, name):
    made, _ = counted(phase, name)
    functions = made["by_function"].values()
    assert made["flops"].keys() == {"paper", "machine"}
    assert (made["flops"]["machine"] > 0) == costs.declares(phase)
    for convention in ("paper", "machine"):
        assert made["flops"][convention] == sum(one[convention] for one in functions)
    assert made["flops"]["machine"] == sum(n * MACHINE[kind] for kind, n in made["by_class"].items())
    assert made["executed"] == made["flops"]["machine"]
    assert made["useful"] == sum(one["useful"] for one in functions) <= made["executed"]
    for one in functions:
        assert {"calls", "lanes", "paper", "machine"} <= one.keys()
        assert one["calls"] == one["parts"].get("call", 0) and one["useful"] <= one["machine"]
        assert 0 <= one["lanes"] <= one["calls"] * registry.variant_here(DECLARED[phase]).lanes
    if DECLARED[phase].lanes == 1:
        assert all(one["lanes"] == one["calls"] for one in functions)
        assert made["useful"] == made["executed"]
        assert made["flops"]["paper"] == made["flops"]["machine"] + made["by_class"]["call"]


@pytest.mark.parametrize("phase", DECLARED)
def test_two_threads_count_as_one(counted, scene_path, phase):
    one, _ = counted(phase, "many")
    if not DECLARED[phase].threads:
        with pytest.raises(run.DriverError, match="one thread"):
            run.render(phase, scene_path("many"), 24, threads=2, target="render-count")
        return
    two, _ = counted(phase, "many", threads=2)
    assert one["flops"] == two["flops"] and one["by_function"] == two["by_function"]


@pytest.mark.parametrize("name", ["many"])
@pytest.mark.parametrize("phase", DECLARED)
def test_counting_does_not_change_the_picture(counted, scene_path, tmp_path, phase, name):
    made, counting = counted(phase, name)
    name = Path(made["scene"]).stem if "scene" in made else name
    run.render(phase, scene_path(name), made["height"], aov=True, out=tmp_path / "timing.exr", timed=False)
    timing = images.read(tmp_path / "timing.exr")
    for channel in images.AOVS:
        assert np.array_equal(counting[channel].view(np.uint32), timing[channel].view(np.uint32)), channel


# --- calls that geometry knows


@pytest.mark.parametrize("name", ["bare", "turned"])
@pytest.mark.parametrize("phase", SCALAR)
def test_evaluations_are_those_of_primary_rays_and_normals(counted, phase, name):
    """No mirror, no shadow: each ray evaluates as often as `evals` says, each hit four times more."""
    made, picture = counted(phase, name, height=36)
    hits = int((picture["id"] >= 0).sum())
    evals = int(picture["evals"].sum(dtype=np.float64))
    assert 0 < hits < picture["id"].size or name == "bare"
    assert calls(made, "sdf") == evals + 4 * hits
    assert calls(made, "ray_march", "step") == evals
    assert calls(made, "ray_march", "on") == evals - hits
    assert calls(made, "normal_at") == calls(made, "light_at") == calls(made, "trace", "hit") == hits
    assert calls(made, "trace") == picture["id"].size


@pytest.mark.parametrize("phase", SCALAR)
def test_shadow_rays_go_where_the_scene_has_them(counted, phase):
    soft, hard, ideal, bare = (counted(phase, name)[0] for name in ("many", "hard", "ideal", "bare"))
    # From opt2 on: only where the surface faces the light.
    wanted = "facing" if "facing" in soft["by_function"]["light_at"]["parts"] else "direction"
    assert calls(soft, "soft_shadow") == calls(soft, "light_at", wanted) > 0
    assert calls(hard, "hard_shadow") == calls(hard, "light_at", wanted) > 0
    assert calls(ideal, "ideal_shadow") == calls(ideal, "light_at", wanted) > 0
    assert calls(soft, "hard_shadow") == calls(hard, "soft_shadow") == 0
    assert calls(soft, "ideal_shadow") == calls(hard, "ideal_shadow") == calls(ideal, "soft_shadow") == 0
    assert calls(bare, "hard_shadow") == calls(bare, "soft_shadow") == 0


# --- a feature that is not there costs nothing, from opt1 on


def test_the_baseline_takes_sines_whether_it_turns_or_not(counted):
    made, _ = counted("baseline", "ball")
    lit, shine = (calls(made, "light_at", part) for part in ("direction", "specular"))
    # Six per evaluation, the fog's exp per hit, fmax per lit point, fmax and pow where it shines.
    assert made["by_class"]["call"] == 6 * calls(made, "sdf") + calls(made, "trace", "hit") + lit + 2 * shine


def test_opt1_takes_no_sine_and_turns_only_what_is_turned(counted):
    made, _ = counted("opt1", "ball")
    lit, shine = (calls(made, "light_at", part) for part in ("direction", "specular"))
    assert made["by_class"]["call"] == lit + 2 * shine  # a sphere calls nothing: no sine, no exp
    assert calls(made, "apply_transform", "turn") == calls(made, "apply_transform", "wrap") == 0
    assert "rotate_point" not in made["by_function"]
    made, _ = counted("opt1", "many")
    evaluations, shapes = calls(made, "sdf"), SCENES["many"]["shapes"]
    for part, key in {"turn": "rotation_degrees", "wrap": "repeat"}.items():
        axes = sum(value != 0 for one in shapes for value in one.get(key, []))
        assert calls(made, "apply_transform", part) == evaluations * axes > 0


def test_opt2_turns_and_wraps_by_shape(counted):
    made, _ = counted("opt2", "many")
    for part, key in {"turn": "rotation_degrees", "wrap": "repeat"}.items():
        shapes = sum(key in one for one in SCENES["many"]["shapes"])
        assert calls(made, "apply_transform", part) == calls(made, "sdf") * shapes > 0


def test_a_spheres_distance_is_ten_operations(counted):
    """|p − c| − r: three differences, three squares, two sums, a root, a difference."""
    made, _ = counted("opt2", "ball")
    work = sum(made["by_function"][name]["machine"] for name in ("apply_transform", "sdf_sphere"))
    assert work == 10 * calls(made, "sdf")


def test_a_gradient_works_for_all_that_hit_its_shape(tmp_path):
    """Boxes with one front, which they share in the middle: there the whole scene's difference is taken, and
    the closed form after it again for all: as many as gradient_of was asked for."""
    boxes = scene([shape("box", half_size=[1, 1, 1], position=[x, 0, 0]) for x in (-0.5, 0.5)])
    store.write_json(tmp_path / "boxes.json", boxes)
    made = run.render("opt4", tmp_path / "boxes.json", 64, target="render-count", timed=False)["by_function"]
    asked, closed, taken = (made[name] for name in ("gradient_of", "box_gradient", "scene_difference"))
    assert 0 < taken["lanes"] < 8 * taken["calls"]
    assert (closed["calls"], closed["lanes"]) == (asked["calls"], asked["lanes"])


# --- what is said when costs and source do not fit


def test_a_part_without_a_cost_does_not_build(tmp_path):
    copied.folders(tmp_path, "common", "scripts/study", "phases/baseline")
    shutil.copy(ROOT / "Makefile", tmp_path)
    costs = tmp_path / "phases/baseline/costs.def"
    kept = [line for line in costs.read_text().splitlines() if not line.startswith("COST(clamp, not_below")]
    costs.write_text("\n".join(kept) + "\n")
    command = ["make", "-s", "-C", str(tmp_path), "build/baseline/count/phase.o"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode != 0
    assert re.search("error: .COST_clamp_not_below. undeclared", done.stderr)
    assert "baseline/sdf.h:" in done.stderr


@pytest.mark.parametrize("phase", ["baseline", "opt4"])
def test_the_timing_build_has_none_of_it(phase):
    build(phase)
    names = subprocess.check_output(["nm", ROOT / "build" / phase / "phase.o"], text=True)
    assert "phase_render" in names and "flops" not in names
