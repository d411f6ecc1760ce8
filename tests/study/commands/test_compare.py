"""Two runs side by side, made up so that the answer is known."""

import json
from pathlib import Path

import complete
import emitted
import pytest
from compared import make_run, rows, run, sides

from study.measuring import changes
from study.numbers import noise

pytestmark = pytest.mark.usefixtures("few_resamples")


TIMES = {("opt1", "s"): 100, ("opt1", "t"): 50, ("opt2", "s"): 30}
LATER = {("opt1", "s"): 50, ("opt1", "t"): 100, ("opt2", "s"): 30, ("opt3", "s"): 5}


@pytest.fixture
def two(tmp_path):
    a = make_run(tmp_path / "a", TIMES)
    return a, make_run(tmp_path / "b", LATER, {"libc": "glibc 2.40"}, compiler="gcc 13", libc="2.40")


def clocked(ghz, ms, tsc=2.5) -> dict:
    """The figures of a frame of so many ms at a clock."""
    hz = {name: ghz * 1e9 for name in ("core_hz_before", "core_hz_after")}
    return hz | {"tsc_hz": tsc * 1e9, "core_cycles": ms * ghz * 1e6}


def test_ratios_are_those_of_the_medians(two):
    found = rows(*two)
    assert set(found) == set(TIMES)
    for key, row in found.items():
        assert row.time.value == pytest.approx(TIMES[key] / LATER[key])
        assert row.time.low <= row.time.value <= row.time.high
        assert (row.cycles, row.clock, row.moved) == (None, None, "")  # not measured
    verdicts = {key: row.verdict for key, row in found.items()}
    assert verdicts == {
        ("opt1", "s"): "faster",
        ("opt1", "t"): "slower",
        ("opt2", "s"): changes.SAME,
    }
    assert found["opt1", "s"].base_ms.value == pytest.approx(100, rel=0.01)


def test_time_is_cycles_over_clock_and_what_moved_is_named(tmp_path):
    """A clock that is 10 % higher with the same cycles; then half the cycles at the same clock; then both."""
    base = make_run(tmp_path / "a", {("opt1", "s"): 110}, **clocked(3.0, 110))
    for ghz, ms, moved, cycles in (
        (3.3, 100, "clock", 1),
        (3.0, 55, "cycles", 2),
        (3.3, 50, "cycles and clock", 2),
    ):
        other = make_run(tmp_path / moved, {("opt1", "s"): ms}, **clocked(ghz, ms))
        row = rows(base, other)["opt1", "s"]
        assert (row.moved, row.verdict) == (moved, "faster")
        assert row.cycles.value == pytest.approx(cycles)
        assert row.clock.value == pytest.approx(ghz / 3)
        assert row.time.value == pytest.approx(row.cycles.value * row.clock.value)
        by_cycles = rows(base, other, by="cycles")["opt1", "s"].verdict
        assert by_cycles == ("faster" if cycles > 1 else changes.SAME)


def test_too_few_launches_give_no_verdict(tmp_path):
    runs = [make_run(tmp_path / name, {("opt1", "s"): ms}, launches=3) for name, ms in [("a", 1), ("b", 9)]]
    (row,) = rows(*runs).values()
    assert row.verdict == changes.FEW
    assert run(runs[0].path, runs[1].path, "--fail-on-slower").returncode == 1
    assert run(runs[0].path, runs[1].path, "--fail-on-slower", "--allow", "few").returncode == 0


CPU = {"model": "Some CPU", "logical_cpus": 2}


def pinned(kind):
    return {"pinned": {"cpu": 1, "core_type": kind}}


@pytest.mark.parametrize(
    ("context", "frames", "kind", "said"),  # of the second run; what the third line names
    [
        ({}, {"scene_hash": "bb"}, "scene", "scene_hash"),
        ({}, {"hit_distance": 1e-3}, "scene", "hit_distance"),
        ({}, {"max_steps": 10}, "scene", "max_steps"),
        ({"cpu": CPU | {"model": "Other CPU"}}, {}, "machine", changes.NONE),
        ({"cpu": CPU | {"logical_cpus": 8}}, {}, "machine", changes.NONE),
        ({}, clocked(3, 10, 2.6), "machine", changes.NONE),
        (pinned("E-core"), {}, "machine", "P-core and E-core"),  # of one hybrid processor
        ({}, {"width": 32, "height": 18}, "size", "16x9 and 32x18"),
    ],
)
def test_what_differs_is_said_first_and_has_no_verdict(tmp_path, context, frames, kind, said):
    here = {"cpu": CPU} | pinned("P-core")
    a = make_run(tmp_path / "a", TIMES, here, **clocked(3, 10))
    b = make_run(tmp_path / "b", TIMES, here | context, **clocked(3, 10) | frames)
    verdicts = set() if kind == "size" else {f"no verdict (other {kind})"}
    assert {row.verdict for row in rows(a, b).values()} == verdicts
    done = run(a.path, b.path)
    assert done.returncode == 0 and said in done.stdout.splitlines()[2]
    assert run(a.path, b.path, "--fail-on-slower").returncode == 1
    assert run(a.path, b.path, "--fail-on-slower", "--allow", kind).returncode == 0


