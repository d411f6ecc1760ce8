"""How cost grows: power laws and coverages whose answer is known, the budget, errors, goals, bad input."""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import json
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import MappingProxyType

import complete
import emitted
import matplotlib
import numpy as np
import pytest
import started

from study.core import cli, registry, run
from study.core import generated_scenes as scaling_scenes
from study.core.cli import StudyError
from study.core.registry import ROOT, Scene, Spec
from study.core.run import DriverError
from study.experiments.scaling import command, series
from study.experiments.scaling import errors as scaling_errors
from study.experiments.scaling import figures as scaling_page
from study.experiments.scaling import goals as scaling_goals
from study.experiments.scaling import measure as scaling
from study.experiments.scaling import tables as scaling_tables
from study.experiments.scaling.experiment import SECONDS
from study.experiments.scaling.measure import First
from study.experiments.scaling.series import Picture, Point
from study.experiments.section import part
from study.numbers import power_laws as scaling_fit
from study.numbers.stats import Interval
from study.pictures.draw import STYLE, save

SCRIPT = (ROOT / "scripts" / "stepwise", "scaling")
OPT4, BASE = Spec("opt4", "opt4"), Spec("baseline", "baseline")


def noisy(xs: list[float], exponent: float, seed: int, launches: int = 12, noise: float = 0.03) -> list:
    random = np.random.default_rng(seed)
    return [2.5 * x**exponent * np.exp(noise * random.standard_normal(launches)) for x in xs]


# The fit.


@pytest.mark.parametrize("exponent", [-1.0, 0.0, 0.5, 1.0, 2.0])
def test_a_law_without_noise_is_found_exactly(exponent: float) -> None:
    xs = [100, 200, 400, 1600]
    found = scaling_fit.fit(xs, [[7 * x**exponent] * 6 for x in xs])
    assert found.exponent.value == pytest.approx(exponent, abs=1e-12)
    assert found.factor == pytest.approx(7, rel=1e-9) and found.worst == pytest.approx(1)
    assert (found.exponent.low, found.exponent.high) == (pytest.approx(exponent), pytest.approx(exponent))
    assert found.holds is True and found.off == []


def test_the_order_of_the_points_does_not_matter() -> None:
    xs, values = [1, 4, 16, 64], noisy([1, 4, 16, 64], 0.8, 1)
    turned = scaling_fit.fit(xs[::-1], values[::-1])
    straight = scaling_fit.fit(xs, values)
    assert turned.exponent.value == pytest.approx(straight.exponent.value, abs=1e-12)
    assert (turned.first_x, turned.last_x) == (1, 64)
    assert turned.last.value == pytest.approx(straight.last.value, abs=1e-12)


def test_the_interval_holds_the_true_exponent_about_as_often_as_it_says(monkeypatch) -> None:
    monkeypatch.setattr(scaling_fit, "RESAMPLES", 1000)
    xs = [1, 4, 16, 64, 256]
    held, widths = 0, []
    for seed in range(200):
        law = scaling_fit.fit(xs, noisy(xs, 1.3, seed), seed=seed).exponent
        held += law.low <= 1.3 <= law.high
        widths.append(law.high - law.low)
    assert 0.88 <= held / 200 <= 0.995  # of 95 %, which medians of twelve just miss
    # Of a least-squares slope through medians: 2·1.96·σ·√(π/2)/√launches/√Σ(x−x̄)², x = log 4^i.
    spread = math.sqrt(math.pi / 2) * 0.03 / math.sqrt(12) / math.sqrt(10 * math.log(4) ** 2)
    assert np.median(widths) == pytest.approx(2 * 1.96 * spread, rel=0.25)


def test_a_constant_below_a_law_is_no_power_law_and_the_places_are_said() -> None:
    xs = [1, 4, 16, 64, 256, 1024]
    found = scaling_fit.fit(xs, [[x + 20] * 6 for x in xs])
    assert found.holds is False and {1, 16} <= set(found.off)
    assert found.first.value == pytest.approx(math.log(24 / 21) / math.log(4))
    assert found.last.value == pytest.approx(math.log(1044 / 276) / math.log(4))
    slope, height = np.polyfit(np.log(xs), np.log(np.add(xs, 20)), 1)  # another least squares
    assert (found.exponent.value, found.factor) == (pytest.approx(slope), pytest.approx(math.exp(height)))
    residuals = np.exp(np.log(np.add(xs, 20)) - (slope * np.log(xs) + height))
    farthest = int(np.abs(np.log(residuals)).argmax())
    assert found.worst == pytest.approx(residuals[farthest]) and found.worst_x == xs[farthest]


def test_noise_alone_breaks_no_law() -> None:
    xs = [1, 4, 16, 64]
    values = [[x * f for f in (0.7, 0.8, 0.95, 1.05, 1.2, 1.4)] for x in xs]
    values[2] = [
        16 * f for f in (0.7, 0.75, 0.8, 1.6, 1.7, 1.8)
    ]  # its median is 20 % up, its interval is not
    assert scaling_fit.fit(xs, values).holds is True


def test_too_few_launches_have_no_interval_and_two_points_no_verdict() -> None:
    few = scaling_fit.fit([1, 2, 4], [[1] * 5, [2] * 6, [4] * 6])
    assert math.isnan(few.exponent.low) and "insufficient" in scaling_fit.text(few.exponent)
    assert "insufficient" in scaling_fit.text(cli.plain(few)["exponent"])  # as it comes back from the file
    assert scaling_fit.fit([1, 2], [[1] * 6, [2] * 6]).holds is None


