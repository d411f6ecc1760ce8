"""Verdicts of a gate: simulated gates whose truth is known, exact counts, and a second measurement."""

import hashlib
import math
from pathlib import Path

import complete
import emitted
import numpy as np
import pandas as pd
import pytest
from compared import make_run, run, sides

from study.core import commands, registry
from study.measuring import again, changes
from study.measuring.changes import FASTER, ONCE, SAME, SLOWER
from study.measuring.two_runs import Side
from study.numbers import significance

pytestmark = pytest.mark.usefixtures("few_resamples")

PHASES, SCENES, LAUNCHES = ("baseline", *(f"opt{i}" for i in range(1, 10))), ("s", "t"), 8
MANY = pytest.mark.parametrize("gates", [2, pytest.param(20, marks=pytest.mark.slow)])
FEW = 8  # gates of what must be so in each of them, not in 95 %


@pytest.fixture(scope="module")
def any_run(tmp_path_factory) -> Side:
    return sides(make_run(tmp_path_factory.mktemp("any"), {("baseline", "s"): 1}))[0]


def simulated(random: np.random.Generator, any_run: Side, letter: str, factor: float, modes: float) -> Side:
    """A run of a gate on a shared runner: its hour, each round and each launch have their own speed. `modes`:
    how much longer a launch takes that falls into the second mode, half of them. `factor`: of all phases."""
    hour = math.exp(0.01 * random.standard_normal())
    rounds = np.exp(0.01 * random.standard_normal(LAUNCHES))
    shape = (len(PHASES), len(SCENES), LAUNCHES)
    times = 1e6 * hour * rounds * np.exp(0.0005 * random.standard_normal(shape))
    times *= np.where(random.random(shape) < 0.5, 1 + modes, 1)
    times[1:] *= factor
    at = np.indices(shape).reshape(3, -1)
    one = any_run.frames[~any_run.frames.warmup].iloc[0].to_dict()
    names = np.array(PHASES)[at[0]]
    told = {"spec": names, "phase": names, "flags_from": names, "scene": np.array(SCENES)[at[1]]}
    told |= {"launch": at[2], "round": at[2], "ns": times.ravel(), "config": [f"{a}{b}" for a, b in at[:2].T]}
    return Side(letter, any_run.run, pd.DataFrame(one | told, index=range(times.size)))


def failing(any_run: Side, gates: int, factor: float = 1.0, modes: float = 0.0, least: float = 0.0) -> int:
    """The gates of so many in which a phase is called slower than it was."""
    random, failed = np.random.default_rng(46), 0
    for _ in range(gates):
        base = simulated(random, any_run, "A", 1.0, modes)
        found = changes.rows(base, simulated(random, any_run, "B", factor, modes), "baseline", least, False)
        failed += any(row.verdict == SLOWER for row in changes.judged(found, "baseline", 0.001))
    return failed


@MANY
def test_identical_code_fails_in_no_more_than_5_percent_of_gates(any_run, gates) -> None:
    assert failing(any_run, gates) <= 0.05 * gates


@MANY
def test_two_per_mille_fail_every_gate_and_none_where_they_do_not_count(any_run, gates) -> None:
    assert failing(any_run, gates, factor=1.002) >= 0.95 * gates
    few = min(gates, FEW)
    assert failing(any_run, few, factor=1.002, least=0.02) == 0
    assert failing(any_run, few, factor=1.05, least=0.02) == few


@MANY
def test_launches_in_two_modes_fail_no_gate(any_run, gates) -> None:
    few = min(gates, FEW)
    assert failing(any_run, gates, modes=0.08) == 0
    assert failing(any_run, few, modes=0.08, factor=1.3) == few  # every launch beyond the other run's


def test_the_rank_test_is_exact() -> None:
    """Three and three values have 20 orders, one of them with all of the second at the top."""
    assert significance.longer([1, 2, 3], [4, 5, 6]) == pytest.approx(1 / 20)
    assert significance.longer([1, 2, 4], [3, 5, 6]) == pytest.approx(2 / 20)
    assert significance.longer([1, 2, 3], [4, 5, 6], least=1.4) == pytest.approx(10 / 20)
    assert significance.family(6) == 23  # 924 orders of 6 and 6, of which one in 40 is 23.1
    # Benjamini and Hochberg's own example, 15 p-values of which 4 are below .05 · 4 / 15
    theirs = [0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459]
    theirs += [0.3240, 0.4262, 0.5719, 0.6528, 0.7590, 1.0]
    assert sum(p <= 0.05 for p in significance.corrected(theirs)) == 4