@pytest.mark.parametrize("kind", ["P-core", None])  # where one run does not say, nothing differs
def test_one_kind_of_core_is_one_machine(tmp_path, kind):
    a, b = (make_run(tmp_path / name, TIMES, pinned(of)) for name, of in [("a", "P-core"), ("b", kind)])
    assert {row.verdict for row in rows(a, b).values()} == {changes.SAME}


def test_a_launch_with_another_clock_is_flagged_and_can_be_left_out(tmp_path):
    """Launch 3 of one configuration at 3.2 GHz among those at 3.0; launch 5 with another TSC rate."""
    made = make_run(tmp_path / "a", {("opt1", "s"): 100}, **clocked(3.0, 100))
    lines = [json.loads(line) for line in made.frames_path.read_text().splitlines()]
    for line in lines:
        line |= clocked(3.2, 100) if line["launch"] == 3 else {}
        line |= clocked(3.0, 100, 2.501) if line["launch"] == 5 else {}
    made.frames_path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    (side,) = sides(made)
    assert [(one.launch, one.what, one.hz) for one in side.off] == [(5, "timer", 2.501e9), (3, "core", 3.2e9)]
    assert set(side.frames["launch"]) == set(range(8))
    (rest,) = sides(made, leave_out=True)
    assert set(rest.frames["launch"]) == {0, 1, 2, 4, 6, 7}
    for option in ([], ["--leave-out-off-clock"]):
        said = run(made.path, made.path, *option).stdout
        assert "launch 3: core 3.2" in said and "launch 5: timer 2.501" in said
    assert any(line.startswith("2 launches") for line in noise.remarks(made.frames(), []))


def test_many_runs_beside_one_base(two, tmp_path):
    third = make_run(tmp_path / "c", {("opt1", "s"): 25})
    paths = [each.path for each in (*two, third)]
    said = emitted.result(run(*paths, "--json").stdout)
    builds = {"A": "gcc 12, glibc 2.36, -O3", "B": "gcc 13, glibc 2.40, -O3"}
    assert said["differences"]["build of opt2"] == builds and "opt3 s" in " ".join(said["new"])
    found = {(r["spec"], r["scene"], r["run"]): r["time"]["value"] for r in said["rows"]}
    wanted = {("opt1", "s", "B"): 2, ("opt1", "s", "C"): 4, ("opt1", "t", "B"): 0.5, ("opt2", "s", "B"): 1}
    assert found == pytest.approx(wanted)
    assert said["runs"] == dict(zip("ABC", map(str, paths), strict=True))
    missing = [(one["run"], one["text"].split()[-3]) for one in said["missing"]]
    assert missing == [("C", "opt2"), ("C", "opt1")]
    assert run(third.path).returncode == 2


def test_a_setting_of_the_machine_that_differs_is_named(tmp_path):
    first, second = (
        {"boost": one, "huge_pages": other} for one, other in (("1", "always"), ("0", "madvise"))
    )
    runs = [make_run(tmp_path / str(i), TIMES, more) for i, more in enumerate((first, second))]
    differ = emitted.result(run(*(each.path for each in runs), "--json").stdout)["differences"]
    assert differ == {name: {"A": first[name], "B": second[name]} for name in first}


def test_status_tells_of_something_slower(two, tmp_path):
    a, b = (each.path for each in two)
    done = run(a, b, "--fail-on-slower")
    assert done.returncode == 1 and done.stderr.count("FAIL") == 1 and "opt1 t" in done.stderr
    assert run(a, b).returncode == 0
    quick = make_run(tmp_path / "quick", {key: ms / 2 for key, ms in TIMES.items()})
    assert run(a, quick.path, "--fail-on-slower").returncode == 0


def verified(made, **within) -> Path:
    """With a verify.json: phase → within its tolerance on scene s, or None (not judged)."""
    pairs = [{"phase": phase, "scene": "s", "within_tolerance": value} for phase, value in within.items()]
    complete.write(made.path / "verify.json", {"pairs": pairs})
    return made.path


@pytest.mark.parametrize(
    ("times", "within", "kind"),
    [
        ({("opt1", "s"): 1}, {"opt1": True, "opt2": True}, "vanished"),
        ({}, {"opt1": True, "opt2": False}, "failed"),
        ({}, {"opt1": True}, "unverified"),
        ({}, {"opt1": True, "opt2": None}, "unverified"),
    ],
)
def test_a_phase_that_is_gone_or_wrong_or_unjudged_stops_the_gate(tmp_path, times, within, kind):
    both = {("opt1", "s"): 1, ("opt2", "s"): 1}
    a = verified(make_run(tmp_path / "a", both), opt1=True, opt2=True)
    b = verified(make_run(tmp_path / "b", times or both), **within)
    done = run(a, b, "--fail-on-slower")
    assert done.returncode == 1 and done.stderr.count("FAIL") == 1 and "opt2 s" in done.stderr
    assert run(a, b, "--fail-on-slower", "--allow", kind).returncode == 0
    assert run(a, b).returncode == 0
    assert run(a, a, "--fail-on-slower").returncode == 0


def test_nothing_to_compare_is_an_error(two, tmp_path):
    other = make_run(tmp_path / "other", {("opt4", "s"): 1})
    assert run(two[0].path, other.path).returncode == 2
    empty = make_run(tmp_path / "empty", {})
    done = run(two[0].path, empty.path)
    assert done.returncode == 2
    assert str(empty.path) in done.stderr
    assert "not a run" in run(two[0].path, tmp_path).stderr
