"""One suite for every phase there is: sizes, scenes, every feature of the format, options, refusals.

What a phase must agree on with the reference is bounded loosely here, to catch a feature that is wrong or
left out; the tolerances that a phase declares are held by scripts/stepwise verify.
"""

from __future__ import annotations

import functools
import json
from pathlib import Path

import numpy as np
import pytest

from conformance import geometry, harness, shading
from conformance.beside import SMOOTH, check, compare, exact_hits, precision
from conformance.feature_scenes import (
    CELL,
    FEATURES,
    FLOOR,
    FRACTALS,
    ROOM,
    SIZES,
    STANDING,
    scene,
    shape,
)
from conformance.harness import (
    HITS,
    PHASES,
    REDUCED,
    Run,
    call,
    check_picture,
    check_refusal,
    keep,
    render,
    same_bits,
)
from study.core import registry, schema
from study.core.run_schema import Frame
from study.pictures import images

SCENES = {name: found.path for name, found in registry.scenes().items()}
WIDTH, HEIGHT = (17, 5) if REDUCED else (48, 27)

pytestmark = pytest.mark.parametrize("phase", PHASES)


# Scenes, and which of their shapes others enclose.
HIDDEN = {"scene_within_a_box": [0, 1], "bulb_within_a_sphere": [0]}


@functools.cache
def feature(phase: str, name: str, width: int, height: int) -> Run:
    """A feature's picture, drawn once for the tests that look at it."""
    return render(phase, keep(name, FEATURES[name]), width, height)


@pytest.mark.parametrize("name", FEATURES)
def test_feature(phase: str, name: str) -> None:
    run = feature(phase, name, WIDTH, HEIGHT)
    check(run)
    if name in HIDDEN:
        assert not np.isin(run.picture["id"], HIDDEN[name]).any(), f"{run}: what is enclosed is seen"


@pytest.mark.parametrize("name", SCENES)
def test_scene(phase: str, name: str) -> None:
    check(render(phase, SCENES[name], 16 if REDUCED else 32, 9 if REDUCED else 18))


def test_features_show(phase: str) -> None:
    """Each feature changes the picture: what is left out would be seen by the tests above."""
    pairs = [
        ("shadows_none", "shadows_soft"),
        ("shadows_soft", "shadows_hard"),
        ("shadows_hard", "shadows_ideal"),
        ("shadows_soft", "shadow_strength"),
    ]
    pairs += [("shadows_none", "fog"), ("mirrors_0", "mirrors_1"), ("mirrors_facing_1", "mirrors_facing_2")]
    pairs += [("box", "rounded"), *((kind, f"{kind}_turned") for kind in SIZES)]
    pairs += [(kind, f"{kind}_repeated_{axis}") for kind in SIZES for axis in "xyz"]
    for before, after in pairs:
        a, b = (feature(phase, name, 48, 27) for name in (before, after))
        difference = np.abs(images.rgb(a.picture) - images.rgb(b.picture)).max(axis=-1)
        share = (difference > 1 / 255).mean()
        assert share > 0.02, f"{before} and {after} look the same: {share:.3f} of the pixels; {a}, {b}"


COLUMN = "hits_in_one_column"


def widths_around(lanes: int) -> list[int]:
    return sorted({1, 2, 3, 7, 17, lanes - 1, lanes, lanes + 1, 2 * lanes + 1} - {0})


def test_sizes(phase: str) -> None:
    """Every width leaves another remainder of lanes; no pixel may be left out or be another's."""
    cell, room = keep("cell", CELL), keep("shadows_soft", FEATURES["shadows_soft"])
    sizes = [(1, 1), (3, 2), (17, 5), (1, 9), (33, 1)]
    sizes += [(width, 3) for width in widths_around(registry.phases()[phase].lanes)]
    for width, height in sizes:
        run = render(phase, cell, width, height)
        check_picture(run)
        reference = harness.reference(cell, width, height).picture
        for name in images.AOVS[:-1]:  # all but evals, which rounding may move
            difference = np.abs(run.picture[name] - reference[name]).max()
            assert difference < 2e-3, f"{run}: {name} of a pixel is off by {difference:.2e}"
        check(render(phase, room, width, height))
    # the box about the hits is so narrow that a number of cells over its width is no float
    check(render(phase, keep(COLUMN, FEATURES[COLUMN]), 1, 9))