@pytest.mark.parametrize(
    ("xs", "samples"),
    [
        ([1], [[1.0]]),
        ([1, 1], [[1.0], [2.0]]),
        ([1, 2], [[1.0], [0.0]]),
        ([1, 2], [[1.0], [math.nan]]),
        ([1, 2], [[1.0], []]),
        ([0, 2], [[1.0], [1.0]]),
        ([1, 2, 3], [[1.0], [2.0]]),
    ],
)
def test_what_no_law_goes_through_is_refused(xs: list, samples: list) -> None:
    with pytest.raises(StudyError, match="a power law is fitted through"):
        scaling_fit.fit(xs, samples)


# The scenes.


def hits(scene: dict, width: int, height: int) -> np.ndarray:
    """Which camera rays meet a shape, by each shape's own equations: quadratic, slabs, eight half-spaces."""
    half = math.tan(math.radians(scene["camera"]["vertical_fov_degrees"]) / 2)
    i, j = np.meshgrid(np.arange(width), np.arange(height))
    x = (2 * (i + 0.5) / width - 1) * width / height * half
    y = (1 - 2 * (j + 0.5) / height) * half
    d = np.stack([x, y, np.ones_like(x)], -1).reshape(-1, 3)
    found = np.zeros(len(d), bool)
    for shape in scene["shapes"]:
        o = -np.array(shape["position"])
        if shape["type"] == "sphere":
            a, b, c = (d * d).sum(1), d @ o, o @ o - shape["radius"] ** 2
            found |= b * b - a * c >= 0
            continue
        if shape["type"] == "box":
            normals = np.eye(3)
            bounds = np.array(shape["half_size"])
        else:
            normals = np.array([(1, s, t) for s in (1, -1) for t in (1, -1)], float)
            bounds = np.full(4, shape["radius"])
        along, start = d @ normals.T, normals @ o
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = (-bounds - start) / along, (bounds - start) / along
        near, far = np.fmin(one, other).max(1), np.fmax(one, other).min(1)
        found |= (near <= far) & (far > 0)
    return found


@pytest.mark.parametrize("arrangement", scaling_scenes.ARRANGEMENTS)
@pytest.mark.parametrize("count", [1, 16, 150])
def test_the_share_of_rays_that_hit_is_the_stated_one(arrangement: str, count: int) -> None:
    scene = scaling_scenes.data(arrangement, count, seed=3)
    assert len(scene["shapes"]) == count
    # A lattice has rays of equal gauge, so that the share can leap by a few of them.
    assert hits(scene, *scaling_scenes.RAYS).mean() == pytest.approx(scaling_scenes.COVERAGE, abs=0.005)
    # Of a picture of another size: its own sampling of the outlines.
    assert hits(scene, 213, 120).mean() == pytest.approx(scaling_scenes.COVERAGE, abs=0.015)


def test_the_factor_lies_between_rays_and_not_on_one() -> None:
    assert scaling_scenes.quantile(np.array([1.0, 4, 2, 3]), 0.5) == 2.5
    assert scaling_scenes.quantile(np.array([1, 2, 2, 2 + 1e-9, 5.0]), 0.6) == pytest.approx(3.5)
    assert scaling_scenes.quantile(np.array([1, 2, 2, 2, 5.0]), 0.3) == 1.5


def test_a_rendered_scene_covers_what_it_should(tmp_path: Path) -> None:
    from study.pictures import images

    scene = scaling_scenes.of_shapes("clustered", 60, 1, tmp_path)
    run.render("baseline", scene.path, 45, 80, aov=True, out=tmp_path / "a.exr")
    made = images.read(tmp_path / "a.exr")["id"] >= 0
    assert (made != hits(scene.data, 80, 45).reshape(45, 80)).mean() < 0.002


def test_the_camera_is_outside_every_shape() -> None:
    for arrangement, count, seed in itertools.product(scaling_scenes.ARRANGEMENTS, (1, 4, 40), (1, 2)):
        scene = scaling_scenes.data(arrangement, count, seed)
        for shape in scene["shapes"]:
            around = scaling_scenes.AROUND[shape["type"]] / scaling_scenes.SIZES[shape["type"]]
            reach = around * (shape.get("radius") or shape["half_size"][0])
            assert np.linalg.norm(shape["position"]) > reach


def test_scenes_are_made_by_their_seed_alone(tmp_path: Path) -> None:
    one, same, other = (scaling_scenes.data("scattered", 20, seed) for seed in (1, 1, 2))
    assert one == same and one != other
    first = scaling_scenes.of_shapes("scattered", 20, 1, tmp_path)
    assert first.data == one and json.loads(first.path.read_text()) == one
    stamp = first.path.stat().st_mtime_ns
    assert scaling_scenes.of_shapes("scattered", 20, 1, tmp_path).path.stat().st_mtime_ns == stamp


