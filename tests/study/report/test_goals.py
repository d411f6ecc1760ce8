"""Goals beside what runs have: what was asked, of which row, judged by the whole interval."""

from __future__ import annotations

import dataclasses
import math
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import complete
import pandas as pd
import pytest
import started

from study.commands import goals as script
from study.core import show
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.core.schema import File
from study.experiments import experiment, goal
from study.experiments.accuracy import goals as accuracy_goals
from study.experiments.drjit import goals as drjit_goals
from study.experiments.drjit import measure as drjit_measure
from study.experiments.frames import goals as frames_goals
from study.experiments.frames import measure as frames
from study.experiments.goal import Goal
from study.experiments.goal import _apart as apart
from study.experiments.lattice import goals as lattice_goals
from study.experiments.lattice import measure as lattice
from study.experiments.packets import goals as packets_goals
from study.experiments.packets import measure as packets
from study.experiments.scaling import goals as scaling_goals
from study.experiments.sweep import goals as sweep_goals
from study.experiments.verify import goals as verify_goals
from study.numbers import accuracy, analysis
from study.numbers.stats import Interval
from study.report import goals_page

pytestmark = pytest.mark.slow


def timed(phase: str, speedup: tuple[float, float, float], lanes: int = 16, **more: object) -> dict:
    value, low, high = speedup
    row = {"scene": "scene0", "phase": phase, "threads": 1, "lanes": lanes, "launches": 6, "ms": 1000 / value}
    row |= {"speedup": value, "speedup_low": low, "speedup_high": high, "over_one_thread": math.nan}
    return row | {"truth_own_db": 54.5, "truth_converged_only": False} | more


