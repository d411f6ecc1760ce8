"""Goals beside what runs have: what was asked, of which row, judged by the whole interval."""

from __future__ import annotations

import math
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import started

import goals as script
from study import accuracy, analysis, goals, goals_page, show
from study.cli import StudyError
from study.registry import ROOT
from study.stats import Interval


def timed(phase: str, speedup: tuple[float, float, float], lanes: int = 16, **more: object) -> dict:
    value, low, high = speedup
    row = {"scene": "scene0", "phase": phase, "threads": 1, "lanes": lanes, "launches": 6, "ms": 1000 / value}
    row |= {"speedup": value, "speedup_low": low, "speedup_high": high, "over_one_thread": math.nan}
    return row | {"truth_psnr_db": 54.5, "truth_converged_only": False} | more


@pytest.mark.parametrize(
    ("speedup", "lanes", "verdict"),
    [
        ((3100, 3000, 3300), 16, "met"),
        ((2588, 2130, 2846), 16, "missed"),
        ((2900, 2800, 3001), 16, "cannot be told apart here"),
        ((1600, 1500, 1700), 8, "met"),  # half of it was asked of 8 lanes
        ((1400, 1300, 1499), 8, "missed"),
        ((1400, math.nan, math.nan), 8, "too few launches"),
    ],
)
def test_the_whole_interval_decides_and_narrow_lanes_are_asked_half(
    speedup: tuple[float, float, float], lanes: int, verdict: str
) -> None:
    rows = [timed("opt10_scene", speedup, lanes), timed("opt9_convex", (9.0, 8.0, 10.0), lanes)]
    rows.append(timed("packets", (9e9, 9e9, 9e9), lanes))  # not of the ladder
    (goal,) = goals._speed(rows, "best", "scene0", 3000.0)
    assert (goal.what, goal.verdict, goal.narrow) == ("opt10_scene", verdict, lanes == 8)
    text = goals_page.cell(goal)
    assert text.endswith(f"**{verdict}**") and "(54.5 dB)" in text and ("of 1,500×" in text) == (lanes == 8)
    assert goals_page.asked(goal) == "≥ 3,000×"


def test_what_was_not_measured_has_no_row() -> None:
    rows = [timed("opt6_wide", (math.nan, math.nan, math.nan)), timed("opt7_tiles", (5, 4, 6), scene="trio")]
    assert not list(goals._speed(rows, "opt6_wide", "scene0", 150.0))
    assert not list(goals._speed(rows, "opt7_tiles", "scene0", 320.0))
    assert not list(goals._two(rows, "scene0"))


def test_two_threads_are_the_fastest_phases() -> None:
    two = {"threads": 2, "over_one_thread": 1.95, "over_one_thread_low": 1.91, "over_one_thread_high": 2.0}
    slow = two | {"over_one_thread": 1.5, "over_one_thread_low": 1.4, "over_one_thread_high": 1.6}
    rows = [timed("opt5_threads", (50, 49, 51), **slow), timed("opt10_scene", (2000, 1900, 2100), **two)]
    own, best = goals._two(rows, "scene0")
    assert (own.name.split()[0], own.verdict, own.what) == ("opt5_threads", "missed", "")
    assert (best.name.split()[0], best.verdict, best.what) == ("best", "met", "opt10_scene")


def test_the_worst_rung_is_held_against_baseline(monkeypatch: pytest.MonkeyPatch) -> None:
    right = {"false_hits_ppm": 0, "false_misses_ppm": 0, "wrong_shape_ppm": 0, "psnr_ideal_db": 45.0}
    named = {"baseline": 54.50, "opt4": 40.0, "opt7_tiles": 54.46, "opt9_convex": 96.0}
    rows = [{"scene": "scene0", "phase": p, "psnr_db": db, **right} for p, db in named.items()]
    rows[-1] |= {"wrong_shape_ppm": 2}
    monkeypatch.setattr(accuracy, "read", lambda path: {"rows": rows})
    psnr, ideal, wrong = goals.of_errors(SimpleNamespace(path=Path()))
    assert (psnr.what, psnr.verdict, ideal.verdict) == ("opt7_tiles", "met", "met")  # 0.04 dB are shown equal
    assert (wrong.what, wrong.verdict, goals_page.asked(wrong)) == ("opt9_convex", "missed", "≤ 0")
    rows[2]["psnr_db"] = 54.44
    assert next(iter(goals.of_errors(SimpleNamespace(path=Path())))).verdict == "missed"
    rows[2]["psnr_db"] = math.nan
    assert next(iter(goals.of_errors(SimpleNamespace(path=Path())))).verdict == "missed"


def test_of_several_runs_of_a_machine_the_newest_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    def of(run: SimpleNamespace) -> list:
        found = Interval(run.ratio, run.ratio, run.ratio, 6, True)
        return [(0, goals.Goal("a goal", 4.0, found, "met", at_most=True))]

    def run(cpu: str, time: str, ratio: float) -> SimpleNamespace:
        context = {"cpu": {"microarchitecture": cpu}, "time": time}
        return SimpleNamespace(context=context, ratio=ratio, path=Path(f"{cpu}-{time}"))

    monkeypatch.setattr(goals, "of_run", of)
    found, used = goals_page.rows([run("A", "2", 3.0), run("A", "1", 2.0), run("B", "1", 1.0)])
    assert found[0]["A"] == "3.00×: **met**" and found[0]["B"] == "1.00×: **met**"
    assert (found[0]["asked"], used) == ("≤ 4.00×", {"A": "`A-2`", "B": "`B-1`"})


def test_readme_has_what_the_published_runs_say() -> None:
    folders = sorted(file.parent for file in (ROOT / "results" / "reference").glob("*/context.json"))
    found, used = goals_page.rows([analysis.load(folder, strict=False) for folder in folders])
    table = show.markdown(show.table(found, goals_page.columns(list(used))))
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert script.readme(text, table, script.note(used)) == text
    with pytest.raises(StudyError, match="goals:begin"):
        script.readme("no marks", table, "")


def test_a_run_without_any_figure_is_told_in_one_line(tmp_path: Path) -> None:
    empty = tmp_path / "run"
    some = next((ROOT / "results" / "reference").glob("*-720p"))
    shutil.copytree(some, empty)
    (empty / "frames.jsonl.gz").unlink()
    found = started.run([sys.executable, ROOT / "scripts" / "goals.py", empty])
    assert found.returncode != 0 and len(found.stderr.strip().splitlines()) == 1
