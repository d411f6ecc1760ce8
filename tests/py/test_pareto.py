"""Speed against error: fronts, winners and sentences of points whose answer is known by hand."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import matplotlib
import pytest

from study import cli, pareto, pareto_page, registry
from study.draw import STYLE, save
from study.registry import ROOT, Spec

SCRIPT = ROOT / "scripts" / "pareto.py"


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


def test_a_null_of_a_broken_picture_is_nan_and_drawn_nowhere() -> None:
    broken, same = row("broken", 1, None, non_finite=3), row("same", 1, None)
    assert math.isnan(pareto.level_of(broken, "psnr_db"))
    assert pareto.level_of(same, "psnr_db") == math.inf
    text = pareto_page._decibels("psnr_db")
    assert (text(broken), text(same), text(row("nan", 1, math.nan, non_finite=1))) == (
        "not finite",
        "∞",
        "not finite",
    )
    figure = pareto_page.figure([row("baseline", 9, 50), row("opt4", 1, None, non_finite=3)])
    drawn = [tuple(p) for axes in figure.axes for c in axes.collections for p in c.get_offsets()]
    assert (9, 50) in drawn and all(x != 1 for x, _ in drawn)


def test_who_overlaps_the_fastest_is_named() -> None:
    rows = [row("b", 20, 60), row("c", 24, 60), row("d", 30, 60), row("b", 21, 60, own_parameters=False)]
    winner = next(w for w in pareto.winners([*rows, row("low", 20, 30)]) if w["level_db"] == 60)
    assert winner["best"] is rows[0]  # [18, 22]: c has [21.6, 26.4], d [27, 33], low is too far off
    assert winner["not_told_apart_from"] == ["c", "b by other parameters"]
    assert pareto.sentence(winner).endswith("60.0 dB); not told apart from c, b by other parameters")


@pytest.mark.parametrize("nothing", [None, math.nan])
def test_too_few_launches_are_said(nothing: float | None) -> None:
    few = {"value": 5, "low": nothing, "high": nothing}
    rows = [row("opt4", 5, 61, ns_per_pixel=few), row("opt3", 6, 61, ns_per_pixel=few)]
    winner = next(w for w in pareto.winners(rows) if w["level_db"] == 60)
    said = pareto.sentence(winner)
    assert "insufficient launches" in said and "[" not in said and "apart from" not in said
    lone = [row("opt4", 5, 61), rows[1]]
    assert pareto.rivals(lone, "psnr_db", 60) == ["opt3"]  # without an interval nobody is told apart


@pytest.mark.parametrize("value", ["inf", "nan", "0", "-1", "9e-10", "1.1e9", "near"])
def test_a_hit_distance_that_no_loader_takes_is_an_argument_error(value: str) -> None:
    done = subprocess.run([sys.executable, SCRIPT, f"--hit-distance={value}"], capture_output=True, text=True)
    assert done.returncode == cli.BAD_INPUT and "must be a length of 1e-9 to 1e9" in done.stderr


def test_a_folder_that_cannot_be_written_to_is_said_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for name in ("pareto", "toolchains", "stability", "functions"):
        command = [sys.executable, SCRIPT.with_name(f"{name}.py"), "--run", tmp_path / "file" / "run"]
        # Measuring all of these takes minutes: only a check before it ends in time.
        done = subprocess.run(command, capture_output=True, text=True, timeout=20)
        assert done.returncode == cli.BAD_INPUT and "cannot be written to" in done.stderr, name


def test_no_row_at_all_is_no_success(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import pareto as command

    refused = [{"phase": "opt1", "scene": "scene0", "reason": "refused"}]
    monkeypatch.setattr(pareto, "study_scene", lambda *_: ([], refused))
    monkeypatch.setattr(sys, "argv", ["pareto.py", "--phase", "opt1", "--run", str(tmp_path)])
    with pytest.raises(cli.StudyError, match="nothing was measured") as caught:
        command.main()
    assert caught.value.exit_status == cli.BAD_INPUT and not list(tmp_path.iterdir())


def test_the_note_names_the_mandelbulbs_arithmetic() -> None:
    said = pareto_page.note({"n": 90, "launches": 6})
    assert "double-double (104 bits, about 31 digits)" in said and "quad" not in said
