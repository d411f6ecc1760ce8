"""Further views: cameras known by geometry, the budget, gains and verdicts known by arithmetic, bad input."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import complete
import emitted
import matplotlib
import numpy as np
import pytest
import started

from study.core import cli, registry
from study.core.cli import StudyError
from study.core.registry import ROOT, Spec
from study.core.run import UNSUPPORTED, DriverError
from study.experiments.views import chapter as views_chapter
from study.experiments.views import command
from study.experiments.views import figures as views_page
from study.experiments.views import gains as views_gains
from study.experiments.views import measure as views_measure
from study.measuring import views
from study.measuring.views import View
from study.numbers import stats
from study.pictures.draw import STYLE

SCRIPT = (ROOT / "scripts" / "stepwise", "views")
OPT1, OPT2, OPT3 = (Spec(name, name) for name in ("opt1", "opt2", "opt3"))


def scene(*places: tuple, **camera: object) -> dict:
    made = {"position": [0, 0, 0], "look_at": [0, 0, 1], "up": [0, 1, 0]} | camera
    shapes = [{"type": "sphere", "radius": 1, "position": list(place)} for place in places]
    return {"camera": made, "shapes": [*shapes, {"type": "plane", "normal": [0, 1, 0], "offset": -3}]}


# The cameras.


def test_the_pivot_is_ahead_at_the_mean_distance_of_what_has_a_place() -> None:
    assert views.pivot(scene((1, 0, 10), (-5, 2, 20))) == pytest.approx([0, 0, 15])
    assert views.pivot(scene((0, 0, 10), (0, 0, -90))) == pytest.approx([0, 0, 10])  # behind: no matter
    assert views.pivot(scene(look_at=[0, 0, 4])) == pytest.approx([0, 0, 4])  # planes have no place
    behind = scene((0, 0, 10), position=[0, 0, -20], look_at=[0, 0, 0])  # the plane's 0, 0, 0 is no place
    assert views.pivot(behind) == pytest.approx([0, 0, 10])
    slanted = scene((6, 0, 8), look_at=[3, 0, 4])  # along (0.6, 0, 0.8)
    assert views.pivot(slanted) == pytest.approx([6, 0, 8])


def test_the_camera_goes_round_the_pivot_and_looks_at_it() -> None:
    for degrees, side in ((40, -1), (-40, 1)):
        camera = views.turned(scene((0, 0, 10)), degrees)["camera"]
        arm = np.subtract(camera["position"], [0, 0, 10])
        assert camera["look_at"] == [0, 0, 10] and camera["up"] == [0, 1, 0]
        assert np.linalg.norm(arm) == pytest.approx(10)
        assert math.degrees(math.acos(arm @ [0, 0, -10] / 100)) == pytest.approx(40)
        assert math.copysign(1, arm[0]) == side  # right is normalize(up × forward), +x here
    near = views.turned(scene((0, 0, 10)), 0, 0.6)["camera"]
    assert near["position"] == pytest.approx([0, 0, 4])


def test_nothing_but_the_camera_changes_and_the_same_view_is_made_each_time(tmp_path: Path) -> None:
    trio = registry.find_scene("trio")
    made, again = (views.of(trio, tmp_path, lambda path, point: 1.0) for _ in range(2))
    assert [view.name for view in made] == ["own", "left", "right", "near"] and made == again
    assert made[1].scene.data["camera"]["position"][0] < 0 < made[2].scene.data["camera"]["position"][0]
    for view in made[1:]:
        kept = {key: value for key, value in view.scene.data.items() if key != "camera"}
        assert kept == {key: value for key, value in trio.data.items() if key != "camera"}
        assert json.loads(view.scene.path.read_text()) == view.scene.data
    assert not any(view.tuned for view in made)
    scene0 = views.of(registry.find_scene("scene0"), tmp_path, lambda path, point: 1.0)
    assert [view.name for view in scene0 if view.tuned] == ["own"]
    square = views.of(registry.find_scene("two_spheres"), tmp_path, lambda path, point: 1.0)
    assert {view.size(9) for view in square} == {(9, 9)} and {view.size(9) for view in made} == {(16, 9)}


def test_a_camera_in_a_shape_takes_a_lesser_change_or_says_so(tmp_path: Path) -> None:
    asked: list[float] = []

    def near_at_first(path: Path, point: np.ndarray) -> float:
        asked.append(point[0])
        return 0.001 if len(asked) <= 2 else 1.0

    made = views.of(registry.find_scene("trio"), tmp_path, near_at_first)
    assert [view.change for view in made] == [
        *("as it is", "20° to the left", "40° to the right", "at 0.6 of the distance"),
    ]
    with pytest.raises(StudyError, match="trio: every camera to the left would be in a shape"):
        views.of(registry.find_scene("trio"), tmp_path, lambda path, point: math.nan)
    assert not (tmp_path / "trio-left.json").exists()


def test_the_distance_is_that_of_geometry(tmp_path: Path) -> None:
    made = views.of(registry.find_scene("two_spheres"), tmp_path)
    for view in made:
        point = np.array(view.scene.data["camera"]["position"])
        away = min(np.linalg.norm(point - s["position"]) - s["radius"] for s in view.scene.data["shapes"])
        assert views.probed(view.scene.path, point) == pytest.approx(away, abs=1e-12) and away > 0.1
    assert views.probed(made[0].scene.path, np.array([-0.8, 0, 0])) == pytest.approx(-1)


# The budget.


def settings(tmp_path: Path, seconds: float) -> views_measure.Settings:
    return views_measure.Settings(90, 45, 6, 1, 1, 0, seconds, 1, tmp_path)


def plan(tmp_path: Path, seconds: float, first=lambda spec, view: 1e-6) -> views_measure.Plan:
    some = [View("trio", name, "", registry.find_scene("trio")) for name in ("own", "left")]
    rungs = views_measure.parents(["opt1", "opt2", "opt3"])
    return views_measure.choose(rungs, some, settings(tmp_path, seconds), first, clock=lambda: 0.0)


def test_rungs_are_those_with_a_parent() -> None:
    assert views_measure.parents(["baseline", "truth", "opt1", "opt1", "opt2"]) == [
        (OPT1, Spec("baseline", "baseline")),
        (OPT2, OPT1),
    ]


def test_the_newest_rungs_are_taken_first_while_the_time_lasts(tmp_path: Path) -> None:
    one = views_measure.cost(1e-6, 160 * 90, settings(tmp_path, 1))
    assert one == pytest.approx(6 * (3 * 0.0144 + views_measure.OVERHEAD))
    every = plan(tmp_path, 8.01 * one)
    assert [rung for rung, _ in every.rungs] == [OPT1, OPT2, OPT3] and not every.left_out
    some = plan(tmp_path, 7.9 * one)  # baseline, opt1, opt2 and opt3 on two views are eight
    assert some.rungs == [(OPT2, OPT1), (OPT3, OPT2)] and [r["phase"] for r in some.left_out] == ["opt1"]
    last = plan(tmp_path, 0)  # the newest is measured whatever it takes
    assert last.rungs == [(OPT3, OPT2)] and [r["phase"] for r in last.left_out] == ["opt1", "opt2"]


def test_a_launch_times_twenty_milliseconds_at_least() -> None:
    assert views_measure.frames_of(0.00025, 1) == (1, 80) and views_measure.frames_of(1e-7, 1) == (1, 200)
    assert views_measure.frames_of(0.021, 1) == (1, 1) and views_measure.frames_of(0.3, 5) == (0, 1)
    assert views_measure.frames_of(0.01, 5) == (1, 5)


def test_every_rung_has_its_tuned_views_before_any_has_others(tmp_path: Path) -> None:
    some = [View(*name, "", registry.find_scene(name[0])) for name in (("trio", "own"), ("scene0", "own"))]
    rungs = views_measure.parents(["opt1", "opt2", "opt3"])
    one = views_measure.cost(1e-6, 160 * 90, settings(tmp_path, 1))
    # Four programs where they were tuned, and of the other view the newest rung and its parent.
    found = views_measure.choose(
        rungs, some, settings(tmp_path, 6.1 * one), lambda spec, view: 1e-6, clock=lambda: 0.0
    )
    assert [rung for rung, _ in found.rungs] == [OPT1, OPT2, OPT3]
    assert {(str(spec), view.base) for spec, view in found.pace} == {
        *((name, "scene0") for name in ("baseline", "opt1", "opt2", "opt3")),
        *((name, "trio") for name in ("opt2", "opt3")),
    }
    assert [(r["phase"], r["view"]) for r in found.left_out] == [("opt1", "views"), ("opt2", "views")]


def test_what_a_phase_refuses_is_left_out_and_a_crash_is_a_failure(tmp_path: Path) -> None:
    def first(spec: Spec, view: View) -> float:
        if (spec, view.name) == (OPT3, "left"):
            raise DriverError(UNSUPPORTED, "no such shape")
        if (spec, view.name) == (OPT2, "own"):
            raise DriverError(-11, "killed by SIGSEGV")
        return 1e-6

    found = plan(tmp_path, 1e9, first)
    assert [(r["phase"], r["view"], r["reason"]) for r in found.left_out] == [
        ("opt3", "left", "no such shape")
    ]
    assert [(r["phase"], r["reason"]) for r in found.failures] == [("opt2", "killed by SIGSEGV")]
    kept = {(str(spec), view.name) for spec, view in found.pace}
    assert ("opt3", "left") not in kept and ("opt3", "own") in kept and ("opt2", "own") not in kept


# Gains.


def row(scene: str, view: str, own: float, base: float = 100.0, phase: str = "b", **more: object) -> dict:
    times = [own * f for f in (0.995, 1, 1, 1, 1, 1.005)], [base * f for f in (0.995, 1, 1, 1, 1, 1.005)]
    return {
        **{
            "phase": phase,
            "parent": "a",
            "scene": scene,
            "view": view,
            "change": "",
            "width": 160,
            "n": 90,
            "ns": times[0],
        },
        **{
            "tuned": view == "own" and scene in views.TUNED,
            "ratio": stats.ratio_interval(times[1], times[0]),
        },
        **{"ms": stats.median_interval(times[0]), "reference": "truth", "psnr_db": 60.0, "rmse": 0.001},
        **{"wrong_ppm": 3.0, "width": 160, "n": 90, "non_finite": 0, "depth_agree_fraction": None},
        **more,
    }


def parent(of: dict) -> dict:
    times = [100.0 * f for f in (0.995, 1, 1, 1, 1, 1.005)]
    return {**of, "phase": "a", "parent": None, "ratio": None, "ns": times, "psnr_db": 70.0}


def rung(*ratios: float, names: tuple = ("left", "right", "near")) -> dict:
    """One of scene0: its own view's ratio first."""
    mine = [row("scene0", view, 100 / r) for view, r in zip(("own", *names), ratios, strict=True)]
    (found,) = views_gains.rungs([*map(parent, mine), *mine])
    return found


