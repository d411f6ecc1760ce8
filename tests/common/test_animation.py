"""Scenes that move (render --frames): every phase's update against a still picture of that place, resuming,
what is refused. Where shapes go is tested in tests/c/scene/test_scene_motion.c."""

from __future__ import annotations

import json

import needs
import numpy as np
import pytest

from conformance.feature_scenes import scene, shape
from conformance.harness import REFERENCE, Unsupported, call, check_refusal, keep, render, same_bits
from study.core import registry

# After half a second the first is a quarter turn on, the second at its line's other end.
MOVING = [
    shape("sphere", radius=0.5, position=[1, 0.5, 0], material="mirror")
    | {"path": {"type": "circle", "centre": [0, 0.5, 0], "axis": [0, 1, 0], "period": 2}},
    shape("sphere", radius=0.75, position=[-1, 0, 2], material="glossy")
    | {"path": {"type": "line", "to": [0.5, -1, 1], "period": 1}},
    shape("sphere", radius=0.75, position=[0, 0, 3]),
]
PLACES = [[0, 0.5, -1], [0.5, -1, 1], [0, 0, 3]]


def scenes(light: str = "none") -> tuple[dict, dict]:
    """The moving one, and a still of it at half a second by hand."""
    still = [{k: v for k, v in s.items() if k != "path"} | {"position": p}
             for s, p in zip(MOVING, PLACES, strict=True)]  # fmt: skip
    moving, still = (scene(shapes, light={"shadows": light}) for shapes in (MOVING, still))
    return moving, still


def test_a_sequence_and_its_rest() -> None:
    """Frames, times and shares of an animation; the same from where it was cut off."""
    path = keep("moving", scenes()[0])
    run = call(REFERENCE, path, "-n", 4, "--frames", 6, "--warmup", 2, "--jsonl", timed=True)
    lines = [json.loads(line) for line in run.stdout.splitlines()]
    numbers = [(one["frame"], one["warmup"]) for one in lines]
    assert numbers == [(n, n < 0) for n in range(-2, 6)] and lines[0]["first"], f"{run}"
    assert np.allclose([one["scene_time"] for one in lines], np.arange(-2, 6) / 60, rtol=1e-15)
    assert all(0 < one["update_ns"] < one["ns"] for one in lines), f"{run}"
    rest = call(REFERENCE, path, "-n", 4, "--frames", 6, "--first-frame", 4, "--warmup", 1, "--json")
    assert [(one["frame"], one["warmup"]) for one in rest.record["frames"]] == [
        (3, True),
        (4, False),
        (5, False),
    ]
    whole, rest = (
        render(REFERENCE, path, 16, 9, "--frames", n, "--first-frame", 4, "--warmup", k)
        for n, k in [(5, 0), (9, 3)]
    )
    same_bits(whole, rest)
    still = call(REFERENCE, path, "-n", 4, "--json").record["frames"]
    assert [(one["update_ns"], one["scene_time"]) for one in still] == [(0, 0)]


def test_what_does_not_move_is_refused() -> None:
    path = keep("unmoved", scenes()[1])
    run = call(REFERENCE, path, "-n", 4, "--frames", 3, "-o", "nowhere.exr")
    check_refusal(run, 2)
    assert str(path) in run.stderr, f"{run}"


CAMERA = {"position": [0, 0.5, -4], "look_at": [0, 0, 3]}


def flying(to: list[float]) -> dict:
    """The still scene with a camera that goes to `to` in half a second."""
    still = scenes("hard")[1]
    camera = still["camera"] | CAMERA
    path = {"type": "line", "to": to, "period": 1}
    return still | {"camera": camera | {"path": path}}


def flight() -> tuple[dict, dict, dict]:
    """The scene with a flying camera; still ones of its beginning and its end."""
    moving = flying([1.5, 1, -3])
    camera = {key: value for key, value in moving["camera"].items() if key != "path"}
    return moving, moving | {"camera": camera}, moving | {"camera": camera | {"position": [1.5, 1, -3]}}


def motion() -> tuple[dict, dict, dict]:
    """The same of moving shapes."""
    moving, there = scenes("hard")
    still = [{k: v for k, v in s.items() if k != "path"} for s in MOVING]
    return moving, scene(still, light={"shadows": "hard"}), there


@pytest.mark.parametrize("of", [motion, flight])
@pytest.mark.parametrize("phase", list(registry.phases()))
def test_a_frame_is_the_still_picture_of_its_place(phase: str, of, monkeypatch) -> None:
    needs.cpu_for(phase)
    monkeypatch.setenv("STEPWISE_CC", "none")
    monkeypatch.setenv("STEPWISE_FIXED", "clear=safe")  # phase fixed's own clears this picture's only block
    moving, *stills = (keep(f"{of.__name__}_{i}_{phase}", one) for i, one in enumerate(of()))
    try:
        begin, there = (render(phase, still, 24, 14) for still in stills)
    except Unsupported:
        pytest.skip("the phase does not render spheres with hard shadows")
    same_bits(render(phase, moving, 24, 14), begin)
    same_bits(render(phase, moving, 24, 14, "--frames", 31, "--first-frame", 30), there)
    assert (begin.picture["id"] != there.picture["id"]).mean() > 0.05, f"{begin}: nothing has moved"


def test_a_camera_that_flies_alone_updates_no_shapes() -> None:
    path = keep("flying", flying([1.5, 1, -3]))
    frames = call(REFERENCE, path, "-n", 4, "--frames", 2, "--json").record["frames"]
    updates = [one["update_ns"] for one in frames if not one["warmup"]]
    assert updates == [0, 0]


def test_a_camera_without_a_direction_is_refused_before_the_first_frame() -> None:
    path = keep("into_itself", flying([0, -0.5, 10]))
    assert call(REFERENCE, path, "-n", 4, "--frames", 10, "--json").status == 0
    run = call(REFERENCE, path, "-n", 4, "--frames", 16, "-o", "nowhere.exr")
    check_refusal(run, 2)
    assert "0.25 s" in run.stderr and "look_at" in run.stderr, f"{run}"


def test_scenes_made_to_move_are_scenes_of_the_study_and_paths() -> None:
    assert registry.animated() and not set(registry.animated()) & set(registry.scenes())
    stills = [one.data for one in registry.scenes().values()]
    for one in registry.animated().values():
        shapes = [{k: v for k, v in s.items() if k != "path"} for s in one.data["shapes"]]
        camera = {k: v for k, v in one.data["camera"].items() if k != "path"}
        assert one.data | {"shapes": shapes, "camera": camera} in stills
        check = call(REFERENCE, one.path, "-n", 1, "-w", 1, "--frames", 1)
        assert check.status == 0, f"{check}"