def test_what_is_displayed_is_the_picture(phase: str, tmp_path: Path) -> None:
    """To the byte as the formula has it of the phase's linear picture, also where its tiles make 8 bits."""
    own = registry.phases()[phase].display
    threads = ["--threads", 2] * registry.phases()[phase].threads
    out = tmp_path / "shown.ppm"
    for name in ("everything", "nothing_to_see", "camera_within_a_shape") if own else ("everything",):
        for width, height in [(33, 19), (1, 1), (64, 16)] if own else [(33, 19)]:  # cut tiles, whole lines
            path = keep(name, FEATURES[name])
            wanted = images.to_display(images.rgb(render(phase, path, width, height, aov=False).picture))
            run = call(phase, path, "-w", width, "-n", height, "--display", "-o", out, "--json", *threads)
            assert run.drawn, f"{run}"
            assert run.record["display"] == ("phase" if own else "driver"), f"{run}: {run.record['display']}"
            assert np.array_equal(images.read_ppm(out), wanted), f"{run}: displayed otherwise than it is"


def test_hits_are_where_geometry_says(phase: str) -> None:
    """Independent of any phase: hits lie on the surface of their shape, and nothing lies before them."""
    for name in ["scene0", "trio", "cubes"]:
        run = render(phase, SCENES[name], 33, 19)
        p, scene = run.picture, run.scene
        origin, directions = geometry.rays(scene, 33, 19)
        hit = p["id"] >= 0
        depth = p["Z"][hit].astype(float)
        at = origin + depth[:, None] * directions[hit]
        # of the depth: float32 of it (6e-8), a float phase's hit test (2.4e-7·|p|), and some room
        tolerance = 2e-6 * (depth + np.linalg.norm(at, axis=1)) + 2 * run.record["hit_distance"]
        every = np.array([geometry.shape_distance(at, shape) for shape in scene["shapes"]])
        own = every[p["id"][hit].astype(int), np.arange(len(at))]
        for what, off in {
            "off its shape": np.abs(own),
            "not the nearest": np.abs(own - every.min(axis=0)),
        }.items():
            wrong = ~(off <= tolerance)
            assert not wrong.any(), f"{run}: {wrong.sum()} hits {what}, by up to {off.max():.2e}"
        far = np.where(hit, p["Z"], scene["march"]["bounds_radius"])
        for share in np.linspace(0, 0.999, 60):
            inside = geometry.scene_distance(
                (origin + (share * far)[..., None] * directions).reshape(-1, 3), scene
            )
            assert (inside > -1e-5).all(), f"{run}: a ray passes {-inside.min():.2e} deep through a shape"


OPINIONS = ["everything", "shadows_hard", "shadows_soft", "light_beneath", "shininess", "shapes_same_place"]
OPINIONS += ["mirrors_0", "mirrors_3", "mirrors_facing_2", "mirrors_fog_sky"]


def drawn_by_numpy(name: str) -> dict:
    """The feature's scene without its fractals, which are chaotic."""
    whole = FEATURES[name]
    return whole | {"shapes": [s for s in whole["shapes"] if s["type"] not in FRACTALS]}


@pytest.mark.parametrize("name", OPINIONS)
def test_picture_is_what_the_words_say(phase: str, name: str) -> None:
    """Against a renderer in NumPy that was written from the text and shares nothing with any phase."""
    run = render(phase, keep(f"opinion_{name}", drawn_by_numpy(name)), 32, 18)
    mine = shading.render(run.scene, 32, 18)
    compare(run, mine, SMOOTH[precision(phase)])
    assert (run.picture["evals"] == mine["evals"]).mean() > 0.95, f"{run}: evaluations are counted otherwise"