@pytest.mark.parametrize(
    ("ratios", "median", "worst", "verdict"),
    [
        ((2, 1.5, 3, 2), 2, ("left", 1.5), "wins on every view"),
        ((2, 1, 3, 2), 2, ("left", 1), "wins in the median: faster on 2 of 3, shown slower on none"),
        ((2, 0.5, 3, 2), 2, ("left", 0.5), "wins in the median: faster on 2 of 3, slower on 1"),
        ((2, 1, 0.9, 0.8), 0.9, ("near", 0.8), "wins on the tuned views alone"),
        ((2, 1, 1, 1), 1, ("left", 1), "wins on the tuned views alone"),
        ((1, 0.9, 0.5, 0.8), 0.8, ("right", 0.5), "slower in the median"),
        ((1, 1, 1, 1), 1, ("left", 1), "no gain"),
    ],
)
def test_median_worst_case_and_verdict(ratios, median, worst, verdict) -> None:
    found = rung(*ratios)
    assert found["tuned"]["scene0"].value == pytest.approx(ratios[0])  # and not among the others
    assert found["median"].value == pytest.approx(median) and found["median"].low <= median
    assert (found["worst_view"], found["worst"].value) == (worst[0], pytest.approx(worst[1]))
    assert (found["verdict"], found["views"]) == (verdict, 3)


