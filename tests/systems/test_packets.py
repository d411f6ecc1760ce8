"""The packet ray tracer (phase packets): its hits against proved ones and against each other, whatever tree,
way or width finds them; its pictures against truth; what it refuses.
"""

from __future__ import annotations

import itertools
import subprocess

import enclosures
import numpy as np
import pytest
from programs import needs_sixteen, sixteen

from conformance import geometry
from conformance.feature_scenes import FLOOR, scene, shape
from study.core.build import build
from study.measuring import rays as packets_rays
from study.pictures import images

WAYS = ["tree=bvh rays=alone", "tree=kd rays=alone", "tree=none rays=alone"]
WAYS += ["tree=bvh rays=together", "tree=kd rays=together", "tree=none rays=together", "tree=bvh", "tree=kd"]


SIZE = (61, 35)


def many(count, seed, kinds=("sphere", "box", "cone"), spread=6.0, size=0.4):
    """Solids at random places, turned at random, of random sizes."""
    dice = np.random.default_rng(seed)
    made = []
    for i in range(count):
        kind, a = kinds[i % len(kinds)], size * 4 ** dice.uniform(-1, 1, 3)
        sizes = {"sphere": {"radius": a[0]}, "box": {"half_size": a.tolist()}}
        sizes["cone"] = {"bottom_radius": a[0], "top_radius": a[1], "half_height": a[2]}
        placed = {"position": dice.uniform(-spread, spread, 3).tolist()}
        placed["rotation_degrees"] = dice.uniform(-180, 180, 3).tolist()
        placed["material"] = ("plain", "blue", "mirror")[i % 3]
        made.append({"type": kind, **sizes[kind], **placed})
    return made


LEANING = {"rotation_degrees": [20, 0, 10]}
HARD = {"light": {"shadows": "hard"}, "march": {"max_bounces": 3}}
TWINS = many(40, 21, kinds=("sphere",))  # each stands in its place twice
SCENES = {
    "room": scene(
        [FLOOR, *many(24, 5, spread=2.0, size=0.25)], **HARD, camera={"position": [0.4, 1.1, -7]}, fog=1e-4
    ),
    # Secondary rays begin within rounding of what they leave.
    "close": scene(
        [FLOOR | {"material": "mirror"}, *many(9, 6, spread=1.5)],
        light={"shadows": "hard"},
        march={"surface_offset": 1e-9, "max_bounces": 2},
    ),
    "twins": scene([*TWINS, *reversed(TWINS)], **HARD),
    "mixed": scene([FLOOR, shape("plane", normal=[1, 0.2, 0], offset=-9), *many(300, 1)], **HARD),
    "coincident": scene([shape("sphere", radius=1, material="plain")] * 4096, **HARD),
    "one": scene([shape("cone")], **HARD),
    **{
        # A flat cone among others, so that lanes hold both.
        name: scene(
            [
                shape("cone", bottom_radius=low, top_radius=1.501 - low, half_height=height, **LEANING),
                *(shape("cone", position=[x, 2.5, 2], half_height=0.5) for x in (-3, 0, 3)),
            ],
            **HARD,
            camera={"position": [-3, 2, -4], "look_at": [0, 0, 0], "vertical_fov_degrees": 30},
        )
        for name, low, height in (("oblate", 1.5, 1e-4), ("oblate_up", 1e-3, 1e-5))
    },
    "within": scene(
        [
            shape("box", half_size=[0.3, 0.2, 0.1], position=[0.5, 1.1, -5], material="mirror"),
            *many(9, 6, spread=1.5),
        ],
        light={"shadows": "none", "position": [0.45, 1.1, -5]},
        march={"max_bounces": 3},
    ),
    "planes": scene([FLOOR, shape("plane", normal=[0, 0, -1], offset=-5)], **HARD),
    "flat": scene(
        [
            shape("box", half_size=[3, 1e-9, 3], position=[0, 1, 0], rotation_degrees=[0, 0, 20]),
            shape("box", half_size=[3, 1e-9, 3], position=[0, 0.5, 0]),
            shape("box", half_size=[1e-9, 1e-9, 2]),
            shape("box", half_size=[1e6, 1e-6, 1e-9], position=[0, -1, 0]),
            *many(9, 3, kinds=("sphere", "box")),
        ],
        light={"shadows": "hard"},
        march={"bounds_radius": 1e8, "max_bounces": 3},
    ),
}