@pytest.mark.slow
def test_the_driver_takes_the_largest_scene_and_there_is_no_larger(tmp_path: Path) -> None:
    scene = scaling_scenes.of_shapes("corridors", scaling_scenes.MOST_SHAPES, 1, tmp_path)
    assert len(scene.data["shapes"]) == 4096
    assert run.render("baseline", scene.path, 1, 1, max_steps=1)["frames"]
    for count in (0, 4097):
        with pytest.raises(StudyError, match="a scene has 1 to 4096"):
            scaling_scenes.of_shapes("scattered", count, 1, tmp_path)
    with pytest.raises(StudyError, match="no arrangement 'strewn'; there are scattered"):
        scaling_scenes.of_shapes("strewn", 4, 1, tmp_path)


def test_nearly_every_ray_of_the_hall_is_mirrored_as_often_as_it_may_be() -> None:
    """By unfolding: mirror k is met at x = ±2 after (2 + 4k)/|dx| of the way, inside the bounds."""
    scene = scaling_scenes.hall(16)
    aim = np.array(scene["camera"]["look_at"])
    half = math.tan(math.radians(scene["camera"]["vertical_fov_degrees"]) / 2)
    right = np.cross([0, 1, 0], aim)
    u, v = np.meshgrid(np.linspace(-1, 1, 81) * half * 16 / 9, np.linspace(-1, 1, 45) * half)
    d = aim + u[..., None] * right + v[..., None] * np.array([0, 1, 0])
    s = (2 + 4 * 16) / np.abs(d[..., 0])  # the way to the seventeenth wall, of which the first is no bounce
    inside = np.hypot(s * d[..., 1], s * d[..., 2]) < scene["march"]["bounds_radius"]
    assert scene["march"]["max_bounces"] == 16 and inside.mean() > 0.9


# The budget.


def line(xs: tuple[int, ...] = (1, 4, 16, 64), grows: float = 1) -> series.Series:
    return series.Series("shapes-x", "t", "x", xs, grows, 1, 90, lambda x: None)  # type: ignore[arg-type]


def test_points_are_taken_from_the_cheapest_on_while_the_time_lasts() -> None:
    asked = []

    def first(point: Point) -> First:
        asked.append((str(point.spec), point.x))
        return First((1.0 if point.spec == BASE else 0.3) * point.x, 0, None)

    plan = scaling.choose(line(), [BASE, OPT4], 40.0, 6, first)
    # Six launches: 6.4 s of baseline at 1; 2.2 s and 7.6 s of opt4 at 1 and 4. The next take 28 s and 34 s.
    assert asked == [("baseline", 1), ("opt4", 1), ("opt4", 4)]
    assert plan.spent <= 40 and {p.x for p in plan.taken if p.spec == OPT4} == {1, 4}
    missing = {(row["phase"], row["x"]) for row in plan.left_out}
    assert missing == {("baseline", 4), ("baseline", 16), ("baseline", 64), ("opt4", 16), ("opt4", 64)}
    guesses = {(r["phase"], r["x"]): r["foreseen_s"] for r in plan.left_out}
    assert guesses["opt4", 16] == pytest.approx(4.8) and guesses["baseline", 4] == pytest.approx(4)
    assert all(row["reason"] for row in plan.left_out)


def test_every_program_has_three_points_before_any_has_a_fourth() -> None:
    asked = []

    def first(point: Point) -> First:
        asked.append(point.spec)
        return First(2.0 if point.spec == BASE else 0.01, 0, None)

    plan = scaling.choose(line((1, 2, 3, 4, 5, 6), 0), [BASE, OPT4], 75.0, 6, first)
    # Three of baseline take 3 · 12.6 s, under 0.6 of 75 s; two more fit, a sixth and its first frame not.
    assert asked[:6].count(BASE) == 3 and sum(p.spec == OPT4 for p in plan.taken) == 6
    assert sum(p.spec == BASE for p in plan.taken) == 5


def test_with_time_for_all_nothing_is_left_out() -> None:
    plan = scaling.choose(line(), [BASE, OPT4], 1e9, 6, lambda p: First(0.001 * p.x, 0, None))
    assert len(plan.taken) == 8 and not plan.left_out


def test_a_refused_point_is_left_out_alone() -> None:
    def first(point: Point) -> First:
        if point.spec == BASE and point.x == 4:
            raise DriverError(4, "too many shapes")
        return First(0.001, 0, None)

    plan = scaling.choose(line(), [BASE, OPT4], 1e9, 6, first)
    assert [(r["phase"], r["x"], r["reason"]) for r in plan.left_out] == [("baseline", 4, "too many shapes")]
    assert sum(p.spec == OPT4 for p in plan.taken) == 4
    assert [p.x for p in plan.taken if p.spec == BASE] == [1, 16, 64]


@pytest.mark.parametrize(
    ("status", "said"),
    [(-9, "killed by SIGKILL (as the kernel does where memory is short)"), (5, "out of memory")],
)
def test_what_had_no_memory_is_not_asked_for_more(status: int, said: str) -> None:
    """As 16, 1, 4, 64 with 16 and more too large: what is smaller is asked, what is larger says why not."""
    asked = []

    def first(point: Point) -> First:
        asked.append((str(point.spec), point.x))
        if point.spec == BASE and point.x >= 16:
            raise DriverError(status, said.partition(" (")[0])
        return First(0.001, 0, None)

    some = dataclasses.replace(line(), first=(16, 1, 4))
    plan = scaling.choose(some, [BASE, OPT4], 1e9, 6, first)
    assert ("baseline", 64) not in asked and asked.count(("baseline", 16)) == 1
    assert {p.x for p in plan.taken if p.spec == BASE} == {1, 4}
    assert sum(p.spec == OPT4 for p in plan.taken) == 4
    assert [(r["phase"], r["x"], r["reason"]) for r in plan.left_out] == [
        ("baseline", 16, said),
        ("baseline", 64, "beyond a point that memory did not suffice for"),
    ]


