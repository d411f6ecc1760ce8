"""Speed against error: fronts, winners and sentences of points whose answer is known by hand."""

from __future__ import annotations

import math

import matplotlib
import pytest

from study import pareto, pareto_page, registry
from study.draw import STYLE, save
from study.registry import Spec


def row(phase: str, pace: float, psnr: float | None, **more: object) -> dict:
    base = {
        "scene": "scene0",
        "phase": phase,
        "hit_distance": 1e-6,
        "max_steps": 3000,
        "own_parameters": True,
    }
    interval = {"value": pace, "low": pace * 0.9, "high": pace * 1.1}
    found = {"ns_per_pixel": interval, "psnr_db": psnr, "non_finite": 0, "converged_only": False}
    return base | found | more


A, B, C, D = row("a", 10, 30), row("b", 20, 60), row("c", 30, 50), row("d", 40, None)


def test_the_front_has_what_nothing_beats_in_both() -> None:
    assert pareto.front([D, C, B, A], "psnr_db") == [A, B, D]  # c is slower and worse than b


def test_equal_times_leave_only_the_nearer() -> None:
    assert pareto.front([row("e", 10, 29), A], "psnr_db") == [A]


def test_what_has_no_number_or_is_not_finite_wins_nothing() -> None:
    nan, broken = row("nan", 1, math.nan), row("broken", 1, 200, non_finite=3)
    assert pareto.front([nan, broken, A], "psnr_db") == [A]
    assert pareto.fastest([nan, broken, A], "psnr_db", 20) is A


@pytest.mark.parametrize(("level", "winner"), [(40, "b"), (50, "b"), (60, "b"), (61, "d"), (80, "d")])
def test_the_fastest_reaches_the_level(level: int, winner: str) -> None:
    best = pareto.fastest([A, B, C, D], "psnr_db", level)
    assert best is not None and best["phase"] == winner


def test_a_level_that_nothing_reaches_is_said() -> None:
    made = [w for w in pareto.winners([A, B]) if w["level_db"] == 80]
    assert [w["best"] for w in made] == [None]
    assert pareto.sentence(made[0]) == "scene0, 80 dB to the paper's estimator: no program reaches it"


def test_the_sentence_names_pace_interval_and_parameters() -> None:
    other = row("opt4", 5, 61, own_parameters=False, hit_distance=1e-4, max_steps=64)
    winner = next(w for w in pareto.winners([other]) if w["level_db"] == 60)
    said = pareto.sentence(winner)
    assert said == (
        "scene0, 60 dB to the paper's estimator: opt4 is the fastest, 5 [4.5, 5.5] ns/pixel "
        "(hit distance 0.0001, 64 steps; 61.0 dB)"
    )


def test_the_grid_always_has_the_scenes_own_parameters_and_switches_only_these() -> None:
    scene = registry.find_scene("scene0")
    points = pareto.grid(scene, [Spec.parse("opt4"), Spec.parse("opt4+rsqrt")], [1e-3], [64])
    mine = [(p.hit_distance, p.max_steps) for p in points if p.spec.phase == "opt4"]
    assert sorted(mine) == [(1e-6, 64), (1e-6, 3000), (1e-3, 64), (1e-3, 3000)]
    assert [(p.hit_distance, p.max_steps) for p in points if p.spec.phase == "opt4+rsqrt"] == [(1e-6, 3000)]


def test_the_papers_point_is_our_baseline_over_its_own_speedup() -> None:
    there = pareto_page.paper_point("scene0", [row("baseline", 19600, None)])
    assert there == (pytest.approx(1000), pytest.approx(31.7))
    assert pareto_page.paper_point("trio", [row("baseline", 19600, None)]) is None


def test_the_figure_is_drawn_from_rows_alone(tmp_path) -> None:
    rows = [row("baseline", 4000, 60), row("opt4", 100, 55), row("opt4+rsqrt", 99, 30)]
    rows.append(row("opt4", 80, 44, own_parameters=False, hit_distance=1e-3))
    with matplotlib.rc_context(STYLE):
        made = save(pareto_page.figure(rows), tmp_path / "pareto", "note")
    text = made[0].read_text()
    assert "opt4" in text and all(path.stat().st_size > 1000 for path in made)