# --- Closed forms against proved hits


def deepest(data, origin, direction, low, high):
    """How deep the rays go into the shape between low and high: least distance at 65 places of each."""
    least = np.full(len(origin), np.inf)
    for share in np.linspace(0, 1, 65):
        at = origin + (low + share * (high - low))[:, None] * direction
        least = np.minimum(least, geometry.shape_distance(at, data["shapes"][0]))
    return -least


@pytest.mark.slow
@pytest.mark.parametrize("limit", ["", "none"])
@pytest.mark.parametrize("kind", ["sphere", "box", "cone", "plane"])
def test_closed_forms_hit_where_truth_proves(kind, limit, written):
    for turned in (False, True):
        frame = {"rotation_degrees": enclosures.ROTATION, "position": enclosures.POSITION} if turned else {}
        data = enclosures.scene(kind, **frame)
        path = written(f"{kind}{turned}", data)
        local, _ = enclosures.rays(kind, 3000, 7 + turned)
        sextuples = enclosures.moved(local) if turned else local
        direction = sextuples[:, 3:] / np.linalg.norm(sextuples[:, 3:], axis=1, keepdims=True)
        rays = np.hstack([sextuples[:, :3], direction, np.full((3000, 1), np.inf)]).astype("<f4")
        given = rays[:, :6].astype(float)
        _, found = packets_rays.hits(path, rays, "primary", "", limit)
        t, index = found[0].T.astype(float)
        status, true, low, high, _ = enclosures.claimed(build("truth", "rays"), path, given).T
        origin, direction = given[:, :3], given[:, 3:]
        size = np.linalg.norm(origin, axis=1) + np.where(true >= 0, low, 0)
        size = 1e-6 * (4 + size + np.where(index >= 0, np.abs(t), 0))
        height = geometry.shape_distance(origin, data["shapes"][0])
        usable = (status == 2) & (height > 2 * size)
        within = height < -2 * size  # a march from there ends at once, behind by its depth
        assert (index[within] == 0).all() and within.sum() > 50
        assert (np.abs(t - height)[within] <= size[within]).all()
        hit, there = usable & (index >= 0), usable & (true >= 0)
        assert hit.sum() > 600 and there.sum() > 600
        at = origin[hit] + t[hit, None] * direction[hit]
        off = np.abs(geometry.shape_distance(at, data["shapes"][0]))
        assert (off <= 3 * size[hit]).all(), f"{kind}: a hit is {off.max():.2e} off its shape"
        # What one of the two misses, or meets later, is grazed.
        before = hit & (t > high + size)
        reach = np.where(hit, t, high + 4.0)
        missed = there & ~hit | before
        depth = deepest(data, origin[missed], direction[missed], low[missed], reach[missed] - size[missed])
        assert (depth <= 3 * size[missed]).all(), f"{kind}: missed by {depth.max(initial=0):.2e}"
        agreed = hit & there & ~before
        right = np.abs(t[agreed] - low[agreed]) < 1e-4 * (1 + low[agreed])
        assert missed.sum() < 200 and right.mean() > 0.9  # a seventh of the rays are tangents


# --- One answer, whatever the way to it


