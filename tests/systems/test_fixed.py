"""The integer ray tracer (phases fixed, fixed_simd, fixed_float): against its words in Python's integers,
against truth, one lane against many; blocks that are cleared wrongly, ranges, settings."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from conformance.feature_scenes import scene, shape
from study.core import registry, store
from study.core.build import build
from study.core.registry import ROOT
from study.pictures import images

PHASES = ("fixed", "fixed_simd", "fixed_float")
SIMD_LACKS = bool(registry.missing_isa(registry.phases()["fixed_simd"]))
needs_simd = pytest.mark.skipif(SIMD_LACKS, reason="the CPU lacks what fixed_simd needs")


def ball(radius: float, position: list[float], **more: object) -> dict:
    return shape("sphere", radius=radius, position=position, material="glossy") | more


# For 64 × 48 pixels; each small one is within a block of 16 × 16, where no corner's ray meets it.
LITTLE = scene(
    [
        *(ball(0.06, [x, y, 1]) for x in (-1.1, 1.1) for y in (-1, 0.9)),
        *(ball(0.02 * i, [0.4 - 0.7 * i, 0.3 * i, 4 * i]) for i in (1, 2)),
        ball(0.5, [0.1, 0.1, 0], material="mirror"),
        ball(2, [0, 6, -7]),
    ],
    camera={"position": [0, 0, -4], "look_at": [0, 0, 0], "vertical_fov_degrees": 30},
    light={"shadows": "hard"},
)
SIZE = (64, 48)
ROLLED = LITTLE | {"camera": LITTLE["camera"] | {"up": [1, 2, 0], "position": [1, 1, -4]}}
SCENES = {"little": LITTLE, "rolled": ROLLED}


def same(a: images.Picture, b: images.Picture) -> None:
    for channel in a:
        other = a[channel].view(np.uint32) != b[channel].view(np.uint32)
        assert not other.any(), f"{channel}: {other.sum()} pixels differ"


# --- the article's words in Python's integers, which have no range and round down


class Integers:
    """Camera rays of spheres, in integers of `bits` of fraction; for this test: nothing is shared."""

    def __init__(self, data: dict, bits: int, article: bool) -> None:
        self.bits, self.article, self.data = bits, article, data
        camera = data["camera"]
        self.eye = np.array(camera["position"], float)
        ahead = np.array(camera["look_at"], float) - self.eye
        self.ahead = ahead / np.linalg.norm(ahead)
        right = np.cross(np.array(camera["up"], float) / np.linalg.norm(camera["up"]), self.ahead)
        self.right = right / np.linalg.norm(right)
        self.up = np.cross(self.ahead, self.right)

    def number(self, value: float) -> int:
        return round(math.ldexp(float(value), self.bits))

    def mul(self, a: int, b: int) -> int:
        return a * b >> self.bits

    def dot(self, a: list[int], b: list[int]) -> int:
        return sum(x * y for x, y in zip(a, b, strict=True)) >> self.bits

    def root(self, a: int) -> int:
        """The article's, of 23 − bits whole bits; or the true root, which three steps nearly are."""
        if not self.article:
            return math.isqrt(a << self.bits)
        whole = 23 - self.bits
        x = np.float32(math.ldexp(a, -self.bits))  # what the set exponent and the subtraction come to
        u = (int(x.view(np.uint32)) >> 1) + (1 << 29) - (1 << 22)
        y = np.uint32(u).view(np.float32) + np.float32(2**whole)
        return int(y.view(np.uint32)) & 0x7FFFFF

    def unit(self, v: list[int], wide: int) -> list[int]:
        if not self.article:
            square = sum(x * x for x in v)  # of 2·bits
            return [(x << (self.bits + 40)) // math.isqrt(square << 80) for x in v]
        a = self.dot(v, v)
        cut = self.bits - (23 - wide)
        x = np.float32(math.ldexp(a >> cut if cut > 0 else a << -cut, wide - 23))
        u = 0x5F3759DF - (int(x.view(np.uint32)) >> 1)
        y = int((np.uint32(u).view(np.float32) + np.float32(2**wide)).view(np.uint32)) & 0x7FFFFF
        y = y << cut if cut > 0 else y >> -cut
        for _ in range(2):
            y = self.mul(y, (3 << (self.bits - 1)) - self.mul(self.mul(y, y), a >> 1))
        return [self.mul(x, y) for x in v]

    def picture(self, size: tuple[int, int], wide: int) -> tuple[np.ndarray, np.ndarray]:
        width, height = size
        half = math.tan(math.radians(self.data["camera"]["vertical_fov_degrees"]) / 2) / height
        finer = 30 - math.frexp(half)[1] - self.bits
        per = round(math.ldexp(half, self.bits + finer))
        frame = [[self.number(x) for x in axis] for axis in (self.ahead, self.right, self.up)]
        spheres = []
        for s in self.data["shapes"]:
            away = self.eye - s["position"]
            spheres.append(([self.number(x) for x in away], self.number(s["radius"] ** 2 - away @ away)))
        shapes, depth = np.full((height, width), -1), np.full((height, width), np.inf)
        for row in range(height):
            for column in range(width):
                x = (2 * column + 1 - width) * per >> finer
                y = (height - 1 - 2 * row) * per >> finer
                d = [f + (r * x + u * y >> self.bits) for f, r, u in zip(*frame, strict=True)]
                d = self.unit(d, wide)
                for i, (away, rest) in enumerate(spheres):
                    b = self.dot(away, d)
                    square = self.mul(b, b) + rest
                    t = math.ldexp(-b - self.root(square), -self.bits) if square > 0 else 0
                    if 0 < t < depth[row, column]:
                        shapes[row, column], depth[row, column] = i, t
        return shapes, depth


@pytest.mark.parametrize(("bits", "wide"), [(20, 11), (16, 11)])
def test_the_articles_integers_to_the_bit(draw, bits, wide):
    """Shape and t of each camera ray; `wide`: bits before the point of the scene's longest square, 1,593."""
    data = json.loads((ROOT / "common" / "scenes" / "spheres40.json").read_text())
    shapes, depth = Integers(data, bits, True).picture(SIZE, wide)
    mine, record = draw("fixed", "spheres40", f"bits={bits} clear=never roots=article")
    assert set(record["settings"].split()) == {f"bits={bits}", "unit=1", "roots=article", "clear=never"}
    assert np.array_equal(mine["id"], shapes) and (shapes >= 0).sum() > 100
    assert np.array_equal(mine["Z"], depth.astype(np.float32))


@pytest.mark.parametrize("bits", [10, 20, 26])
def test_three_steps_are_the_true_roots_but_for_last_bits(draw, bits):
    """t is −b − √d: where roots are exact but for a last bit, b is off by some of them."""
    shapes, depth = Integers(LITTLE, bits, False).picture(SIZE, 0)
    mine, _ = draw("fixed", "little", f"bits={bits} clear=never roots=3")
    both = (mine["id"] >= 0) & (mine["id"] == shapes)
    assert (mine["id"] != shapes).sum() <= 0.02 * (shapes >= 0).sum() and both.sum() > 100
    off = np.abs(mine["Z"][both] - depth[both])
    assert np.median(off) <= 8 * 2.0**-bits


# --- lanes


@needs_simd
@pytest.mark.parametrize(
    "words",
    [
        "roots=article clear=corners",
        "roots=3 clear=lists",
        "bits=28 unit=auto roots=3 clear=never",
        "bits=8 roots=2",
    ],
)
@pytest.mark.parametrize("name", ["spheres40", "little"])
def test_one_lane_eight_and_sixteen_draw_the_same_bits(draw, name, words):
    words = words if "clear" in words else f"{words} clear=safe"
    if name == "little" and "bits=8" in words:
        words = words.replace("bits=8", "bits=9")  # a radius of 0.02 is less than two of the smallest numbers
    if name == "little" and "article" in words:
        name = "two_spheres"  # squares of 0.02 are less than the article's 1/root takes
    one, record = draw("fixed", name, words, (53, 37))
    eight, other = draw("fixed_simd", name, words, (53, 37), "avx2")
    same(one, eight)
    assert (record["lanes"], other["lanes"]) == (1, 8) and record["settings"] == other["settings"]
    if registry.variant_here(registry.phases()["fixed_simd"]).lanes == 16:
        same(one, draw("fixed_simd", name, words, (53, 37))[0])


# --- blocks


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("name", ["little", "rolled"])
def test_no_block_is_cleared_wrongly_but_the_articles(draw, phase, name):
    """safe and lists: the picture without any clearing, to the bit, and blocks are cleared."""
    formats = (
        [""] if phase == "fixed_float" else ["bits=12 roots=2 ", "roots=3 ", "bits=28 unit=auto roots=4 "]
    )
    for words in formats:
        whole, _ = draw(phase, name, f"{words}clear=never")
        for clear in ("safe", "lists"):
            made, _ = draw(phase, name, f"{words}clear={clear}")
            same(
                {k: v for k, v in made.items() if k != "cleared"},
                {k: whole[k] for k in made if k != "cleared"},
            )
            if words != "bits=12 roots=2 ":  # whose directions are so coarse that nothing is safe
                assert made["cleared"].mean() > 0.1, f"{words}{clear}: nothing is cleared"
        assert not whole["cleared"].any()


@pytest.mark.parametrize("phase", PHASES)
def test_no_sphere_is_left_out_of_a_blocks_list(draw, phase):
    """Forty outlines across the edges of some hundred blocks, where coarse numbers put them too."""
    formats = ["bits=8 unit=auto roots=2 ", "bits=11 roots=1 ", "bits=14 roots=2 ", "roots=3 "]
    for words in [""] if phase == "fixed_float" else formats:
        for size in ((160, 90), (171, 101), (209, 117)):
            whole, _ = draw(phase, "spheres40", f"{words}clear=never", size)
            made, _ = draw(phase, "spheres40", f"{words}clear=lists", size)
            assert np.array_equal(made["id"], whole["id"]), f"{words}{size}"


def test_spheres_within_a_block_are_lost_by_the_articles_corners(draw):
    whole, _ = draw("fixed_simd" if not SIMD_LACKS else "fixed", "little", "roots=3 clear=never")
    made, _ = draw("fixed", "little", "roots=3 clear=corners")
    lost = (whole["id"] >= 0) & (made["id"] < 0)
    little = np.isin(whole["id"], range(4))
    assert little.sum() >= 12 and (made["id"][little] < 0).all(), "a sphere within a block is seen"
    assert not (lost & (made["cleared"] == 0)).any() and not (made["id"][~lost] != whole["id"][~lost]).any()
    blocks = made["cleared"].reshape(3, 16, 4, 16).swapaxes(1, 2)
    assert ((blocks == 0) | (blocks == 1)).all() and (np.ptp(blocks, axis=(2, 3)) == 0).all()


# --- truth


def psnr(exact: images.Picture, made: images.Picture) -> float:
    a, b = (images.clamped(images.rgb(p)).astype(float) for p in (exact, made))
    square = float(np.mean((a - b) ** 2))
    return -10 * math.log10(square) if square > 0 else math.inf


@needs_simd
@pytest.mark.parametrize(
    ("phase", "words", "least", "wrong", "off"),
    [
        ("fixed", "clear=safe", 35, 4, 0.05),
        ("fixed", "roots=3 clear=safe", 48, 3, 0.003),
        ("fixed", "bits=24 unit=auto roots=3 clear=safe", 85, 1, 3e-4),
        ("fixed", "bits=28 unit=auto roots=3 clear=lists", 110, 0, 2e-5),
        ("fixed_float", "", 80, 1, 5e-4),
    ],
)
def test_pictures_against_truth(draw, phase, words, least, wrong, off):
    """PSNR in dB, hits that are others, |Δt| of 99 %."""
    exact, _ = draw("truth", "spheres40", "", (64, 36))
    made, _ = draw(phase, "spheres40", words, (64, 36))
    assert psnr(exact, made) >= least
    assert (made["id"] != exact["id"]).sum() <= wrong
    both = (made["id"] >= 0) & (made["id"] == exact["id"])
    assert np.percentile(np.abs(made["Z"][both] - exact["Z"][both]), 99) <= off and both.sum() > 200


# --- what does not fit


@pytest.fixture
def refused(called, tmp_path):
    """What a phase says of a scene that it refuses."""

    def one(phase: str, data: dict, words: str = "") -> str:
        store.write_json(tmp_path / "scene.json", data)
        done = called(build(phase), tmp_path / "scene.json", (4, 4), words)
        assert done.returncode == 4 and done.stdout == "" and done.stderr.count("\n") == 1, done.stderr
        return done.stderr

    return one


ONE = [ball(1, [0, 0, 0])]
HARD, NONE = {"shadows": "hard"}, {"shadows": "none"}
# What has no closed form here, by what the line names.
NO_FORM = {
    "soft shadows": scene(ONE, light={"shadows": "soft"}),
    "fog": scene(ONE, fog=0.1, light=HARD),
    "shapes[1]": scene([*ONE, shape("torus")], light=HARD),
    "repeated": scene([ball(1, [0, 0, 0], repeat=[4, 0, 0])], light=HARD),
    "shininess": scene([shape("sphere", material="blue")], light=NONE),
    "camera": scene([ball(9, [0, 0, 0])], light=NONE),
    "bounds_radius 5": scene(ONE, light=HARD) | {"shapes": [ball(1, [0, 0, 4.5])]},
}
NO_FORM["bounds_radius 5"]["march"] = NO_FORM["bounds_radius 5"]["march"] | {"bounds_radius": 5}


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("named", NO_FORM)
def test_a_scene_without_closed_form_is_refused(phase, named, refused):
    assert named in refused(phase, NO_FORM[named])


# What leaves the range of the numbers, by the figure that the line names.
UNFIT = {
    "3001": ({"light": {"position": [0, 3000, 0]}}, "roots=3"),
    "5000": ({"camera": {"position": [0, 0, -5000]}}, "roots=3"),
    "emission": ({"light": {"emission": [1, 4000, 1]}}, "roots=3"),
    "5001": ({"march": {"surface_offset": 5000}}, "roots=3"),
    "0.0039": ({"light": {"position": [0, 1.1, 0]}}, "bits=8 roots=3"),
    "1e-06": ({"shapes": [ball(1e-6, [0, 0, 0])]}, "roots=3"),
    "radius of 3": ({"shapes": [ball(3, [0, 0, 0])]}, "roots=article"),
    "23 bits": ({}, "bits=28 unit=auto roots=article"),
}


@pytest.mark.parametrize("named", UNFIT)
def test_a_number_that_does_not_fit_is_named(named, refused):
    changes, words = UNFIT[named]
    data = scene(ONE, light=HARD, march={"bounds_radius": 1e5})
    for key, value in changes.items():
        data = data | {key: data[key] | value if isinstance(value, dict) else value}
    for phase in PHASES[: 1 if SIMD_LACKS else 2]:
        assert named in refused(phase, data, words)


# As bright as numbers of 24 bits hold, less than 126, a quarter away; in a ball; on one, of no strength.
LIGHTS = {
    "near": ([*ONE, ball(1, [3, 0, 1])], {"position": [0.1, 0.27, -1.22], "emission": [31, 25, 31]}),
    "inside": ([*ONE, ball(1, [3, 0, 1])], {"position": [0, 0.3, 0]}),
    "off": ([*ONE, ball(1, [3, 0, 1])], {"position": [0, 1, 0], "emission": [0, 0, 0]}),
}
SCENES |= {
    f"light_{name}": scene(shapes, light={"shadows": "hard"} | light)
    for name, (shapes, light) in LIGHTS.items()
}


@pytest.mark.parametrize("name", LIGHTS)
def test_a_light_that_fits_is_drawn_as_truth_has_it(draw, name):
    """Colours that are not clamped, too: nothing on the way to them was."""
    exact, _ = draw("truth", f"light_{name}")
    for phase in PHASES[: 1 if SIMD_LACKS else 2]:
        made, _ = draw(phase, f"light_{name}", "bits=24 unit=auto roots=3 clear=never")
        hit = (made["id"] >= 0) & (made["id"] == exact["id"])
        assert hit.sum() > 100
        off = np.abs(images.rgb(made) - images.rgb(exact))[hit].max(axis=-1)
        assert np.quantile(off, 0.99) < 2e-2 and off.mean() < 2e-3, (np.quantile(off, 0.99), off.mean())
    assert name != "near" or images.rgb(exact).max() > 20


# A sphere in the middle of a wide view: lengths below 2, but directions to the corners of almost 3.
WIDE = scene(
    [ball(0.3, [0, 0, 0])],
    camera={"position": [0, 0, -1.5], "look_at": [0, 0, 0], "vertical_fov_degrees": 100},
    light={"position": [0, 1.4, 0], "shadows": "hard"},
    march={"bounds_radius": 100},
)
SCENES["wide"] = WIDE


@pytest.mark.parametrize("words", ["roots=article clear=never", "roots=3 clear=never"])
def test_directions_longer_than_all_lengths_are_normalised_too(draw, words):
    """A ray whose tangent off the axis is below that of the sphere's rim, 0.204, hits it; others miss."""
    made, _ = draw("fixed", "wide", words, (32, 18))
    half = math.tan(math.radians(50)) / 18
    x, y = np.meshgrid((2 * np.arange(32) - 31) * half, (2 * np.arange(18) - 17) * half)
    rim = math.tan(math.asin(0.3 / 1.5))
    assert np.array_equal(made["id"] >= 0, np.hypot(x, y) < rim) and (made["id"] >= 0).sum() == 4


# Pixels up to 280 units off the camera's axis, a unit away: no factor with 28 bits of fraction is that large.
SCENES["broad"] = WIDE | {"shapes": [ball(1, [x, 0, 0.1 * x]) for x in (-6, -3, 0, 3, 6)]}
SCENES["broad"]["camera"] = WIDE["camera"] | {"vertical_fov_degrees": 160}
SCENES["broad"]["light"] = WIDE["light"] | {"emission": [3, 3, 2.4]}  # 0.4 from a surface, with 28 bits
# In a unit of 512 a light that is 3 away is 1/171 of it away, and 171 is no factor with 28 bits of fraction.
SCENES["spacious"] = LITTLE | {"shapes": [*LITTLE["shapes"], ball(500, [0, -503, 0])]}
SCENES["spacious"]["march"] = LITTLE["march"] | {"bounds_radius": 2000}
SCENES["spacious"]["light"] = LITTLE["light"] | {"position": [2, 2, -3]}


@needs_simd
@pytest.mark.parametrize("bits", [24, 28])
@pytest.mark.parametrize(("name", "size"), [("broad", (200, 4)), ("spacious", SIZE)])
def test_no_factor_leaves_its_32_bits(draw, name, size, bits):
    """All hits and colours of what the ranges let pass are truth's."""
    exact, _ = draw("truth", name, size=size)
    for phase in PHASES[:2]:
        made, _ = draw(phase, name, f"bits={bits} unit=auto roots=3 clear=never", size)
        assert (made["id"] != exact["id"]).sum() <= 2  # a small ball's square is a few last bits
        hit = (made["id"] >= 0) & (exact["id"] >= 0)
        assert hit.sum() > 10 and np.allclose(made["Z"][hit], exact["Z"][hit], rtol=0, atol=1e-2)
        off = np.abs(images.clamped(images.rgb(made)) - images.clamped(images.rgb(exact)))
        assert np.quantile(off, 0.99) < 2e-3 and off.mean() < 1e-4


# Where a path leads it is at no frame's beginning but at 0.5 s: frame 30.
LED = {
    "line": ([0, 0, 3], {"type": "line", "to": [0, 0, -5], "period": 1}),
    "circle": ([0, 0, 5], {"type": "circle", "centre": [0, 0, 0], "axis": [0, 1, 0], "period": 1}),
}


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("name", LED)
def test_a_path_through_the_camera_is_refused(phase, name, refused, called, tmp_path):
    position, path = LED[name]
    data = scene([ball(1, position, path=path)], light=HARD, march={"bounds_radius": 100})
    data["camera"] |= {"position": [0, 0, -5], "look_at": [0, 0, 0]}
    words = "" if phase == "fixed_float" else "roots=3"
    assert "shapes[0]" in refused(phase, data, words)
    data["camera"]["position"] = [0, 3, -5]
    store.write_json(tmp_path / "scene.json", data)
    more = ("--frames", 31, "--first-frame", 30)
    done = called(build(phase), tmp_path / "scene.json", (4, 4), words, *more)
    assert done.returncode == 0, done.stderr