def test_same_call_same_bits(phase: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same picture twice, whatever was in memory before, with and without AOVs, and however many frames
    are taken around it."""
    size = (7, 5) if precision(phase) == "exact" else (17, 9)
    draw = functools.partial(render, anew=True)
    picked = {"everything": FEATURES["everything"], "standing": STANDING}
    for name, one in picked.items():
        path = keep(name, one)
        once = draw(phase, path, *size)
        with monkeypatch.context() as filled:
            filled.setenv("GLIBC_TUNABLES", "glibc.malloc.perturb=170")
            same_bits(draw(phase, path, *size), once)
        same_bits(draw(phase, path, *size, "--reps", 3, "--warmup", 2), once)
        plain = draw(phase, path, *size, aov=False)
        assert sorted(plain.picture) == ["B", "G", "R"], f"{plain}: channels {sorted(plain.picture)}"
        same_bits(plain, once, "RGB")


def test_threads(phase: str) -> None:
    """More than one only where phase.json says so, and then without a bit of difference: odd numbers, more of
    them than rows, than pixels, than tiles."""
    path = keep("everything", FEATURES["everything"])
    if not registry.phases()[phase].threads:
        check_refusal(call(phase, path, "-n", 9, "--threads", 2), 4)
        return
    same_by_threads(phase, path, {(17, 9): [3], (1, 1): [2, 64]})
    if precision(phase) != "exact":  # a proved pixel takes milliseconds
        same_by_threads(phase, path, {(57, 41): [7]})


@pytest.mark.slow
def test_threads_of_many_tiles(phase: str) -> None:
    """And of one tile, whatever the phase's lanes."""
    if not registry.phases()[phase].threads or precision(phase) == "exact":
        return
    path = keep("everything", FEATURES["everything"])
    tiles = {(32, 8): [5], (32, 32): [5], (64, 64): [5], (32, 128): [5]}
    same_by_threads(phase, path, {(97, 41): [7]} | ({} if REDUCED else {(97, 41): [2, 7]} | tiles))
    # a sphere in the first place: a worker's memory before its first shadow ray is all of it; and a width of
    # sixteens, whose rows may go past the caches
    path = keep("sphere_first", scene([*ROOM[1:], FLOOR], light={"shadows": "soft"}))
    same_by_threads(phase, path, {(208, 60): [64] if REDUCED else [3, 64]})


def same_by_threads(phase: str, path: Path, numbers: dict[tuple[int, int], list[int]]) -> None:
    for size, counts in numbers.items():
        alone = render(phase, path, *size)
        for threads in counts:
            same_bits(render(phase, path, *size, "--threads", threads), alone)


def test_deepest_mirrors(phase: str) -> None:
    """As many bounces as a scene may ask for, between mirrors that face each other: no stack runs out."""
    whole = FEATURES["mirrors_facing_6"]
    deepest = whole | {"march": whole["march"] | {"max_bounces": 256}}
    check(render(phase, keep("mirrors_deepest", deepest), 9, 2))


def test_overrides(phase: str) -> None:
    """--max-steps and --hit-distance are recorded, change the scene's hash, and have their effect."""
    path = keep("shadows_soft", FEATURES["shadows_soft"])
    plain = render(phase, path, 17, 9)
    proves = precision(phase) == "exact" or exact_hits(phase)  # its hits know neither limit
    assert plain.record["overridden"] is False and plain.record["max_steps"] == 3000, f"{plain}"
    for option, value in (("max_steps", 1), ("max_steps", 40), ("hit_distance", 0.01)):
        words = "--" + option.replace("_", "-"), value
        run = render(phase, path, 17, 9, *words)
        check(run, *words)
        assert run.record[option] == value and run.record["overridden"] is True, f"{run}"
        assert run.record["scene_hash"] != plain.record["scene_hash"], f"{run}: the hash is the scene's own"
        evals = run.picture["evals"]
        if proves:
            same_bits(run, plain, HITS)
        elif option == "max_steps":
            assert evals.max() == value, f"{run}: evals up to {evals.max()}"
        else:
            assert evals.sum() < 0.95 * plain.picture["evals"].sum(), f"{run}: no fewer evaluations"


def documented_keys() -> set[str]:
    """The keys of a frame by its schema, less those that a sweep adds, and those of other programs."""
    of_sweep = {"config", "launch", "round", "env_bytes", "time", "joules"}
    of_sweep |= {"user_ns", "system_ns", "unused_ns", "instructions", "exit_status"}
    return {name for name, *_ in schema.fields(Frame)} - of_sweep


def test_record(phase: str) -> None:
    """--json and --jsonl say the same, with exactly the documented keys and plausible values."""
    declared = registry.phases()[phase]
    name, path = harness.drawn_scene(phase)
    arguments = [phase, path, "-n", 9, "--reps", 2, "--warmup", 1]
    run = call(*arguments, "--json", timed=True)
    assert run.status == 0, f"{run}"
    record = run.record
    frames = record.pop("frames")
    lines = [json.loads(line) for line in call(*arguments, "--jsonl", timed=True).stdout.splitlines()]
    for keys in [record.keys() | frames[0].keys(), *(line.keys() for line in lines)]:
        assert keys == documented_keys(), f"{run}: keys {sorted(keys ^ documented_keys())} on one side only"
    here = registry.variant_here(declared)
    expected = {"schema": 1, "phase": phase, "flags_from": phase, "scene": name, "width": 16, "height": 9}
    expected |= {"threads": 1, "precision": declared.precision, "lanes": here.lanes, "image": None}
    expected |= {"isa": "+".join(sorted({*declared.isa, *here.isa})) or "x86-64", "overridden": False}
    if not REDUCED:  # a sanitised build says so in its flags
        expected["flags"] = " ".join(filter(None, [declared.cflags, here.flags]))
    for key, value in expected.items():
        assert record[key] == value and lines[0][key] == value, (
            f"{run}: {key}: {record[key]!r}, not {value!r}"
        )
    assert [frame["warmup"] for frame in frames] == [line["warmup"] for line in lines] == [True, False, False]
    assert [frame["frame"] for frame in frames if not frame["warmup"]] == [0, 1], f"{run}: numbers of frames"
    assert (record["core_hz_load"] > 0) == (declared.lanes > 1), f"{run}: {record['core_hz_load']}"
    for frame in frames:
        for key in ("ns", "tsc_cycles", "core_cycles", "max_rss_kib"):
            assert frame[key] > 0, f"{run}: {key} is {frame[key]}"
    # two clocks around the same frame agree, unless the machine took the CPU away between them
    apart = [abs(f["tsc_cycles"] / f["tsc_hz"] * 1e9 - f["ns"]) - 0.05 * f["ns"] for f in frames]
    assert min(apart) < 20_000, f"{run}: tsc_cycles and ns differ by {min(apart):.0f} ns in every frame"


def test_missing_instruction_set(phase: str) -> None:
    """A CPU without the instruction set: status 3 and a sentence; a phase without needs runs anywhere."""
    isa = registry.phases()[phase].isa
    scene = SCENES["scene0"] if isa else harness.drawn_scene(phase)[1]
    run = call(phase, scene, "-n", 2, env={"STEPWISE_ISA_LIMIT": "none"})
    if isa:
        check_refusal(run, 3)
        assert any(flag in run.stderr for flag in isa), f"{run}: does not say which"
    else:
        assert run.status == 0, f"{run}"


def test_bad_scene(phase: str) -> None:
    path = keep("bad_radius", scene([shape("sphere", radius=-1)]))
    run = call(phase, path, "-n", 4, "--json")
    check_refusal(run, 2)
    assert f"{path}: $." in run.stderr, f"{run}: no path"