def test_a_gain_within_the_noise_is_none() -> None:
    unsure = stats.ratio_interval([100.0] * 3 + [125.0] * 4, [100.0] * 7)  # 1.25 by its median
    noisy = row("trio", "own", 1) | {"ratio": unsure}
    assert views_gains.ends(noisy)[0] == 1.25 and not views_gains.wins(noisy) and not views_gains.loses(noisy)


def test_general_code_gains_nothing_whatever_its_times_say() -> None:
    why = "general: over 31 shapes"
    mine = [
        row("trio", view, 100 / r, general=why) for view, r in (("own", 1.3), ("left", 1.2), ("near", 0.8))
    ]
    mine += [row("cubes", view, 100 / r) for view, r in (("own", 2), ("left", 1.5))]
    every = [*map(parent, mine), *mine]
    trio, cubes = views_gains.by_scene(every)
    assert trio["verdict"] == "slower on near; no kernel: its parent's code" and cubes["verdict"] == ""
    (found,) = views_gains.rungs(every)
    assert found["median"].value == pytest.approx(1.75) and (found["views"], found["general"]) == (5, 3)
    assert (found["slower"], found["worst_view"]) == (1, "near")  # a loss is one by any code


def test_too_few_launches_say_nothing() -> None:
    pairs = [([100.0] * 5, [50.0] * 6)]
    found = views_gains.median_ratio(pairs)
    assert (
        found.value == 2
        and not found.sufficient
        and views_gains.verdict([{}], [{}], found) == "too few launches"
    )
    assert math.isnan(views_gains.median_ratio([]).value)