def test_a_large_point_that_is_asked_first_and_refused_drops_no_smaller_one() -> None:
    """As 4,096 of 16, 4,096, 256: each x is taken or left out, and what the refusal took is of the time."""

    def first(point: Point) -> First:
        if point.x == 64:
            time.sleep(0.05)
            raise DriverError(4, "too many shapes")
        return First(0.001, 0, None)

    some = dataclasses.replace(line(), first=(64, 1, 16))
    plan = scaling.choose(some, [OPT4], 1e9, 6, first)
    assert {p.x for p in plan.taken} == {1, 4, 16} and [r["x"] for r in plan.left_out] == [64]
    assert plan.spent >= 0.05 + 3 * scaling.cost(0.001, 6, line())


def test_a_frame_is_foreseen_from_those_before_never_flatter_than_the_series() -> None:
    assert series.foreseen(None, (4, 2.0), 16, 1) == pytest.approx(8)
    assert series.foreseen((1, 1.0), (4, 8.0), 16, 1) == pytest.approx(64)  # x^1.5 seen
    assert series.foreseen((1, 1.0), (4, 1.0), 16, 1) == pytest.approx(4)  # flat so far: x^1 all the same
    assert series.foreseen((1, 1.0), (4, 4.0**5), 16, 1) == pytest.approx(4.0**5 * 16)  # at most one more


@pytest.mark.parametrize(
    ("trail", "x", "expected"),
    [
        ([], 4, 0.0),
        ([(16, 2.0), (4, 1.0)], 64, 8.0),  # x^0.5 seen, x^1 foreseen
        ([(16, 2.0), (4, 1.0)], 8, math.sqrt(2)),
        ([(16, 2.0), (4, 1.0)], 1, 1.0),
    ],
)
def test_a_frame_is_guessed_from_points_in_any_order(trail: list, x: int, expected: float) -> None:
    assert series.guessed(trail, x, 1) == pytest.approx(expected)


class Pretended:
    """A machine whose launches take what a model says, by a clock that they alone move: a wide CPU with the
    published times a pixel, a slow start of processes, a second and a half for a new kernel."""

    LAUNCH, KERNEL = 0.1, 1.5  # s
    NS = MappingProxyType(
        {"scene0": (25e3, 26, 13, 12), "mandelbulb": (27e3, 450, 330, 320), "mirrors": (9e3, 90, 60, 60)}
    )
    SHAPE = (9e3, 12.0, 3.0, 2.0)  # ns a pixel of one shape, growing as their number, and as its root

    def __init__(self) -> None:
        self.now, self.kernels = 0.0, set()

    def seconds(self, point: Point, picture: Picture) -> float:
        rung = ["baseline", "opt8_streams", "opt9_convex", "opt10_scene"].index(str(point.spec))
        if picture.scene in self.NS:
            ns = self.NS[picture.scene][rung]
        elif point.series == "bounces":
            ns = self.NS["mirrors"][rung] * point.x
        else:
            count = picture.scene.split("-")[1]
            ns = self.SHAPE[rung] * int(count) ** (1 if rung == 0 else 0.55)
        return ns * 1e-9 * picture.width * picture.height / picture.threads + 3e-6 * point.x * (rung > 0)

    def prepare(self, point: Point, picture: Picture) -> None:
        crowd = point.series.startswith(("shapes", "crowd")) and int(picture.scene.split("-")[1]) >= 32
        if str(point.spec) == "opt10_scene" and picture.scene not in self.kernels and not crowd:
            self.kernels.add(picture.scene)
            self.now += self.KERNEL

    def first(self, point: Point, picture: Picture, *_: object) -> First:
        self.prepare(point, picture)
        seconds = self.seconds(point, picture)
        self.now += seconds + self.LAUNCH
        return First(seconds, 2.0, None)

    def measure(self, of: series.Series, points: dict, pictures: dict, settings: scaling.Settings) -> dict:
        found: dict[Point, list[float]] = {point: [] for point in points}
        kernels = set(self.kernels)
        for point in points:
            for number in range(settings.launches):
                picture = of.picture(point.x, number) if of.drawn else pictures[point.x]
                self.prepare(point, picture)
                seconds = self.seconds(point, picture)
                self.now += sum(scaling.frames_in(of, seconds)) * seconds + self.LAUNCH
                found[point].append(seconds * 1e9)
        assert self.kernels == kernels  # compiled before anything was timed
        return found


def named(arrangement: str, count: int, seed: int, folder: Path) -> Scene:
    """A scene of that name, if there is one; where its shapes cover what they should is not looked for."""
    scaling_scenes.placed(arrangement, count, seed)
    return dataclasses.replace(registry.find_scene("trio"), name=f"{arrangement}-{count}-seed{seed}")


def named_by_path(arrangement: str, count: int, seed: int, folder: Path) -> Scene:
    made = named(arrangement, count, seed, folder)
    return dataclasses.replace(made, path=folder / made.name)


