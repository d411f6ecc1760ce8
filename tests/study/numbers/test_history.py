"""One phase over runs whose times are made up, a run for other programs, and verdicts by baseline's time."""

import json
import shutil
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from compared import make_run, rows, run

from study.commands import compare
from study.numbers import history, stats
from study.pictures import dots
from study.report import history_chapter

pytestmark = pytest.mark.usefixtures("few_resamples")

ZEN = {"cpu": {"model": "Some CPU", "microarchitecture": "Zen", "logical_cpus": 2}}
SIZE = ("s", 16, 9, 1)


def at(day: int, machine=ZEN) -> dict:
    git = {"commit": f"{day}" * 40, "dirty": day == 3}
    return machine | {"time": f"2026-01-0{day}T00:00:00+00:00", "git": git}


@pytest.fixture
def results(tmp_path):
    """opt1 takes 10, 10.2, 5 ms on one machine and 20 on another; baseline 100 everywhere."""
    for day, ms in ((1, 10), (2, 10.2), (3, 5)):
        make_run(tmp_path / "zen" / f"run{day}", {("baseline", "s"): 100, ("opt1", "s"): ms}, at(day))
    other = {"cpu": {"model": "Other CPU", "logical_cpus": 2}}
    make_run(tmp_path / "other" / "run4", {("opt1", "s"): 20}, at(4, other))
    return tmp_path


def test_a_phase_s_history_has_its_steps(results):
    points = history.points(history.runs(results), "opt1")
    assert [(one.machine[:3], one.made[:10], one.commit[:2]) for one in points] == [
        ("Oth", "2026-01-04", "44"),
        ("Zen", "2026-01-01", "11"),
        ("Zen", "2026-01-02", "22"),
        ("Zen", "2026-01-03", "33"),
    ]
    assert points[3].commit.endswith("+")  # of a checkout with changes
    assert [one.step for one in points] == [False, False, False, True]
    assert points[3].change.value == pytest.approx(10.2 / 5)
    assert [one.over_base and round(one.over_base.value, 1) for one in points] == [None, 10, 9.8, 20]


def test_other_work_is_no_step(results):
    """Another content of the scene, other limits, other lanes."""
    for number, differs in enumerate(({"scene_hash": "bb"}, {"max_steps": 7}, {"lanes": 16})):
        folder = results / "zen" / f"run{5 + number}"
        make_run(folder, {("opt1", "s"): 50}, at(5 + number), **differs)
    assert sum(one.step for one in history.points(history.runs(results), "opt1")) == 1


def test_a_phase_that_no_run_has(results):
    assert run("--history", "opt7", "--scene", "s", "--", results).returncode == 2


def test_the_history_s_table(results):
    done = run("--history", "opt1", results)
    assert done.returncode == 0 and done.stdout.count("faster 2.04") == 1
    some = json.loads(run("--history", "opt1", "--json", results / "zen" / "run1", results / "other").stdout)
    assert [point["made"][:10] for point in some["result"]["points"]] == ["2026-01-04", "2026-01-01"]
    assert run("--history", "opt1", "--export", compare.EXPORTS[0], results).returncode == 2


def test_a_run_for_other_programs(results):
    one = results / "zen" / "run1"
    bench = json.loads(run("--export", compare.EXPORTS[0], one).stdout)
    assert [set(row) for row in bench] == [{"name", "unit", "value", "range", "extra"}] * 2
    assert {row["name"]: row["unit"] for row in bench} == {"baseline s 16x9": "ms", "opt1 s 16x9": "ms"}
    over = json.loads(run("--export", compare.EXPORTS[0], "--by", "baseline", one).stdout)
    assert [(row["name"], row["value"]) for row in over] == [("opt1 s 16x9", pytest.approx(0.1))]
    found = json.loads(run("--export", "hyperfine", one).stdout)["results"]
    assert {row["command"]: row["median"] for row in found} == {
        "baseline s 16x9": pytest.approx(bench[0]["value"] / 1000),
        "opt1 s 16x9": pytest.approx(bench[1]["value"] / 1000),
    }


def test_an_export_s_file(results, tmp_path):
    out = tmp_path / "out.json"
    assert run("--export", compare.EXPORTS[0], "-o", out, results / "zen" / "run1").returncode == 0
    assert len(json.loads(out.read_text())) == 2
    assert run("--export", compare.EXPORTS[0]).returncode == 2


def test_a_slow_hour_is_no_slower_phase(tmp_path):
    """All of B took 1.3 times as long, and opt2 1.2 times more: by baseline's time opt2 alone is slower."""
    times = {("baseline", "s"): 100, ("opt1", "s"): 10, ("opt2", "s"): 5}
    a = make_run(tmp_path / "a", times)
    slow = {key: ms * 1.3 * (1.2 if key[0] == "opt2" else 1) for key, ms in times.items()}
    b = make_run(tmp_path / "b", slow)
    found = rows(a, b, by="baseline")
    assert found["opt2", "s"].baseline.value == pytest.approx(1 / 1.2)
    assert {row.verdict for row in rows(a, b).values()} == {"slower"}
    done = run(a, b, "--by", "baseline", "--fail-on-slower")
    assert done.returncode == 1 and done.stderr.count("FAIL") == 1 and "opt2" in done.stderr


@pytest.mark.parametrize("launches", [3, 8])
def test_the_interval_of_a_change_holds_the_true_one(launches):
    """200 pairs of runs of so many launches, 3 % of noise in a launch and 10 % of it in a run's rounds."""
    random, held = np.random.default_rng(5), 0
    for _ in range(200):
        pairs = []
        for speed_up in (4.0, 5.0):
            rounds = random.normal(1, 0.1, launches)
            noise = random.normal(1, 0.03, (2, launches))
            pairs.append((100 * rounds * noise[0], 100 / speed_up * rounds * noise[1]))
        found = stats.change_interval(*pairs)
        held += found.low <= 1.25 <= found.high
    assert held / 200 >= 0.9


def chapter(results, monkeypatch, times):
    """The chapter of the newest run, whose phases take `times` ns per pixel; opt7 is in no other run."""
    monkeypatch.setattr(history_chapter, "RESULTS", results)
    data = SimpleNamespace(path=results / "zen" / "run3")
    rows = pd.DataFrame(
        [{"phase": name, "scene": "s", "threads": 1, "ns_per_pixel": ns} for name, ns in times.items()]
    )
    return history_chapter.over_time(data, rows)


def test_the_chapter_shows_the_fastest_phase_that_has_a_past(results, monkeypatch):
    times = {("baseline", "s"): 100, ("opt1", "s"): 5, ("opt7", "s"): 2}
    make_run(results / "zen" / "run3", times, at(3))
    made = chapter(results, monkeypatch, {"baseline": 1, "opt1": 5, "opt7": 2})
    assert "; 1 step of" in made.answer
    (table,) = made.parts
    assert [row["over_base"].split()[0] for row in table.rows] == ["10.00", "9.804", "20.00"]
    assert [row["step"][:11] for row in table.rows] == ["", "", "faster 2.04"]
    (axes,) = made.drawn["history"].make().axes
    marks = [line for line in axes.lines if line.get_marker() == "o"]
    assert [line.get_color() == dots.LESS for line in marks] == [False, False, True]


def test_a_machine_s_first_run_has_no_history(results, monkeypatch):
    for day in (1, 2):
        shutil.rmtree(results / "zen" / f"run{day}")
    made = chapter(results, monkeypatch, {"baseline": 1, "opt1": 5})
    assert not made.answer and not made.parts and not made.drawn