def test_the_medians_interval_holds_the_truth_about_as_often_as_it_says() -> None:
    random, held = np.random.default_rng(1), 0
    for seed in range(100):
        pairs = [
            tuple(scale * np.exp(0.05 * random.standard_normal(10)) for scale in (150, 100)) for _ in range(5)
        ]
        found = views_gains.median_ratio(pairs, seed)
        held += found.low <= 1.5 <= found.high
    assert 85 <= held <= 100


def test_a_scene_that_is_gained_on_its_own_view_alone_is_said() -> None:
    mine = [row("trio", view, 100 / r) for view, r in (("own", 2), ("left", 1), ("right", 0.9), ("near", 1))]
    mine += [row("cubes", view, 100 / r) for view, r in (("own", 2), ("left", 1.5), ("right", 0.9))]
    trio, cubes = views_gains.by_scene([*map(parent, mine), *mine])
    assert trio["verdict"] == "wins on its own view alone" and cubes["verdict"] == "slower on right"


def test_the_largest_error_is_shown_beside_the_parents_and_nan_is_the_largest() -> None:
    mine = [
        row("trio", "own", 50),
        row("trio", "left", 50, psnr_db=41.0),
        row("trio", "near", 50, psnr_db=None),
    ]
    (found,) = views_gains.rungs([*map(parent, mine), *mine])
    low = found["to_truth"]
    assert (low["view"], low["psnr_db"], low["parent_db"], found["to_base"]) == ("left", 41.0, 70.0, None)
    mine[2]["psnr_db"] = mine[2]["rmse"] = None  # no value: a picture that is not finite
    (found,) = views_gains.rungs([*map(parent, mine), *mine])
    assert found["to_truth"]["no_value"] and found["to_truth"]["view"] == "near"


def test_errors_are_those_known_by_hand(blank, miss) -> None:
    reference, made = blank(10, 10, 0.5), blank(10, 10, 0.6)
    miss(made, (0, 0))
    for name in "RGB":
        made[name][0, 0] = 0.6
    found = views_measure.against(reference, made, exact=False, fractal=False)
    assert found["psnr_db"] == pytest.approx(20, abs=1e-4) and found["wrong_ppm"] == pytest.approx(10_000)
    checked = blank(8, 8, 0.5)
    for name in "RGB":
        checked[name] += np.float32(0.1) * (-1) ** np.add(*np.mgrid[:8, :8]).astype(np.float32)
    found = views_measure.against(blank(8, 8, 0.5), checked, exact=False, fractal=True)
    assert found["psnr_db"] > 100 and found["depth_agree_fraction"] == 1  # it is gone in the 4 × 4 means
    assert views_measure.against(blank(8, 8), checked, False, False)["psnr_db"] == pytest.approx(20, abs=1e-3)