def studied(monkeypatch, tmp_path: Path, seconds: float, names: list[str]) -> tuple[dict, Pretended]:
    """What `scripts/stepwise scaling` would measure on the pretended machine, nothing being run."""
    machine = Pretended()
    monkeypatch.setattr(scaling, "render", machine.first)
    monkeypatch.setattr(scaling, "measure", machine.measure)
    monkeypatch.setattr(scaling.time, "monotonic", lambda: machine.now)
    monkeypatch.setattr(scaling_scenes, "of_shapes", named)
    monkeypatch.setattr(scaling_goals, "memory", lambda *_: ([], []))
    monkeypatch.setattr(run, "USABLE", [0, 1])
    about = {"phase": names, "series": None, "n": 90, "scene_seed": 1, "budget": seconds, "seed": 1}
    args = argparse.Namespace(**about, launches=6, cpu=0)
    monkeypatch.setattr(command, "programs", lambda names: ([Spec.parse(name) for name in names], []))
    return command.measured(args, tmp_path), machine


def test_the_studys_seconds_go_to_what_is_judged_first(monkeypatch, tmp_path: Path) -> None:
    names = ["baseline", "opt9_convex", "opt10_scene"]
    found, machine = studied(monkeypatch, tmp_path, float(SECONDS), names)
    points: dict[tuple[str, str], set[int]] = {}
    for one in found["rows"]:
        points.setdefault((one["series"], one["phase"]), set()).add(one["x"])
    known = series.series(90, 1, tmp_path)
    assert points["crowd", "opt10_scene"] == points["crowd", "opt9_convex"] == {16, 4096}
    assert points["threads", "opt10_scene"] == points["threads", "opt9_convex"] == {1, 2}
    assert {16, 4096} <= points["shapes-scattered", "opt10_scene"]
    for name, one in known.items():
        wanted = set(one.xs) if len(one.xs) < 3 else set(one.first)
        assert wanted <= points[name, "opt10_scene"], name
    verdicts = {row["phase"]: row["shapes_goal"] for row in found["goals"]}
    assert verdicts["opt10_scene"] in ("met", "missed", "cannot be told apart here")
    assert verdicts["baseline"] == "not measured"
    fits = [row for row in found["fits"] if row["phase"] == "opt10_scene" and row["series"] != "threads"]
    assert len(fits) == len(known) - 2 and all(row["time"]["points"] >= 3 for row in fits)
    assert machine.now <= 1.1 * float(SECONDS)
    said = scaling_page.without(found)
    assert said and "n-scene0: baseline" in said


def test_with_hours_every_point_is_taken(monkeypatch, tmp_path: Path) -> None:
    newest = list(registry.ladder())[-scaling.FAST :][:2]
    found, _ = studied(monkeypatch, tmp_path, 1e9, ["baseline", *newest])
    # Of the goal's own size only the newest rungs.
    assert not found["left_out"] and scaling_page.without(found) is None
    assert {row["phase"] for row in found["rows"] if row["series"] == "crowd"} == set(newest)


def test_the_newest_rungs_have_all_their_points_before_the_others_have_any() -> None:
    new, asked = Spec.parse("opt9_convex"), []

    def first(point: Point) -> First:
        asked.append((str(point.spec), point.x))
        return First(0.001, 0, None)

    scaling.choose(line((1, 4, 16, 64)), [BASE, new, OPT4], 1e9, 6, first)
    assert [name for name, _ in asked[:4]] == ["opt9_convex"] * 4 and len(asked) == 12


def test_a_point_that_proves_too_long_is_left_out_and_the_rest_goes_on() -> None:
    slow = {1: 0.001, 4: 3.0, 16: 0.002, 64: 0.002}
    plan = scaling.choose(line(), [OPT4], 10.0, 6, lambda p: First(slow[p.x], 0, None))
    assert [point.x for point in plan.taken] == [1] and plan.spent <= 10
    assert [row["x"] for row in plan.left_out] == [4, 16, 64]


def test_closed_forms_have_no_evaluations_of_a_ray(monkeypatch) -> None:
    planes = {name: np.ones((4, 6), np.float32) for name in ("R", "G", "B", "evals", "id")}
    monkeypatch.setattr(scaling_errors.images, "read", lambda path: planes)
    assert scaling_errors.seen(Path("a.exr"), closed=True)["evals_per_ray"] is None
    assert scaling_errors.seen(Path("a.exr"))["evals_per_ray"] == 1


def test_threads_are_powers_of_two_and_all() -> None:
    assert [series.thread_counts(n) for n in (1, 2, 6, 8)] == [(1,), (1, 2), (1, 2, 4, 6), (1, 2, 4, 8)]


# Errors, goals, pictures.


def test_errors_to_a_picture_are_those_known_by_hand(blank, miss) -> None:
    reference, made = blank(10, 10, 0.5), blank(10, 10, 0.6)
    miss(made, (0, 0))
    for name in "RGB":
        made[name][0, 0] = 0.6
    found = scaling_errors.against(reference, made, exact=False)
    assert found["psnr_db"] == pytest.approx(20, abs=1e-4) and found["wrong_ppm"] == pytest.approx(10_000)