@pytest.mark.parametrize(
    ("speedup", "lanes", "verdict"),
    [
        ((3100, 3000, 3300), 16, "met"),
        ((2588, 2130, 2846), 16, "missed"),
        ((3100, 2900, 3300), 16, "cannot be told apart here"),
        ((2900, 2800, 3001), 16, "cannot be told apart here"),
        ((2900, 2800, 3000), 16, "cannot be told apart here"),  # its end is not below
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
    (goal,) = sweep_goals._speed(rows, "best", "scene0", 3000.0)
    assert (goal.what, goal.verdict, goal.narrow) == ("opt10_scene", verdict, lanes == 8)
    text = goals_page.cell(goal)
    assert (
        text.endswith(f"**{verdict}**")
        and f"(54.5 dB to ground truth; {show.number(1000 / speedup[0])} ms)" in text
        and ("of 1,500×" in text) == (lanes == 8)
    )
    assert goals_page.asked(goal) == "≥ 3,000×"


def test_what_was_not_measured_has_no_row() -> None:
    rows = [timed("opt6_wide", (math.nan, math.nan, math.nan)), timed("opt7_tiles", (5, 4, 6), scene="trio")]
    assert not list(sweep_goals._speed(rows, "opt6_wide", "scene0", 150.0))
    assert not list(sweep_goals._speed(rows, "opt7_tiles", "scene0", 320.0))
    assert not list(sweep_goals._two(rows, "scene0"))


def test_two_threads_are_of_the_last_rung() -> None:
    two = {"threads": 2, "over_one_thread": 1.95, "over_one_thread_low": 1.91, "over_one_thread_high": 2.0}
    slow = two | {"over_one_thread": 1.5, "over_one_thread_low": 1.4, "over_one_thread_high": 1.6}
    rows = [timed("opt5_threads", (50, 49, 51), **slow), timed("opt10_scene", (2000, 1900, 2100), **two)]
    own, best = sweep_goals._two(rows, "scene0")
    assert (own.name.split()[0], own.verdict, own.what) == ("opt5_threads", "missed", "")
    assert (best.name.split()[0], best.verdict, best.what) == ("best", "met", "opt10_scene")
    ends = {"ms": 0.49, "ms_low": 0.48, "ms_high": 0.52}
    rows.append(timed("opt9_convex", (2040, 1900, 2100), **slow) | ends)
    rows[1] |= {"ms_low": 0.47, "ms_high": 0.51}
    assert list(sweep_goals._two(rows, "scene0"))[1] == best  # less, and not told apart
    rows[2] |= {"ms": 0.45, "ms_low": 0.44, "ms_high": 0.46}
    assert list(sweep_goals._two(rows, "scene0"))[1].what == "opt9_convex"


def test_the_worst_rung_is_held_against_baseline(monkeypatch: pytest.MonkeyPatch) -> None:
    right = {"false_hits_ppm": 0, "false_misses_ppm": 0, "wrong_shape_ppm": 0, "psnr_ideal_db": 45.0}
    named = {"baseline": 54.50, "opt4": 40.0, "opt7_tiles": 54.46, "opt9_convex": 96.0}
    rows = [{"scene": "scene0", "phase": p, "psnr_db": db, **right} for p, db in named.items()]
    rows[-1] |= {"wrong_shape_ppm": 2}
    bulb = {"baseline": (90.0, 1.0), "opt4": (51.4, 0.9998), "opt7_tiles": (51.38, 0.9997)}
    rows += [
        {"scene": "mandelbulb", "phase": p, "antialiased": {"psnr_db": db}, "depth_agree_fraction": share}
        for p, (db, share) in bulb.items()
    ]
    monkeypatch.setattr(accuracy, "read", lambda path: {"rows": rows})
    psnr, ideal, wrong, means, depth = accuracy_goals.reached(SimpleNamespace(path=Path()))
    assert (means.asked, means.verdict) == (51.4, "met")
    assert (depth.asked, depth.verdict, depth.what) == (pytest.approx(200), "missed", "opt7_tiles")
    assert (psnr.what, psnr.verdict, ideal.verdict) == ("opt7_tiles", "met", "met")  # 0.04 dB are shown equal
    assert (wrong.what, wrong.verdict, goals_page.asked(wrong)) == (
        "opt9_convex",
        "missed",
        "≤ baseline's",
    )
    rows[2]["psnr_db"] = 54.44
    assert next(iter(accuracy_goals.reached(SimpleNamespace(path=Path())))).verdict == "missed"
    rows[2]["psnr_db"] = math.nan
    assert next(iter(accuracy_goals.reached(SimpleNamespace(path=Path())))).verdict == "missed"


def test_the_bulbs_rungs_are_held_against_opt4() -> None:
    """Both against baseline's picture: 4×4 means, and pixels whose depth is another."""
    named = {"opt3": (math.inf, 1.0), "opt4": (55.15, 0.9998), "opt8_streams": (63.0, 0.99998)}
    named |= {"opt9_convex": (55.11, 0.9998), "packets": (1.0, 0.0)}

    def pairs() -> list[dict]:
        keys = ("phase", "scene", "reference", "antialiased_psnr_db", "depth_agree_fraction")
        right = [(phase, "mandelbulb", "baseline", *values) for phase, values in named.items()]
        wrong = [
            ("opt8_streams", "scene0", "baseline", 1.0, 0.0),
            ("opt8_streams", "mandelbulb", "opt2", 1.0, 0.0),
        ]
        return [dict(zip(keys, one, strict=True)) for one in right + wrong]

    psnr, depth = verify_goals.reached(SimpleNamespace(pairs=pairs()))
    assert (psnr.what, psnr.asked, psnr.found.value, psnr.verdict) == ("opt9_convex", 55.15, 55.11, "met")
    assert (depth.what, depth.verdict, goals_page.asked(depth)) == ("opt9_convex", "met", "≤ opt4's")
    assert depth.found.value == pytest.approx(200) and depth.beside == "opt4 200"
    for found, verdicts in {
        (55.09, 0.9998): ("missed", "met"),
        (60.0, 0.9997): ("met", "missed"),
        (math.nan, math.nan): ("missed", "missed"),
    }.items():
        named["opt9_convex"] = found
        assert tuple(g.verdict for g in verify_goals.reached(SimpleNamespace(pairs=pairs()))) == verdicts
    named["opt4"] = (55.15, None)  # an older file
    (psnr,) = verify_goals.reached(SimpleNamespace(pairs=pairs()))
    assert "4×4" in psnr.name
    named.pop("opt4")
    assert not list(verify_goals.reached(SimpleNamespace(pairs=pairs())))


def test_of_several_runs_of_a_machine_the_newest_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    def of(run: SimpleNamespace) -> list:
        found = Interval(run.ratio, run.ratio, run.ratio, 6, True)
        return [(0, Goal("a goal", 4.0, found, "met", at_most=True, scenes=run.scenes))]

    def run(cpu: str, time: str, ratio: float, scenes: int = 0) -> SimpleNamespace:
        context = {"cpu": {"microarchitecture": cpu}, "time": time}
        frames = pd.DataFrame()
        path = Path(f"{cpu}-{time}")
        return SimpleNamespace(context=context, ratio=ratio, path=path, frames=frames, scenes=scenes)

    monkeypatch.setattr(experiment, "goals", of)
    found, used = goals_page.rows([run("A", "2", 3.0), run("A", "1", 2.0), run("B", "1", 1.0)])
    assert found[0]["A"] == "3.00×: **met**" and found[0]["B"] == "1.00×: **met**"
    assert (found[0]["asked"], used) == ("≤ 4.00×", {"A": "`A-2`", "B": "`B-1`"})
    found, used = goals_page.rows([run("A", "1", 3.0, 96), run("A", "2", 2.0, 150), run("A", "3", 1.0, 6)])
    assert (found[0]["A"], used) == ("2.00×: **met**", {"A": "`A-2`"})


@pytest.mark.parametrize(
    ("flags", "lanes", "named"),
    [
        (["avx2", "avx512f", "avx512dq"], {"opt4": 8, "opt6_wide": 16, "opt10_scene": 16}, "Zen 4"),
        (["avx2", "avx512f", "avx512dq"], {"opt4": 8, "opt6_wide": 8}, "Zen 4, AVX2 alone"),
        (["avx2", "avx512f", "avx512dq"], {"baseline": 1, "opt4": 8}, "Zen 4"),  # as wide as they ever are
        (["avx2", "avx512f"], {"opt6_wide": 8}, "Zen 4"),  # 16 lanes need avx512dq, too
        (["avx2", "avx512f", "avx512dq"], {}, "Zen 4"),
    ],
)
def test_a_run_of_fewer_lanes_than_the_cpu_has_is_another_column(flags, lanes, named) -> None:
    frames = pd.DataFrame([{"phase": phase, "lanes": count} for phase, count in lanes.items()])
    context = {"cpu": {"microarchitecture": "Zen 4", "flags": flags}}
    assert goals_page.name(SimpleNamespace(context=context, frames=frames)) == named
    frames = frames.drop(columns="lanes", errors="ignore")  # an older run
    assert goals_page.name(SimpleNamespace(context=context, frames=frames)) == "Zen 4"


def test_the_page_has_what_the_published_runs_say() -> None:
    folders = sorted(file.parent for file in (ROOT / "results" / "reference").glob("*/context.json"))
    runs = [analysis.load(folder, strict=False) for folder in folders]
    text = script.PAGE.read_text(encoding="utf-8")
    assert script.marked(text, *script.page(*goals_page.rows(runs, checked=True))) == text
    with pytest.raises(StudyError, match="goals:begin"):
        script.marked("no marks", "", "")


@pytest.mark.parametrize(("ratio", "shown"), [(0.98, True), (1.03, True), (1.04, False), (None, False)])
def test_a_baseline_slower_than_the_papers_program_has_no_speedups(
    ratio: float | None, shown: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = pd.DataFrame([timed("opt6_wide", (150.0, 140.0, 160.0), height=720)])
    monkeypatch.setattr(sweep_goals.ladder, "rows", lambda data: table)
    other = Goal("other", 2.0, Interval(3.0, 3.0, 3.0, 6, True), "met")
    if ratio is not None:
        rows = [{"phase": "baseline", "ours_over_theirs": {"value": value}} for value in (0.9, ratio)]
        complete.write(tmp_path / "original.json", {"rows": rows})
    run = SimpleNamespace(context={"time": "1"}, path=tmp_path, frames=pd.DataFrame())
    monkeypatch.setattr(
        experiment, "goals", lambda data: [(0, g) for g in (*sweep_goals.reached(data), other)]
    )
    over = [f"{who} on scene0 over baseline, 1280×720, one thread" for who in ("opt6_wide", "best")]
    found = [row["goal"] for row in goals_page.rows([run], checked=True)[0]]
    assert found == over * shown + ["other"]
    assert len(goals_page.rows([run])[0]) == 3


def test_an_experiments_goals_are_found_by_its_object(monkeypatch: pytest.MonkeyPatch) -> None:
    goal = Goal("a goal", 2.0, Interval(3.0, 3.0, 3.0, 6, True), "met")
    toy = experiment.Experiment("toy", "a toy", 1, {"toy.json": File}, goals=lambda data: [goal])
    silent = experiment.Experiment("silent", "has none", 0, {})
    monkeypatch.setattr(experiment, "find_all", lambda: {"silent": silent, "toy": toy})
    run = SimpleNamespace(context={"time": "1"}, path=Path("run"), frames=pd.DataFrame())
    assert experiment.goals(run) == [(1, goal)]
    assert [row["goal"] for row in goals_page.rows([run])[0]] == ["a goal"]
    broken = dataclasses.replace(toy, goals=lambda data: [{}["rows"]])
    monkeypatch.setattr(experiment, "find_all", lambda: {"toy": broken})
    with pytest.raises(StudyError, match=r"run/toy\.json: not what scripts/stepwise toy writes"):
        experiment.goals(run)


def test_a_run_without_any_figure_is_told_in_one_line(tmp_path: Path) -> None:
    empty = tmp_path / "run"
    shutil.copytree(next((ROOT / "results" / "reference").glob("*-720p")), empty)
    for name in ("frames.jsonl.gz", "accuracy.json", "verify.json"):
        (empty / name).unlink()
    found = started.run([sys.executable, ROOT / "scripts" / "stepwise", "goals", empty])
    assert found.returncode != 0 and len(found.stderr.strip().splitlines()) == 1


def run_of(monkeypatch: pytest.MonkeyPatch, module: object, result: dict) -> SimpleNamespace:
    monkeypatch.setattr(module, "read", lambda path: result)
    return SimpleNamespace(path=Path())


def given(value: float, low: float, high: float) -> dict:
    return {"value": value, "low": low, "high": high, "launches": 6, "sufficient": True}


def test_best_is_the_last_rung_unless_another_is_told_apart() -> None:
    rows = [timed("opt9_convex", (82.5, 66.2, 95.1)), timed("opt10_scene", (78.8, 72.1, 92.9))]
    assert next(iter(sweep_goals._speed(rows, "best", "scene0", 65.0))).what == "opt10_scene"
    rows[0] = timed("opt9_convex", (99.0, 93.0, 105.0))
    assert next(iter(sweep_goals._speed(rows, "best", "scene0", 65.0))).what == "opt9_convex"


def test_a_frame_rate_has_its_own_programs_error(monkeypatch: pytest.MonkeyPatch) -> None:
    row = {"phase": "opt10_scene", "scene": "scene0", "width": 1920, "n": 1080, "hit": "half a pixel"}
    row |= {"goal": 60.0, "verdict": "missed", "frames_per_s": given(40, 36, 45), "reference": "opt3"}
    row |= {
        "psnr_db": 27.4,
        "to_own": {"psnr_db": 19.0},
        "marched": {"phase": "opt8_streams", "psnr_db": 37.5},
    }
    (goal,) = frames_goals.reached(run_of(monkeypatch, frames, {"rows": [row]}))
    assert goal.beside == "19.0 dB to opt3 by the scene's own limits"
    assert goal.name.endswith("hit distance half a pixel, secondary rays 3 of it off")  # of an older run
    row["to_own"] = None
    assert next(iter(frames_goals.reached(SimpleNamespace(path=Path())))).beside == "27.4 dB to opt3"


def test_drjits_own_limits_and_the_best_that_marches(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [
        {"program": p, "scene": "scene0_plain", "threads": 1, "limits": limits, "reference": "opt3"}
        | {"psnr_db": db, "goal": 8.0, "verdict": verdict, "ratio": given(x, x - 0.1, x + 0.1)}
        | {"to_own": {"psnr_db": own}}
        for p, limits, db, own, verdict, x in (
            ("Dr.Jit", "100 steps, 0.001", 58.4, 18.5, None, 1.0),
            ("opt8_streams", "own", 101.6, 101.6, "missed", 3.1),
            ("opt10_scene", "own", 74.9, 74.9, "met", 28.5),
            ("opt8_streams", "100 steps, 0.001", 17.3, 21.4, None, 6.0),
            ("opt10_scene", "100 steps, 0.001", 15.9, 25.6, None, 7.2),
        )
    ]
    best, marches, its = drjit_goals.reached(run_of(monkeypatch, drjit_measure, {"rows": rows}))
    assert (best.what, marches.what, marches.verdict) == ("opt10_scene", "opt8_streams", "missed")
    assert best.beside == "74.9 dB to opt3; Dr.Jit by 100 steps, 0.001: 58.4 dB"
    assert its.name == "scene0_plain over Dr.Jit, both by its limits, 100 steps, 0.001, one thread"
    assert (its.what, its.verdict, its.found.value) == ("opt10_scene", "missed", 7.2)
    assert its.beside == "25.6 dB to opt3 by the scene's own limits, Dr.Jit 18.5 dB"


def test_embrees_ways_are_those_that_were_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    row = {"scene": "trio", "kind": "primary", "embree": "Embree 3, a build with assertions"}
    row |= {
        "embree1": {"mrays": 2.0},
        "embree1_ratio": 3.0,
        "embree1_ratio_low": 2.0,
        "embree1_ratio_high": 4.0,
    }
    result = {"goals": {"primary": 1.0, "shadow": None}, "rays": [row, row | {"kind": "shadow"}]}
    camera, light = packets_goals.reached(run_of(monkeypatch, packets, result))
    assert camera.beside == "asked by single rays; Embree 3, a build with assertions"
    assert (goals_page.asked(light), light.verdict) == ("–", "") and "**" not in goals_page.cell(light)
    slower = {"scene": "scene0", "embree1_ratio": 0.7, "embree1_ratio_low": 0.6, "embree1_ratio_high": 0.8}
    result["rays"] += [row | slower, row | {"scene": "spheres40"}]
    camera, light = packets_goals.reached(SimpleNamespace(path=Path()))
    assert (camera.what, camera.verdict) == ("packets on scene0", "missed")  # the least of them


def test_digits_are_shown_where_values_differ_and_three_do_not_show_it() -> None:
    assert apart(45.26292, 45.26739) == "45.263 of 45.267"
    assert (
        apart(45.3, 45.3),
        apart(40.0, 45.3),
        apart(46.0, 45.3),
    ) == ("", "", "")


def test_coverage_is_told_or_said_to_be_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    row = {"phase": "opt10_scene", "shapes": 4096, "ratio": given(3.7, 3.5, 3.9), "coverage": [None, None]}
    row |= {"shapes_goal": "met", "above_frame_mib": None, "n": 720}
    data = run_of(monkeypatch, scaling_goals, {"goals": [row]})
    (found,) = scaling_goals.reached(data)
    assert found.beside == "coverage not recorded in this run" and found.name.endswith("one scene of each")
    row |= {"coverage": [0.4, 0.4]}
    assert next(iter(scaling_goals.reached(data))).beside == "coverage 0.400 and 0.400"
    row |= {"coverage": [None, None], "scenes": [48, 40]}
    data = run_of(monkeypatch, scaling_goals, {"goals": [row], "coverage_wanted": 0.4})
    (found,) = scaling_goals.reached(data)
    assert found.beside == "48 and 40 scenes; coverage made to be 0.4"
    assert found.name.endswith("mean over scenes")
    row["by_medians"] = given(3.9, 3.6, 4.1)
    (found,) = scaling_goals.reached(data)
    assert found.beside.endswith("made to be 0.4; by medians 3.90× [3.60,\u00a04.10]")
    row["by_medians"] = given(None, None, None)  # NaN is null in a file
    (found,) = scaling_goals.reached(data)
    assert found.beside.endswith("made to be 0.4")
    row["n"] = 90  # small pictures are not what was asked
    assert not list(scaling_goals.reached(data))


def test_the_most_memory_and_the_best_growth_are_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another rung's growth counts where it is told apart from the last one's."""
    row = {"shapes": 4096, "n": 720, "coverage": [0.4, 0.4], "shapes_goal": "met", "memory_goal": "met"}
    phases = {"opt8_streams": (3.6, 3.3, 3.9, 9.0), "opt9_convex": (3.0, 2.9, 3.4, 63.0)}
    phases["opt10_scene"] = (3.7, 3.5, 3.9, 20.0)
    rows = [
        row | {"phase": phase, "ratio": given(*ratio), "above_frame_mib": mib}
        for phase, (*ratio, mib) in phases.items()
    ]
    held = [
        {"phase": phase, "scene": "scene0", "threads": 1, "above_frame_mib": mib}
        for phase, (*_, mib) in phases.items()
    ]
    data = run_of(monkeypatch, scaling_goals, {"goals": rows, "memory": held})
    growth, memory = scaling_goals.reached(data)
    assert (growth.what, growth.found.value) == ("opt9_convex", 3.0)
    assert (memory.what, memory.found.value) == ("opt9_convex", 63.0)
    assert memory.verdict == "met, mandelbulb and scattered not measured"  # whatever the file says
    rows[1]["ratio"] = given(3.0, 2.9, 3.5)
    growth, _ = scaling_goals.reached(SimpleNamespace(path=Path()))
    assert growth.what == "opt10_scene"


def test_of_another_machine_the_value_decides(monkeypatch: pytest.MonkeyPatch) -> None:
    row = {
        "program_ms": 57.0,
        "ms": 4.0,
        "ms_low": 3.0,
        "ms_high": 5.0,
        "psnr_db": 127.0,
        "phase": "opt10_scene",
    }
    monkeypatch.setattr(lattice, "best", lambda result, threads: row if threads == 1 else None)
    (goal,) = lattice_goals.reached(run_of(monkeypatch, lattice, {}))
    assert goal.verdict == "met" and "14.2× (ours alone [11.4, 19.0])" in goals_page.cell(goal).replace(
        "\u00a0", " "
    )


def test_the_reports_cells_are_no_markdown() -> None:
    data = analysis.load(ROOT / "results" / "reference" / "zen4-2026-11-26-frames", strict=False)
    (goals_part,) = goals_page.section(data).parts
    said = " ".join(text for line in goals_part.table.cells for text, _ in line)
    assert "met" in said and "*" not in said


def test_a_phase_that_draws_the_ideal_shadow_is_not_held_to_an_estimate_of_it() -> None:
    values = {"baseline": 54.5, "opt7_tiles": 54.5, "opt11_ideal": 45.8}
    (found,) = goal.worst_rung("scene0", "baseline", "PSNR to truth", values)
    assert found.what == "opt7_tiles" and found.verdict == "met"
    (found,) = goal.worst_rung("scene0", "baseline", "PSNR to truth with ideal shadows", values)
    assert found.what == "opt11_ideal" and found.verdict == "missed"
    (found,) = goal.worst_rung("scene0", "baseline", "wrong hits, ppm", dict.fromkeys(values, 0.0))
    assert found.what == "opt11_ideal"