# The chapter and the command.


def test_tables_and_figures_are_made_from_the_file_alone(tmp_path: Path) -> None:
    mine = [
        row("scene0", view, 100 / r) for view, r in (("own", 2), ("left", 0.9), ("right", 1), ("near", 0.9))
    ]
    every = [*map(parent, mine), *mine]
    result = {
        "schema": 1,
        "n": 90,
        "error_n": 45,
        "launches": 6,
        "rows": every,
        "left_out": [],
        "failures": [],
    }
    result = json.loads(
        json.dumps(cli.plain({**result, "rungs": views_gains.rungs(every), "thumbnails": []}))
    )
    assert views_chapter.elsewhere(tmp_path).parts == []
    complete.write(tmp_path / views_measure.FILE, result)
    chapter = views_chapter.elsewhere(tmp_path)
    assert [part.name for part in chapter.parts] == ["views", "views-scenes", "views-points"]
    text = chapter.parts[0].markdown
    assert "wins on the tuned views alone" in text and "2 of 3" in text and "60.0 (parent 70.0)" in text
    with matplotlib.rc_context(STYLE):
        assert list(views_page.figures(result, tmp_path)) == [views_page.RATIOS]
    assert list(chapter.drawn) == [views_page.RATIOS] and chapter.answer.startswith("0 of 1 phases")
    (tmp_path / views_measure.FILE).write_text('{"rows": [1]}')
    with pytest.raises(StudyError, match=r"views\.json: not what scripts/stepwise views writes"):
        views_chapter.elsewhere(tmp_path)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--phase", "opt9x"], "no phase 'opt9x'"),
        (["--phase", "baseline"], "baseline: no rung with a parent"),
        (["--scene", "scene9"], "no scene 'scene9'"),
        (["-n", "7"], "'7': must be a whole number of at least 8"),
        (["--budget", "nan"], "'nan': must be a number of at least 1"),
        (["--cpu", "4096"], "CPU 4096 is not available"),
        (["--run", "{tmp}/file/run"], "cannot be written to"),
    ],
)
def test_bad_input_is_one_line(words: list[str], said: str, refused) -> None:
    refused(command.main, "stepwise views", ["--run", "{tmp}/out", *words], said)


@pytest.mark.slow
def test_from_end_to_end(tmp_path: Path) -> None:
    words = ["--phase", "opt1", "--scene", "two_spheres", "-n", "8", "--error-n", "8", "--launches", "1"]
    words += ["--budget", "3600", "--seed", "1", "--run", str(tmp_path), "--json"]
    done = started.run([sys.executable, *SCRIPT, *words])
    assert done.returncode == cli.OK, done.stderr
    made = emitted.result(done.stdout)
    assert made == json.loads((tmp_path / views_measure.FILE).read_text())
    assert {(r["phase"], r["view"]) for r in made["rows"]} == {
        (phase, view) for phase in ("baseline", "opt1") for view in ("own", "left", "right", "near")
    }
    mine = {r["view"]: r for r in made["rows"] if r["phase"] == "opt1"}
    base = {r["view"]: r for r in made["rows"] if r["phase"] == "baseline"}
    for view, one in mine.items():
        assert one["ratio"]["value"] == pytest.approx(base[view]["ns"][0] / one["ns"][0])
        assert one["reference"] == "truth" and one["psnr_db"] == base[view]["psnr_db"]  # the same bits
    (found,) = made["rungs"]
    assert found["verdict"] == "tuned views not measured" and found["views"] == 4
    assert (tmp_path / "figures" / "views-ratios.png").stat().st_size > 1000
    assert all((tmp_path / one["picture"]).is_file() for one in made["thumbnails"])