@pytest.mark.slow
def test_chance_is_what_the_page_says() -> None:
    """At most 2.5 % of 250 gates of 18 verdicts on identical launches have a slower one."""
    random, failed, gates = np.random.default_rng(46), 0, 250
    for _ in range(gates):
        pairs = random.standard_normal((18, 2, LAUNCHES)) ** 2 + 1
        failed += min(significance.corrected([significance.longer(a, b) for a, b in pairs])) <= 0.025
    assert failed / gates <= 0.025 + 3 * math.sqrt(0.025 * 0.975 / gates)


def counted(made, **instructions: int) -> Path:
    """With a counts.json: phase → instructions on scene s."""
    total = {"calls": 1, "operations": [], "load_bytes": 0, "store_bytes": 0}
    about = {"scene": "s", "width": 16, "height": 9, "backend": "blocks", "variant": "shipped"}
    measured = [
        {"phase": phase, "functions": {}, "total": total | {"instructions": count}, **about}
        for phase, count in instructions.items()
    ]
    complete.write(made.path / "counts.json", {"declared": [], "measured": measured})
    return made.path


def by_instructions(tmp_path: Path, base: int, mine: int, ms: float = 100, **how: object):
    """The verdict on opt1, and the status of the gate. `ms`: its time, 100 in the base."""
    a = counted(make_run(tmp_path / "a", {("opt1", "s"): 100}, **how), opt1=base)
    b = counted(make_run(tmp_path / "b", {("opt1", "s"): ms}, **how), opt1=mine)
    words = (a, b, "--by", "instructions", "--least", "2%")
    (row,) = emitted.result(run(*words, "--json").stdout)["rows"]
    return row, run(*words, "--fail-on-slower").returncode


@pytest.mark.parametrize(
    ("base", "mine", "ms", "verdict"),
    [
        (100_000, 100_000, 100, SAME),
        (100_000, 100_100, 100, SLOWER),  # .1 % more work, which no clock shows
        (100_000, 100_099, 100, SAME),
        (100_000, 99_900, 100, FASTER),
        (100_000, 101_000, 80, FASTER),  # more work, and faster all the same
        (100_000, 100_000, 120, SLOWER),  # the same work, and slower: memory, say
        (100_000, 90_000, 120, SLOWER),
    ],
)
def test_work_is_the_first_witness_and_time_the_second(tmp_path, base, mine, ms, verdict) -> None:
    row, status = by_instructions(tmp_path, base, mine, ms)
    assert row["instructions"] == pytest.approx(base / mine)
    assert (row["verdict"].removesuffix(" or 2 %"), status) == (verdict, int(verdict == SLOWER))


def test_one_launch_is_enough_for_a_count(tmp_path) -> None:
    row, status = by_instructions(tmp_path, 1000, 1001, launches=1)
    assert (row["verdict"], status) == (SLOWER, 1)


def test_what_was_not_counted_stops_a_gate_by_instructions(tmp_path) -> None:
    a, b = (make_run(tmp_path / name, {("opt1", "s"): 1, ("opt2", "s"): 1}) for name in "ab")
    counted(a, opt1=5, opt2=5)
    counted(b, opt1=5)
    done = run(a.path, b.path, "--by", "instructions", "--fail-on-slower")
    assert done.returncode == 1 and done.stderr.count("FAIL") == 1 and "opt2 s" in done.stderr
    assert "stepwise flops" in done.stderr and "-n 9" in done.stderr
    allowed = ("--fail-on-slower", "--allow", "uncounted")
    assert run(a.path, b.path, "--by", "instructions", *allowed).returncode == 0


def test_a_gate_by_baseline_that_nobody_timed_beside_fails(tmp_path) -> None:
    a, b = (make_run(tmp_path / name, {("opt1", "s"): 1}) for name in "ab")
    done = run(a.path, b.path, "--by", "baseline", "--fail-on-slower")
    assert done.returncode == 1 and done.stderr.count("FAIL") == 1 and "opt1 s" in done.stderr
    times = {("baseline", "s"): 9, ("opt1", "s"): 1}  # baseline itself has no verdict
    a, b = (make_run(tmp_path / name, times) for name in "cd")
    assert run(a.path, b.path, "--by", "baseline", "--fail-on-slower").returncode == 0


def test_too_many_verdicts_for_so_few_launches_are_named(tmp_path) -> None:
    times = {(f"opt{i}", scene): 1 for i in range(1, 9) for scene in "stu"}  # 24 verdicts, 6 launches: 23
    runs = [make_run(tmp_path / name, times, launches=6).path for name in "ab"]
    assert any(line.startswith("6 launches") for line in run(*runs).stdout.splitlines())


