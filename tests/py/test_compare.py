"""Two runs side by side, made up so that the answer is known."""

import json
import subprocess
import sys

import complete
import emitted
import numpy as np
import pytest
import started

from study.commands import compare
from study.core import store
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.core.run_schema import Frame
from study.core.store import Run

CONTEXT = {"cpu": {"model": "Some CPU"}, "git": {"commit": "1" * 40, "dirty": False}, "libc": "glibc 2.36"}
LINE = {"schema": 1, "scene_hash": "aa", "width": 16, "height": 9, "threads": 1, "steal_ticks": 0}
LINE |= {"hit_distance": 1e-6, "max_steps": 3000, "flags": "-O3", "compiler": "gcc 12", "libc": "2.36"}


def make_run(folder, times, context=None, launches=8, **line) -> Run:
    """A run with the given milliseconds of each (phase, scene), 1 % of noise and a slow warm-up frame."""
    made = Run(folder)
    store.write_json(made.path / "plan.json", {})
    store.write_json(made.path / "context.json", CONTEXT | (context or {}))
    noise = 1 + 0.01 * np.random.default_rng(1).standard_normal(launches)
    for (phase, scene), ms in times.items():
        for launch in range(launches):
            for frame in (-1, 0):
                facts = {"phase": phase, "flags_from": phase, "scene": scene, "config": phase + scene}
                facts |= {"launch": launch, "frame": frame, "warmup": frame < 0}
                ns = 1_000_000_000 if frame < 0 else round(ms * 1e6 * noise[launch])
                made.append_frame(complete.filled(LINE | facts | {"ns": ns} | line, Frame))
    made.close()
    return made


TIMES = {("opt1", "s"): 100, ("opt1", "t"): 50, ("opt2", "s"): 30}
LATER = {("opt1", "s"): 50, ("opt1", "t"): 100, ("opt2", "s"): 30, ("opt3", "s"): 5}


@pytest.fixture
def two(tmp_path):
    context = {"libc": "glibc 2.40", "cpu": {"model": "Other CPU"}}
    a = make_run(tmp_path / "a", TIMES)
    return a, make_run(tmp_path / "b", LATER, context, compiler="gcc 13", libc="2.40")


def run(*arguments) -> subprocess.CompletedProcess:
    command = [sys.executable, ROOT / "scripts" / "stepwise", "compare", *arguments]
    return started.run(command)


def test_ratios_are_those_of_the_medians(two):
    rows = {(row["spec"], row["scene"]): row for row in compare.rows(*(each.frames() for each in two))}
    assert set(rows) == set(TIMES)
    for key, row in rows.items():
        assert row["ratio"].value == pytest.approx(TIMES[key] / LATER[key])
        assert row["ratio"].low <= row["ratio"].value <= row["ratio"].high
    verdicts = {key: row["verdict"] for key, row in rows.items()}
    assert verdicts == {
        ("opt1", "s"): "faster",
        ("opt1", "t"): "slower",
        ("opt2", "s"): "the same within noise",
    }
    assert rows["opt1", "s"]["a_ms"].value == pytest.approx(100, rel=0.01)


def test_swapped_runs_give_the_inverse(two):
    a, b = (each.frames() for each in two)
    for there, back in zip(compare.rows(a, b), compare.rows(b, a), strict=True):
        assert there["ratio"].value * back["ratio"].value == pytest.approx(1)


def test_too_few_launches_give_no_verdict(tmp_path):
    runs = [make_run(tmp_path / name, {("opt1", "s"): ms}, launches=3) for name, ms in [("a", 1), ("b", 9)]]
    (row,) = compare.rows(*(each.frames() for each in runs))
    assert row["verdict"] == "unknown (too few launches)"
    assert not row["ratio"].sufficient
    assert run(runs[0].path, runs[1].path, "--fail-on-slower").returncode == 0


@pytest.mark.parametrize("change", [{"scene_hash": "bb"}, {"hit_distance": 1e-3}, {"max_steps": 10}])
def test_other_work_is_not_compared(tmp_path, change):
    a, b = make_run(tmp_path / "a", TIMES), make_run(tmp_path / "b", TIMES, **change)
    (name,) = change
    with pytest.raises(StudyError, match=f"s: {name} differs .* only the same work can be compared"):
        compare.rows(a.frames(), b.frames())
    done = run(a.path, b.path)
    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1)