def bundle(count, seed, spread=7.0):
    """Rays that go together by 256, then rays that do not; directions along axes, zero, not numbers."""
    dice = np.random.default_rng(seed)
    eye = np.repeat(dice.uniform(-spread, spread, (count // 256, 3)), 256, axis=0)
    eye[256:] += 0.5 * dice.normal(size=eye[256:].shape)  # some from one place, some from near it
    aim = np.repeat(dice.normal(size=(count // 256, 3)), 256, axis=0)
    together = aim / np.linalg.norm(aim, axis=1, keepdims=True) + 0.1 * dice.normal(size=aim.shape)
    apart = dice.normal(size=(count, 3))
    apart[:60:3] = np.eye(3)[dice.integers(0, 3, 20)] * dice.choice([-1, 1], (20, 1))
    apart[60:70] = 0
    apart[70:75, 1] = np.nan
    d = np.vstack([together, apart])
    length = np.linalg.norm(d, axis=1, keepdims=True)
    d = d / np.where(length > 0, length, 1)
    o = np.vstack([eye, dice.uniform(-spread, spread, (count, 3))])
    o[len(eye) + 75 : len(eye) + 80, 2] = np.nan
    o[len(eye) + 80 : len(eye) + 85] = np.inf
    return np.hstack([o, d, dice.uniform(0, 12, (len(o), 1))]).astype("<f4")


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in SCENES if n not in ("room", "close")])
def test_every_way_meets_the_same_to_the_bit(name, written):
    path, rays = written(name, SCENES[name]), bundle(512, 11)
    for kind in ("primary", "shadow"):
        (_, first), *others = [packets_rays.hits(path, rays, kind, words) for words in WAYS]
        for words, (record, found) in zip(WAYS[1:], others, strict=True):
            assert record.settings.startswith(words.split()[0])
            if kind == "shadow":
                same = (first[0][:, 0] == -np.inf) == (found[0][:, 0] == -np.inf)
            else:
                same = (first[0].view(np.uint32) == found[0].view(np.uint32)).all(1)
            assert same.all(), f"{kind} {words}: {(~same).sum()} other answers, ray {np.argmin(same)}"
        assert np.isnan(first[0]).sum() == 0
        if kind == "primary":
            assert (first[0][:, 1] >= 0).any() and set(np.unique(first[0][:, 1])) <= {
                -1.0,
                *map(float, range(len(SCENES[name]["shapes"]))),
            }
            bad = ~np.isfinite(rays[:, :6]).all(1) | ~rays[:, 3:6].any(1)
            assert bad.sum() == 25 and (first[0][bad] == [np.inf, -1]).all()
    if name == "coincident":
        assert set(np.unique(first_hits(path, rays)[:, 1])) == {-1.0, 0.0}  # the first in the scene


def first_hits(path, rays, limit=""):
    return packets_rays.hits(path, rays, "primary", "", limit)[1][0]


def test_hits_are_the_nearest_of_all_by_numpy(written):
    """Spheres alone: against the quadratic in double, which shares nothing with any phase."""
    data = scene(many(200, 9, kinds=("sphere",)), **HARD)
    rays = bundle(512, 12)
    rays = rays[np.isfinite(rays).all(1) & rays[:, 3:6].any(1)]
    found = first_hits(written("balls", data), rays)
    o, d = rays[:, None, :3].astype(float), rays[:, None, 3:6].astype(float)
    m = np.array([s["position"] for s in data["shapes"]]) - o
    along = (m * d).sum(-1)
    rest = np.array([s["radius"] for s in data["shapes"]]) ** 2 - (m * m).sum(-1) + along**2
    outside = ((m * m).sum(-1) > np.array([s["radius"] for s in data["shapes"]]) ** 2).all(1)
    t = np.where(rest >= 0, along - np.sqrt(np.maximum(rest, 0)), np.inf)
    t[t <= 0] = np.inf
    shape_of = np.where(np.isfinite(t.min(1)), t.argmin(1), -1)
    assert outside.sum() > 300 and (shape_of[outside] >= 0).sum() > 150
    other = outside & (shape_of != found[:, 1])
    assert other.sum() <= 1 and not (np.abs(rest[other]) > 1e-5).all(1).any()
    both = outside & ~other & (shape_of >= 0)
    assert np.allclose(found[both, 0], t.min(1)[both], rtol=2e-6, atol=5e-5)
    inside = ~outside & ~other
    assert (found[inside, 0] <= 0).all() and inside.sum() > 5


@needs_sixteen
def test_8_and_16_lanes_are_the_same_bits_and_4_are_as_near_as_sse2_rounds(draw, written, monkeypatch):
    path, rays = written("mixed", SCENES["mixed"]), bundle(512, 13)
    half, narrow = (first_hits(path, rays, limit) for limit in ("avx2", "none"))
    with monkeypatch.context() as by:
        by.setattr(packets_rays, "build", sixteen)
        wide = first_hits(path, rays)
    assert np.array_equal(wide.view(np.uint32), half.view(np.uint32))
    same = wide[:, 1] == narrow[:, 1]
    assert same.mean() > 0.995
    hit = same & (wide[:, 1] >= 0) & (wide[:, 0] > 0)
    assert np.median(np.abs(wide[hit, 0] - narrow[hit, 0])) < 1e-6
    for name in ("room", "spheres40"):
        (wide, record), (half, eight), (narrow, four) = (
            draw("packets", name, "", limit=x, program=sixteen("packets") if x == "" else None)
            for x in ("", "avx2", "none")
        )
        assert [record["lanes"], eight["lanes"], four["lanes"]] == [16, 8, 4]
        for channel in wide:
            assert np.array_equal(wide[channel].view(np.uint32), half[channel].view(np.uint32)), channel
        assert (wide["id"] != narrow["id"]).mean() < 0.002
        off = np.abs(images.rgb(wide) - images.rgb(narrow)).max(axis=-1)
        assert (off > 1 / 255).mean() < 0.005 and np.median(off) < 1e-5


@pytest.mark.parametrize(
    ("name", "limit"), [*itertools.product(["room", "spheres40"], ["", "none"]), ("close", "")]
)
def test_pictures_are_truths(draw, name, limit):
    """Hits, normals and colours, mirrors, hard shadows and fog among them."""
    exact, _ = draw("truth", name)
    for words in ("", "root=newton"):
        mine, record = draw("packets", name, words, limit=limit)
        assert ("root=newton" in record["settings"]) == bool(words)
        known = exact["status"] >= 2
        assert (mine["id"] != exact["id"])[known].sum() <= 2 and known.mean() > 0.99
        hit = known & (mine["id"] == exact["id"]) & (mine["id"] >= 0)
        off = np.abs(mine["Z"][hit] - exact["Z"][hit]) / np.maximum(1, exact["Z"][hit])
        assert np.percentile(off, 99) < 3e-6
        for axis in ("N.x", "N.y", "N.z"):
            assert np.percentile(np.abs(mine[axis] - exact[axis])[hit], 99) < 1e-4
        off = np.abs(images.clamped(images.rgb(mine)) - images.clamped(images.rgb(exact))).max(axis=-1)
        whole = exact["status.all"] >= 2
        assert np.percentile(off[whole], 99) < 1e-4 and (off[whole] > 1 / 255).sum() <= 6
        assert images.non_finite(mine) == 0


def test_a_mirror_that_the_camera_is_in_is_met_again(draw):
    """As by a march, which each of its rays ends at its first step: its surface is not where they start."""
    mine, _ = draw("packets", "within")
    there, _ = draw("baseline", "within")
    assert (mine["id"] == 0).all() and np.array_equal(mine["id"], there["id"])
    off = np.abs(images.clamped(images.rgb(mine)) - images.clamped(images.rgb(there)))
    assert np.quantile(off, 0.99) < 1e-3 and images.rgb(there).max() > 0.05


@pytest.mark.parametrize("words", ["rays=together", "rays=alone"])
@pytest.mark.parametrize("limit", ["", "none"])
@pytest.mark.parametrize("name", ["oblate", "oblate_up"])
def test_cones_thousands_of_times_wider_than_high(draw, name, limit, words):
    """A quadratic whose coefficients are the slope's square had hits beside it."""
    mine, _ = draw("packets", name, words, limit=limit)
    truth, _ = draw("truth", name)
    assert np.array_equal(mine["id"], truth["id"]), f"{(mine['id'] != truth['id']).sum()} pixels"
    hit = mine["id"] == 0
    assert hit.sum() > 400 and np.allclose(mine["Z"][hit], truth["Z"][hit], atol=1e-5, rtol=0)


# --- What it refuses

# What the line names, by what has no closed form.
REFUSED = {
    "torus": scene([shape("torus")], **HARD),
    "octahedron": scene([shape("sphere"), shape("octahedron")], **HARD),
    "mandelbulb": scene([shape("mandelbulb")], **HARD),
    "repeat": scene([shape("box", repeat=[4, 0, 0])], **HARD),
    "shadows": scene([shape("sphere")], light={"shadows": "soft"}),
    "rounded box": scene([shape("box", rounding=0.1)], **HARD),
    "bounds_radius": scene([shape("sphere")], **HARD, camera={"position": [0, 0, -200]}),
}


@pytest.mark.parametrize("named", REFUSED)
def test_a_scene_without_closed_form_is_refused(named, written):
    for target in ("render", "hits"):
        command = [build("packets", target), written(named.replace(" ", "_"), REFUSED[named])]
        command += ["-n", "4"] * (target == "render")
        done = subprocess.run(command, capture_output=True, text=True, input="")
        assert done.returncode == 4 and done.stdout == "" and done.stderr.count("\n") == 1
        assert named in done.stderr