@pytest.fixture
def again_runs(tmp_path, monkeypatch):
    """Two runs in which opt1 and opt2 look slower; files stand for the programs of both checkouts."""
    here = tmp_path / "here"
    monkeypatch.setattr(again, "ROOT", here)
    made = []
    for name, root, ms in (("a", tmp_path / "there", 100), ("b", here, 120)):
        one = make_run(tmp_path / name, {(f"opt{i}", "scene0"): ms for i in (1, 2)})
        binaries = {}
        for spec in ("opt1", "opt2"):
            program = root / "build" / spec / "render"
            program.parent.mkdir(parents=True)
            program.write_text(f"{name} {spec}")
            binaries[spec] = hashlib.sha256(program.read_bytes()).hexdigest()
        complete.write(one.path / "plan.json", {"binaries": binaries, "launches": 8, "reps": 3, "warmup": 1})
        made.append(one.path)
    return made


def test_what_looks_slower_fails_only_if_it_is_slower_again(again_runs, tmp_path, monkeypatch) -> None:
    """opt1 is; opt2 takes as long as before when both programs are launched by turns."""
    launched = []

    def render(spec, path, height, width, timed, **how):
        name, phase = spec.read_text().split()
        launched.append((name, phase, how["reps"], how["warmup"], path.stem))
        ms = 100 + len(launched) / 1000 + 20 * ((name, phase) == ("b", "opt1"))
        return again.launches.Made(frames=[again.launches.Frame(ns=ms * 1e6)])

    monkeypatch.setattr(again.launches, "render", render)
    words = (*again_runs, "--confirm", tmp_path / "there", "--seed", 1, "--least", "2%")
    rows = {row["spec"]: row for row in emitted.result(run(*words, "--json").stdout)["rows"]}
    assert {spec: row["verdict"] for spec, row in rows.items()} == {"opt1": SLOWER, "opt2": ONCE}
    assert rows["opt1"]["again"]["value"] == pytest.approx(100 / 120, rel=1e-3)
    assert rows["opt2"]["again"]["value"] == pytest.approx(1, rel=1e-3)
    counts = pd.Series(launched).value_counts()
    assert set(counts.index) == {(side, spec, 3, 1, "scene0") for side in "ab" for spec in ("opt1", "opt2")}
    assert set(counts) == {16}
    done = run(*words, "--fail-on-slower")
    assert done.returncode == 1 and done.stderr.count("FAIL") == 1 and "opt1 scene0" in done.stderr


def test_a_scene_that_was_given_as_a_file_is_launched_from_the_run(again_runs, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(registry, "_given", {})
    for path in again_runs:
        frames = path / "frames.jsonl"
        frames.write_text(frames.read_text().replace('"scene0"', '"mine"'))
    own = again_runs[1] / "own-scenes" / "mine.json"
    own.parent.mkdir()
    own.write_bytes(registry.scenes()["trio"].path.read_bytes())
    launched = []

    def render(spec, path, *_, **__):
        launched.append(path)
        return again.launches.Made(frames=[again.launches.Frame(ns=1e8 + len(launched))])

    monkeypatch.setattr(again.launches, "render", render)
    commands.called("compare", [*again_runs, "--confirm", tmp_path / "there"])
    assert set(launched) == {own}


def test_nothing_is_launched_where_nothing_looks_slower(again_runs, tmp_path) -> None:
    a, _ = again_runs
    assert run(a, a, "--confirm", tmp_path / "nowhere", "--fail-on-slower").returncode == 0


@pytest.mark.parametrize("fault", ["rebuilt", "gone", "three runs", "no phases"])
def test_only_the_programs_that_were_measured_confirm(again_runs, tmp_path, monkeypatch, fault) -> None:
    monkeypatch.setattr(again.launches, "render", lambda *_, **__: pytest.fail("launched"))
    program = tmp_path / "there" / "build" / "opt1" / "render"
    if fault == "rebuilt":
        program.write_text("another")
    elif fault == "gone":
        program.unlink()
    elif fault == "no phases":
        complete.write(again_runs[0] / "plan.json", {"programs": [{"name": "opt1"}]})
    runs = again_runs + again_runs[1:] * (fault == "three runs")
    done = run(*runs, "--confirm", tmp_path / "there")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    named = {"three runs": "3", "no phases": str(again_runs[0])}.get(fault, str(program))
    assert named in done.stderr