def test_errors_to_truth_count_proved_pixels_and_known_colours(blank, miss) -> None:
    exact, made = blank(10, 10, 0.5), blank(10, 10, 0.5)
    for prefix, name in itertools.product(("ideal.", "none."), "RGB"):
        exact[prefix + name] = exact[name].copy()
    for name, value in (("shadow", 1), ("status", 2), ("status.all", 2)):
        exact[name] = np.full((10, 10), value, np.float32)
    miss(made, (slice(0, 2), 0))  # two wrong pixels, of which truth has proved one
    for name in "RGB":
        made[name][0, 0] = made[name][1, 0] = 0.5
    exact["status"][0, 0] = exact["status.all"][0, 0] = 0
    exact["R"][0, 0] = np.nan
    found = scaling_errors.against(exact, made, exact=True)
    assert found["wrong_ppm"] == pytest.approx(1e6 / 99) and found["psnr_db"] == math.inf


def test_without_truth_the_first_double_program_stands_for_it() -> None:
    points = [Point("s", 1, Spec(name, name)) for name in ("opt4", "opt3", "opt2")]
    assert scaling_errors.finest(points).spec.phase == "opt3"
    assert scaling_errors.finest(points[:1]).spec.phase == "opt4"


def test_peak_memory_is_the_renders_own_and_the_frame_is_taken_off(tmp_path: Path) -> None:
    scene = ROOT / "common" / "scenes" / "two_spheres.json"
    small, large = (
        run.render("baseline", scene, height, height, max_steps=1)["frames"][0]["max_rss_kib"]
        for height in (16, 1024)
    )
    held = np.ones(8 << 20)  # 64 MiB of this process, which are none of the render's
    status = Path("/proc/self/status").read_text().split("VmHWM:")[1]
    assert held.nbytes == 64 << 20 and int(status.split()[0]) > 65536 > 20_000 > small > 0
    assert large - small == pytest.approx(12 * 1024, rel=0.1)  # KiB: 12 bytes a pixel of 1024 × 1024
    picture = Picture("two_spheres", scene, 1024, 1024)
    assert scaling.above_frame(large, picture) == pytest.approx(small / 1024, abs=1.5)
    assert scaling.above_frame(12 * 1024, picture) == 0
    untold = scaling.above_frame(0, picture)
    assert (
        math.isnan(untold)
        and scaling_goals.under({("scene0", 1): 2.0, ("scene0", 2): untold}) == "not measured"
    )


def row(phase: str, x: int, ns: float, name: str = "shapes-scattered", **more: object) -> dict:
    return {
        **{"series": name, "phase": phase, "x": x, "n": 90, "width": 160, "threads": 1, "max_steps": None},
        **{"scene": "s", "ns": [ns] * 6, "ms": Interval(ns / 1e6, ns / 1e6, ns / 1e6, 6, True)},
        **{"ns_per_pixel": Interval(ns, ns, ns, 6, True), "coverage": 0.4, "above_frame_mib": 2.0},
        **{"evals_per_ray": 10.0 * x, "non_finite": 0, "psnr_db": 60.0, "rmse": 0.001, "reference": "truth"},
        **{"wrong_ppm": 0.0},
        **more,
    }


def test_the_goals_are_judged_at_their_size_only() -> None:
    rows = [row("a", 16, 100), row("a", 4096, 399), row("b", 16, 100), row("b", 4096, 401), row("c", 16, 9)]
    rows = [one | {"n": 720} for one in [*rows, row("c", 1024, 9), row("d", 16, 1)]]
    small = scaling_goals.goals([row("a", 16, 100), row("a", 4096, 399)], [], ["a"])  # n = 90
    assert small[0]["shapes_goal"] == "not measured" and small[0]["ratio"].value == pytest.approx(3.99)
    memory = [
        {"phase": phase, "scene": scene, "threads": 1, "above_frame_mib": mib}
        for phase, scene, mib in (
            *(("a", "scene0", 2.0), ("a", "mandelbulb", 3.0), ("a", "scattered", 63.9)),
            *(("b", "scene0", 64.0), ("b", "mandelbulb", 1.0)),
        )
    ] + [{"phase": "d", "scene": "scene0", "threads": 2, "above_frame_mib": 3.0}]
    a, b, c, d = scaling_goals.goals(rows, memory, list("abcd"))
    assert (a["shapes_goal"], b["shapes_goal"], c["shapes_goal"], d["shapes_goal"]) == (
        "met",
        "missed",
        "not measured",
        "not measured",
    )
    assert a["ratio"].value == pytest.approx(3.99) and c["shapes"] == 1024 and d["ratio"] is None
    assert (a["memory_goal"], b["memory_goal"], c["memory_goal"]) == ("met", "missed", "not measured")
    assert d["memory_goal"] == "met, mandelbulb and scattered not measured" and a["above_frame_mib"] == 63.9
    assert scaling_goals.judged(Interval(math.nan, math.nan, math.nan, 0, False), 4) == "not measured"
    assert scaling_goals.judged(Interval(3, 2, 5, 6, True), 4) == "cannot be told apart here"
    assert scaling_goals.judged(Interval(3, math.nan, math.nan, 5, False), 4) == "too few launches"