def test_json(two):
    done = run(two[0].path, two[1].path, "--json")
    assert done.returncode == 0, done.stderr
    said = emitted.result(done.stdout)
    assert [row["verdict"] for row in said["rows"]] == ["faster", "the same within noise", "slower"]
    assert said["differences"] == {
        "libc": ["glibc 2.36", "glibc 2.40"],
        "cpu.model": ["Some CPU", "Other CPU"],
        "build of opt1": ["gcc 12, glibc 2.36, -O3", "gcc 13, glibc 2.40, -O3"],
        "build of opt2": ["gcc 12, glibc 2.36, -O3", "gcc 13, glibc 2.40, -O3"],
    }
    assert (said["only_a"], said["only_b"]) == ([], ["s 16 9 1 opt3"])


def test_text(two):
    done = run(two[0].path, two[1].path)
    assert done.returncode == 0, done.stderr
    assert "A / B [95 %]" in done.stdout
    assert "only in B: s 16 9 1 opt3" in done.stdout
    assert "    A  Some CPU\n    B  Other CPU\n" in done.stdout
    done = run(two[0].path, two[0].path)
    assert "machine, compiler and commit are the same" in done.stdout


def test_status_tells_of_something_slower(two, tmp_path):
    a, b = (each.path for each in two)
    assert run(a, b, "--fail-on-slower").returncode == 1
    assert run(a, b).returncode == 0
    quick = make_run(tmp_path / "quick", {key: ms / 2 for key, ms in TIMES.items()})
    assert run(a, quick.path, "--fail-on-slower").returncode == 0


def test_nothing_to_compare_is_an_error(two, tmp_path):
    other = make_run(tmp_path / "other", {("opt4", "s"): 1})
    assert "no phase, scene and size in common" in run(two[0].path, other.path).stderr
    empty = make_run(tmp_path / "empty", {})
    done = run(two[0].path, empty.path)
    assert done.returncode == 2
    assert f"no timed frame; measure with scripts/stepwise sweep --run {empty.path} --resume" in done.stderr
    assert "not a run" in run(two[0].path, tmp_path).stderr


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"ns": -5}, "$.ns: Expected `int` >= 1"),
        ({"ns": "x"}, "$.ns: Expected `int`, got `str`"),
        ({"ns": True}, "$.ns: Expected `int`, got `bool`"),
        ({"width": 0}, "$.width: Expected `int` >= 1"),
        ({"launch": None}, "$.launch: Expected `int`, got `null`"),
        ({"flags": []}, "$.flags: Expected `str`, got `array`"),
        ({"scene_hash": None}, "$.scene_hash: Expected `str`, got `null`"),
        ({"warmup": "no"}, "$.warmup: Expected `bool`, got `str`"),
    ],
)
def test_a_damaged_figure_is_told_by_file_and_line(two, change, said):
    whole = two[0].frames_path.read_text().splitlines()
    whole[2] = json.dumps(json.loads(whole[2]) | change)
    two[0].frames_path.write_text("\n".join(whole) + "\n")
    done = run(two[0].path, two[1].path)
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert f"frames.jsonl:3: not what scripts/stepwise sweep writes ({said})" in done.stderr


@pytest.mark.parametrize("content", ["null", "[]", "3", '{"cpu": 7}', '{"git": "x"}', "[" * 100_000])
def test_a_damaged_context_is_told_in_one_line(two, content):
    (two[1].path / "context.json").write_text(content)
    done = run(two[0].path, two[1].path)
    assert done.returncode == 2 and len(done.stderr.strip().splitlines()) == 1
    assert "context.json: " in done.stderr


def test_a_full_disk_behind_the_output_is_told_in_one_line(two):
    command = [sys.executable, ROOT / "scripts" / "stepwise", "compare", two[0].path, two[1].path]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stderr.strip() == "stepwise compare: standard output: No space left on device"
