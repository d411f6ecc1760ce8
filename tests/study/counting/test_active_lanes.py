"""Useful lanes of the SIMD phases where they follow from the scene, whatever the picture is."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import needs
import pytest

from study.core import generated_scenes as scaling_scenes
from study.core.build import build

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]


def test_a_gradient_works_for_all_that_hit_its_shape(tmp_path: Path) -> None:
    """Boxes with one front, which they share in the middle: there the whole scene's difference is taken, and
    the closed form after it again for all: where there are boxes only, as many as gradient_of was asked for.
    """
    scene = json.loads((ROOT / "common" / "scenes" / "trio.json").read_text())
    box = {"type": "box", "half_size": [1, 1, 1], "material": next(iter(scene["materials"]))}
    scene["shapes"] = [box | {"position": [x, 0, 12]} for x in (-0.5, 0.5)]
    path = tmp_path / "boxes.json"
    path.write_text(json.dumps(scene))
    command = [build("opt4", "render-count"), path, "-n", "64", "--json"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    made = json.loads(done.stdout)["by_function"]
    asked, closed = made["gradient_of"], made["box_gradient"]
    assert made["scene_difference"]["calls"] > 0  # or nothing here could go wrong
    assert made["scene_difference"]["lanes"] < 8 * made["scene_difference"]["calls"]
    assert (closed["calls"], closed["lanes"]) == (asked["calls"], asked["lanes"])


@pytest.mark.parametrize("phase", ["opt9_convex", "opt10_scene"])
def test_a_packet_of_few_rays_works_for_these(phase: str, tmp_path: Path) -> None:
    """A picture so small that the shadow rays of a scene with a BVH fill no packet.

    What is asked of every ray has as many lanes in all, the rest no more at any call; between them the
    spheres of a node are in the lanes, 8 or 16.
    """
    needs.cpu_for(phase)
    scene = scaling_scenes.data("scattered", 256, 3)
    scene["light"]["shadows"] = "soft"
    path = tmp_path / "crowd.json"
    path.write_text(json.dumps(scene))
    command = [build(phase, "render-count"), path, "-n", "3", "--json"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    made = json.loads(done.stdout)["by_function"]
    rays, packets = (made["load_sorted_packet"][key] for key in ("lanes", "calls"))
    assert 1 < rays < 8 and 1 < packets <= rays  # a packet for every solid
    for name in ("load_batch_packet", "begin_march", "bvh_first_entry"):
        assert made[name]["lanes"] == rays and made[name]["calls"] == packets, name
    assert made["bundle_of_packets"]["lanes"] == 2 * rays  # of the batch, and of its one packet
    marching = (
        "may_enter_sphere",
        "set_active_set",
        "sphere_bound",
        "awake_candidates",
        "sphere_too_far",
        "query_bundle_of",
        "evaluate_candidate",
        "needs_cone_query",
        "off_surfaces",
        "advance_by",
        "store_lit",
    )
    for name in marching:
        assert 0 < made[name]["lanes"] <= rays * made[name]["calls"], name