def test_memory_at_4k_is_foreseen_of_each_scene(monkeypatch, tmp_path: Path) -> None:
    """By its largest picture; a scene without one is left out, and what takes too long."""
    bulb = [
        row("opt9_convex", n, ns, "n-mandelbulb", n=n, scene="mandelbulb")
        for n, ns in ((90, 9.0), (180, 5.0))
    ]
    rows = [row("opt9_convex", 90, 1.0, "n-scene0", scene="scene0"), *bulb]
    assert scaling_goals.paces(rows, "opt9_convex") == {"scene0": 1.0, "mandelbulb": 5.0, "scattered": None}
    drawn: list[str] = []

    def at_4k(spec: Spec, about: dict, seed: int, folder: Path) -> dict:
        drawn.append(about["scene"])
        return {"above_frame_mib": 1.0}

    monkeypatch.setattr(scaling_goals, "at_4k", at_4k)
    spec = Spec("opt9_convex", "opt9_convex")
    made, left = scaling_goals.memory([spec], rows, 1e9, 1, tmp_path)
    assert {one["scene"] for one in made} == {"scene0", "mandelbulb"}
    assert drawn[0] == "scene0" and {one["scene"] for one in left} == {"scattered"}
    pixels = 3840 * 2160
    made, left = scaling_goals.memory([spec], rows, 3e-9 * pixels, 1, tmp_path)
    assert "mandelbulb" in {one["scene"] for one in left if "a frame would take" in one["reason"]}


def test_a_crowds_scenes_are_summarized_by_their_means() -> None:
    # Means 100 and 390; the median of the few is 60, which would make it 6.5 times.
    few = [60.0] * 8 + [260.0] * 2
    rows = [
        row("a", 16, 0, "crowd", scenes=80) | {"ns": few * 8},
        row("a", 4096, 0, "crowd", scenes=12) | {"ns": [390.0] * 12},
    ]
    (a,) = scaling_goals.goals(rows, [], ["a"])
    assert a["ratio"].value == pytest.approx(3.9) and 3 < a["ratio"].low < 3.9 < a["ratio"].high < 5
    assert a["scenes"] == [80, 12] and a["mean_ms"] == pytest.approx([100e-6, 390e-6])
    assert a["by_medians"].value == pytest.approx(6.5)
    rows = [one | {"n": 720} for one in rows]
    rows[1]["ns"] = [390.0] * 5
    assert scaling_goals.goals(rows, [], ["a"])[0]["shapes_goal"] == "too few launches"
    # Of one scene each, as it was, by their medians.
    rows = [row("a", 16, 0, "crowd") | {"ns": few}, row("a", 4096, 390, "crowd") | {"ns": [390] * 10}]
    (a,) = scaling_goals.goals(rows, [], ["a"])
    assert a["ratio"].value == pytest.approx(6.5) and a["scenes"] == [1, 1] and "mean_ms" not in a


def test_every_launch_of_a_crowd_has_a_scene_of_its_own(monkeypatch, tmp_path: Path) -> None:
    rendered: list[tuple[int, str]] = []

    def frames(spec: Spec, path: Path, *size: int, **options: object) -> Iterator[dict]:
        rendered.append((size[0], path.name))
        assert (options["warmup"], options["reps"]) == (1, 3)
        yield {"ns": 1.0, "warmup": False}

    monkeypatch.setattr(scaling.run, "frames", frames)
    monkeypatch.setattr(scaling_scenes, "of_shapes", named_by_path)
    crowd = series.series(90, 5, tmp_path)["crowd"]
    points = {Point("crowd", x, BASE): First(0.1, 0, None) for x in crowd.xs}
    settings = scaling.Settings(6, 1, run.FASTEST, tmp_path, tmp_path)
    found = scaling.measure(crowd, points, {}, settings)
    few, many = ([name for _, name in rendered if f"-{x}-" in name] for x in (16, 4096))
    assert len(found[Point("crowd", 16, BASE)]) == 6 and {height for height, _ in rendered} == {720}
    assert few == [f"scattered-16-seed{seed}" for seed in range(5, 11)]
    assert many == [f"scattered-4096-seed{seed}" for seed in range(5, 11)]


def test_verdicts_beside_the_papers_law() -> None:
    xs = [1, 4, 16, 64]

    def said(exponent: float, paper: float | None = 1) -> str:
        return scaling_goals.verdict(scaling_fit.fit(xs, [[x**exponent] * 6 for x in xs]), paper)

    assert said(1.04) == "as the paper's law" and said(0.5) == "grows slower than the paper's bound"
    assert said(1.2) == "grows faster than the paper's law" and said(1.2, None) == "a power law"
    few = scaling_fit.fit(xs, [[x**0.5] * 2 for x in xs])
    assert scaling_goals.verdict(few, 1) == "too few launches"
    assert scaling_goals.under({("scene0", 1): math.nan}) == "not measured"
    bent = scaling_fit.fit(xs, [[x + 20] * 6 for x in xs])
    assert scaling_goals.verdict(bent, 1).startswith("no power law: off at 1, 4")


def result(rows: list[dict]) -> dict:
    known = [one for one in series.series(90, 1, Path("nowhere")).values() if one.name == "shapes-scattered"]
    made = {
        **{"schema": 1, "n": 90, "launches": 6, "rows": rows, "left_out": [], "thumbnails": [], "memory": []},
        **{"fits": scaling_goals.fits(rows, known), "goals": scaling_goals.goals(rows, [], ["opt4"])},
        **{"axes": {known[0].name: known[0].axis}, "titles": {known[0].name: known[0].title}, "context": {}},
    }
    return json.loads(json.dumps(cli.plain(made), allow_nan=False))  # as it comes back from the file


