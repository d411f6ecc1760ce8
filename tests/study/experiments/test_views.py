"""Gains on further views: the budget, gains and verdicts known by arithmetic, tables of a made-up file."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import matplotlib
import numpy as np
import pytest

from study.core import cli, commands, registry, store
from study.core.registry import Spec
from study.core.run import UNSUPPORTED, DriverError
from study.experiments.views import command, experiment, gains, tables
from study.experiments.views import measure as viewing
from study.experiments.views.schema import Gain, Row, Views
from study.measuring.views import TUNED, View
from study.numbers import stats
from study.numbers.schema import Interval
from study.pictures.draw import STYLE

OPT1, OPT2, OPT3 = (Spec.parse(name) for name in ("opt1", "opt2", "opt3"))
TWO = [View("trio", name, "", registry.find_scene("trio")) for name in ("own", "left")]


def settings(seconds: float) -> viewing.Settings:
    return viewing.Settings(90, 45, 6, 1, 0, seconds, 1, Path("/nowhere"))


def plan(
    monkeypatch: pytest.MonkeyPatch,
    seconds: float,
    first: Callable[[Spec, View], float] = lambda spec, view: 1e-6,
) -> viewing.Plan:
    """The plan of opt1 to opt3 on two views, by a clock that stands still."""
    monkeypatch.setattr(viewing.time, "monotonic", lambda: 0.0)
    return viewing.choose(viewing.parents(["opt1", "opt2", "opt3"]), TWO, settings(seconds), first)


def test_phases_are_those_with_a_parent() -> None:
    assert viewing.parents(["baseline", "truth", "opt1", "opt1", "opt2"]) == [
        (OPT1, Spec.parse("baseline")),
        (OPT2, OPT1),
    ]


def test_the_newest_phases_are_taken_first_while_the_time_lasts(monkeypatch) -> None:
    one = viewing.cost(1e-6, TWO[0], settings(1))
    assert one == pytest.approx(6 * (3 * 0.0144 + viewing.OVERHEAD))
    every = plan(monkeypatch, 8.01 * one)
    assert [phase for phase, _ in every.pairs] == [OPT1, OPT2, OPT3] and not every.left_out
    some = plan(monkeypatch, 7.9 * one)  # baseline, opt1, opt2 and opt3 on two views are eight
    assert some.pairs == [(OPT2, OPT1), (OPT3, OPT2)] and [r.phase for r in some.left_out] == ["opt1"]
    last = plan(monkeypatch, 0)  # the newest is measured whatever it takes
    assert last.pairs == [(OPT3, OPT2)] and {r.phase for r in last.left_out} == {"opt1", "opt2"}


def test_a_launch_times_twenty_milliseconds_at_least() -> None:
    assert viewing.frames_of(0.00025) == (1, 80) and viewing.frames_of(1e-7) == (1, 200)
    assert viewing.frames_of(0.021) == (1, 1) and viewing.frames_of(0.3) == (0, 1)


def test_what_a_phase_refuses_is_left_out_and_a_crash_is_a_failure(monkeypatch) -> None:
    def first(spec: Spec, view: View) -> float:
        if (spec, view.name) == (OPT3, "left"):
            raise DriverError(UNSUPPORTED, "no such shape")
        if (spec, view.name) == (OPT2, "own"):
            raise DriverError(-11, "killed by SIGSEGV")
        return 1e-6

    found = plan(monkeypatch, 1e9, first)
    assert [(r.phase, r.view, r.reason) for r in found.left_out] == [("opt3", "left", "no such shape")]
    assert [(r.phase, r.reason) for r in found.failures] == [("opt2", "killed by SIGSEGV")]
    kept = {(str(spec), view.name) for spec, view in found.pace}
    assert ("opt3", "left") not in kept and ("opt3", "own") in kept and ("opt2", "own") not in kept


def times(ms: float) -> list[float]:
    return [ms * f for f in (0.995, 1, 1, 1, 1, 1.005)]


def row(scene: str, view: str, gain: float, **more: object) -> Row:
    """A row of phase b, whose parent takes 100 ms."""
    own = times(100 / gain)
    found = {
        **{"phase": "b", "parent": "a", "scene": scene, "view": view, "change": "", "width": 160, "n": 90},
        **{"ns": own, "tuned": view == "own" and scene in TUNED},
        "ratio": Interval.of(stats.ratio_interval(times(100), own)),
        "ms": Interval.of(stats.median_interval(own)),
        **{"reference": "truth", "psnr_db": 60.0, "rmse": 0.001, "wrong_ppm": 3.0, "non_finite": 0},
    }
    return Row(**found | more)


def with_parents(rows: list[Row]) -> list[Row]:
    about = {"phase": "a", "parent": None, "ratio": None, "psnr_db": 70.0}
    return [*(row(one.scene, one.view, 1, **about) for one in rows), *rows]


def gain_of(*rows: Row) -> Gain:
    (found,) = gains.over_views(with_parents([*rows]))
    return found


@pytest.mark.parametrize(
    ("ratios", "median", "worst", "verdict"),
    [
        ((2, 1.5, 3, 2), 2, ("left", 1.5), gains.EVERYWHERE),
        ((2, 1, 3, 2), 2, ("left", 1), gains.MEDIAN),
        ((2, 0.5, 3, 2), 2, ("left", 0.5), gains.MEDIAN),
        ((2, 1, 0.9, 0.8), 0.9, ("near", 0.8), gains.ALONE),
        ((2, 1, 1, 1), 1, ("left", 1), gains.ALONE),
        ((1, 0.9, 0.5, 0.8), 0.8, ("right", 0.5), "slower"),
        ((1, 1, 1, 1), 1, ("left", 1), "no gain"),
    ],
)
def test_median_worst_case_and_verdict(ratios, median, worst, verdict) -> None:
    names = ("own", "left", "right", "near")
    found = gain_of(*[row("scene0", view, gain) for view, gain in zip(names, ratios, strict=True)])
    assert found.tuned["scene0"].value == pytest.approx(ratios[0])  # and not among the others
    assert found.median.value == pytest.approx(median) and found.median.low <= median
    assert (found.worst_view, found.worst.value) == (worst[0], pytest.approx(worst[1]))
    assert found.verdict.startswith(verdict) and found.views == 3
    assert found.slower == sum(ratio < 1 for ratio in ratios[1:])


def test_a_gain_within_the_noise_is_none() -> None:
    unsure = stats.ratio_interval([100.0] * 3 + [125.0] * 4, [100.0] * 7)  # 1.25 by its median
    noisy = row("trio", "own", 1, ratio=Interval.of(unsure))
    assert noisy.ends[0] == 1.25 and not noisy.wins and not noisy.loses


def test_general_code_gains_nothing_whatever_its_times_say() -> None:
    mine = [
        row("trio", view, gain, general="general: over 31 shapes")
        for view, gain in (("own", 1.3), ("left", 1.2), ("near", 0.8))
    ]
    mine += [row("cubes", view, gain) for view, gain in (("own", 2), ("left", 1.5))]
    found = gain_of(*mine)
    assert found.median.value == pytest.approx(1.75) and (found.views, found.general) == (5, 3)
    assert (found.slower, found.worst_view) == (1, "near")  # a loss is one by any code


def test_too_few_launches_say_nothing() -> None:
    found = gains.median_ratio([([100.0] * 5, [50.0] * 6)])
    some = [row("trio", "own", 2)]
    assert found.value == 2 and not found.sufficient
    assert gains.verdict(some, some, found, 0) == gains.FEW


def test_the_medians_interval_holds_the_truth_about_as_often_as_it_says() -> None:
    random, held = np.random.default_rng(1), 0
    for seed in range(100):
        pairs = [(100 * random.lognormal(0, 0.1, 12), 50 * random.lognormal(0, 0.1, 12)) for _ in range(5)]
        found = gains.median_ratio(pairs, seed)
        held += found.low <= 2 <= found.high
    assert held >= 90


def test_the_largest_error_is_shown_beside_the_parents_and_nan_is_the_largest() -> None:
    views = row("trio", "own", 2), row("trio", "left", 2, psnr_db=41.0), row("trio", "near", 2, psnr_db=None)
    found = gain_of(*views)
    low = found.to_truth
    assert (low.view, low.psnr_db, low.parent_db, found.to_base) == ("left", 41.0, 70.0, None)
    views[2].rmse = None  # no value: a picture that is not finite
    low = gain_of(*views).to_truth
    assert low.no_value and low.view == "near"


def test_tables_and_figures_are_made_from_the_file_alone(tmp_path: Path) -> None:
    views = (("own", 2), ("left", 0.9), ("right", 1), ("near", 0.9))
    every = with_parents([row("scene0", view, gain) for view, gain in views])
    assert experiment.section(SimpleNamespace(path=tmp_path)).parts == []
    made = Views(
        **{"schema": 1, "n": 90, "error_n": 45, "launches": 6, "rows": every, "left_out": []},
        **{"failures": [], "steps": gains.over_views(every)},
    )
    store.write_json(tmp_path / command.FILE, made)
    chapter = experiment.section(SimpleNamespace(path=tmp_path))
    assert [part.name for part in chapter.parts] == ["views", "views-losses", "views-points"]
    text = chapter.parts[0].markdown
    assert gains.ALONE in text and "2 of 3" in text and "60.0 (parent 70.0)" in text
    assert chapter.answer.startswith("0 of 1")
    with matplotlib.rc_context(STYLE):
        assert chapter.drawn["views-ratios"].make().axes


def test_a_step_loses_where_it_is_surely_slower_by_over_three_percent() -> None:
    unsure = Interval.of(stats.ratio_interval([100.0] * 3 + [80.0] * 4, [100.0] * 7))  # 1.25 by its median
    some = [row("trio", "own", 0.5), row("trio", "left", 0.1), row("cubes", "own", 1 / 1.02)]
    every = with_parents([*some, row("lattice", "own", 1, ratio=unsure), row("scene0", "own", 2)])
    made = SimpleNamespace(rows=every, steps=gains.over_views(every))
    (found,) = tables.losses(made)
    cells = {scene: (text.partition("×")[0], mark) for (scene, _), (text, mark) in found.table.cells}
    assert cells == {
        "trio, 160×90": ("2.00", "bad"),
        "cubes, 160×90": ("1.02", ""),
        "lattice, 160×90": ("1.25", ""),
        "scene0, 160×90": ("0.500", ""),
    }
    assert found.table.cells[2][1][0].endswith("[1.00,\u00a01.25]")


@pytest.mark.slow
def test_from_end_to_end(tmp_path: Path) -> None:
    words = ["--phase", "opt1", "--scene", "two_spheres", "-n", "8", "--error-n", "8", "--launches", "1"]
    outcome, _ = commands.called("views", [*words, "--budget", "3600", "--seed", "1", "--run", str(tmp_path)])
    made = Views.load(tmp_path / command.FILE)
    assert outcome.ended == cli.OK and cli.plain(outcome.result) == cli.plain(made)
    known = {(one.phase, one.view): one for one in made.rows}
    assert len(known) == 8
    for view in ("own", "left", "right", "near"):
        base, one = known["baseline", view], known["opt1", view]
        assert one.ratio.value == pytest.approx(base.ns[0] / one.ns[0])
        assert one.reference == "truth" and one.psnr_db == base.psnr_db  # the same bits
    (found,) = made.steps
    assert found.views == 4 and math.isnan(found.median.ends[1])
    assert (tmp_path / "figures" / "views-ratios.png").stat().st_size > 1000