@pytest.mark.parametrize("evals", [1.0, None])
def test_closed_forms_have_no_exponent_of_evaluations(evals) -> None:
    """Their plane holds a 1, of which older files fitted a 0.00; newer ones hold none."""
    rows = [row("opt9_convex", x, 1e6 * x, evals_per_ray=evals) for x in (1, 16, 64)]
    made = result([row("opt4", x, 1e6 * x) for x in (1, 16, 64)] + rows)
    shown = {one[0]: part(*one)[0].markdown for one in scaling_tables.tables(made) if one[2]}
    four, nine = (next(r for r in shown["scaling"].splitlines() if p in r) for p in ("opt4", "opt9_convex"))
    assert four.endswith("| 1.00 |") and nine.endswith("| none: closed forms count 1 for every camera ray |")
    points = [r.split(" | ")[5] for r in shown["scaling-points"].splitlines()[2:]]
    assert points == ["10.0", "160", "640", "–", "–", "–"]
    (axes,) = scaling_page.figures(made, Path("nowhere"))["scaling-evals"].axes
    assert {line.get_label() for line in axes.lines if line.get_label()[0] != "_"} == {"opt4"}


def test_figures_and_chapter_are_made_from_the_file_alone(tmp_path: Path) -> None:
    from study.experiments.scaling import chapter as scaling_chapter

    made = result([row("opt4", x, 1e6 * x**0.5) for x in (1, 16, 64)] + [row("opt3", 1, 5e5)])
    with matplotlib.rc_context(STYLE):
        drawn = scaling_page.figures(made, tmp_path)
        time = save(drawn["scaling-time"], tmp_path / "figures" / "scaling-time", scaling_page.note(made))
    assert set(drawn) == {"scaling-time", "scaling-evals", "scaling-error"}
    text = time[0].read_text()
    assert "x^0.50" in text and "number of shapes, scattered" in text
    assert scaling_chapter.growth(tmp_path).parts == []
    complete.write(tmp_path / scaling.FILE, made)
    chapter = scaling_chapter.growth(tmp_path)
    assert [part.name for part in chapter.parts] == ["scaling", "scaling-crowds", "scaling-points"]
    assert "0.50" in chapter.answer and "the paper's law: 1" in chapter.answer
    assert set(chapter.drawn) == set(drawn)
    cells = [text for text, _ in chapter.parts[0].table.cells[0]]
    assert "0.50" in cells[3] and "grows slower than the paper's bound" in cells
    (tmp_path / scaling.FILE).write_text('{"rows": [1]}')
    with pytest.raises(StudyError, match=r"scaling\.json: not what scripts/stepwise scaling writes"):
        scaling_chapter.growth(tmp_path)


def test_labels_keep_apart_and_inside() -> None:
    places = scaling_page._places([0.9, 0.91, 0.92, 0.1])
    assert all(b - a >= scaling_page.APART - 1e-9 for a, b in itertools.pairwise(sorted(places)))
    assert (
        max(places) <= 1 and places[0] < places[1] < places[2] and places[3] == pytest.approx(0.1, abs=0.05)
    )


# The command.


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--series", "shape"], "no series 'shape'; there are crowd, threads"),
        (["--phase", "opt9x"], "no phase 'opt9x'"),
        (["--phase", "truth"], "truth: is truth itself"),
        (["-n", "8"], "'8': must be a whole number of at least 16"),
        (["--budget", "nan"], "'nan': must be a number of at least 1"),
        (["--launches", "0"], "must be a whole number of at least 1"),
        (["--cpu", "4096"], "CPU 4096 is not available"),
        (["--run", "{tmp}/file/run"], "cannot be written to"),
        (["--series", "memory", "--run", "{tmp}"], "nothing was measured"),
    ],
)
def test_bad_input_is_one_line(words: list[str], said: str, refused) -> None:
    refused(command.main, "stepwise scaling", ["--run", "{tmp}/out", *words], said)


@pytest.mark.slow
def test_from_end_to_end(tmp_path: Path) -> None:
    """Two small series of two programs: rows, fits, thumbnails, and truth beside them."""
    words = [
        "--series",
        "bounces",
        "threads",
        "--phase",
        "opt1",
        "opt5_threads",
        "-n",
        "16",
        "--launches",
        "1",
    ]
    # Far more time than it takes: what is measured must not hang on how fast this machine is now.
    words += ["--budget", "3600", "--seed", "1", "--run", str(tmp_path), "--json"]
    done = started.run([sys.executable, *SCRIPT, *words])
    assert done.returncode == cli.OK, done.stderr
    made = emitted.result(done.stdout)
    assert made == json.loads((tmp_path / scaling.FILE).read_text())
    threads = [one for one in made["rows"] if one["series"] == "threads"]
    assert {one["phase"] for one in threads} == {"opt5_threads"} and threads[0]["threads"] == 1
    chain = [one for one in made["rows"] if (one["series"], one["phase"]) == ("bounces", "opt1")]
    assert [one["x"] for one in chain][:3] == [1, 2, 3] and all(one["coverage"] == 1 for one in chain)
    assert chain[0]["reference"] == "truth" and chain[0]["psnr_db"] > 60 and chain[0]["wrong_ppm"] == 0
    assert (tmp_path / "figures" / "scaling-time.png").stat().st_size > 1000
    assert (tmp_path / made["thumbnails"][0]["picture"]).is_file()
