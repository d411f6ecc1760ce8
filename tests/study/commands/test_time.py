"""`stepwise time`: programs whose times are known since they print them, and what is done around a launch.

Wall times are nowhere pass or fail: what is held is what was launched, how often and in which surroundings.
"""

import functools
import json
import math
import shlex
import shutil
import sys
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import emitted
import pandas as pd
import pytest

from study.commands import time
from study.core import cli, machine
from study.core.cli import StudyError
from study.core.host.topology import USABLE
from study.core.run_schema import Frame, Plan
from study.core.store import Run
from study.numbers import noise

pytestmark = pytest.mark.usefixtures("few_resamples")

CONTEXT = functools.cache(machine.context)
FROM = ["--time-from", r"took ([0-9.]+)"]


@pytest.fixture(autouse=True)
def one_context(monkeypatch: pytest.MonkeyPatch) -> None:
    """The machine is asked once: half a second."""
    monkeypatch.setattr(machine, "context", CONTEXT)


@pytest.fixture(autouse=True)
def undisturbed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Times are printed: whoever else uses this machine interrupts none of them."""
    monkeypatch.setattr(noise, "PREEMPTIONS", math.inf)


@pytest.fixture
def timed(stepwise, tmp_path):
    """`stepwise time` with these words: rows, plan and frames of its run."""

    def once(*words: object) -> tuple[list[dict[str, Any]], Plan, list[Frame]]:
        done = stepwise("time", "--json", "--results", tmp_path / "results", "--seed", 1, *words)
        assert done.returncode == cli.OK, done.stderr
        said = emitted.whole(done.stdout)
        run = Run.open(said["run"])
        return said["result"]["rows"], run.plan, run.lines()

    return once


def script(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path


def counting(folder: Path, name: str, times: str) -> Path:
    """A program whose n-th launch prints the time, in ms, that the expression of n gives."""
    count = f"echo >>{folder}/{name}.n; n=$(wc -l <{folder}/{name}.n)"
    return script(folder, name, f"{count}\nawk 'BEGIN {{ n = '$n'; print \"took\", {times}, \"ms\" }}'")


def test_ratios_of_known_times(timed, stepwise, tmp_path):
    """Exact times need no more rounds than a verdict of two ratios does."""
    rows, plan, frames = timed(
        *FROM, "--", "echo", "took", "10 ms", ":::", "echo took 8ms", ":::", "echo", "took 10.02 ms"
    )
    assert [row["program"] for row in rows] == ["echo took '10 ms'", "echo took 8ms", "echo 'took 10.02 ms'"]
    assert [row["ms"]["value"] for row in rows] == [10, 8, 10.02]
    assert [row["ratio"] and row["ratio"]["value"] for row in rows] == pytest.approx([None, 1.25, 10 / 10.02])
    assert [row["verdict"] for row in rows] == ["", "faster", "slower"]
    assert rows[1]["base"] == rows[0]["program"] and rows[0]["ratio"] is None
    assert plan.launches == 11 and plan.precision == 0.01 and plan.finished and plan.time_from == FROM[1]
    assert {one.ns for one in frames} == {10_000_000, 8_000_000, 10_020_000}
    (table,) = (tmp_path / "results").glob("*/*")
    assert stepwise("tables", table, "-o", tmp_path).returncode == cli.OK
    read = pd.read_csv(tmp_path / "programs.csv")
    assert [*read["ms.value"]] == [10, 8, 10.02] and read["ratio.low"][1] == 1.25
    (row,), _, _ = timed(*FROM, "--launches", 1, "--", "echo", "took 1 ms", "me@host")
    assert shlex.split(row["program"]) == ["echo", "took 1 ms", "me@host"] and row["verdict"] == ""


def test_a_round_launches_each_program_once_in_random_order_with_random_padding(timed, tmp_path):
    see = "echo ${#STEPWISE_PADDING} $(grep Cpus_allowed_list /proc/self/status)"
    program = script(tmp_path, "see", f"{see} >>{tmp_path}/seen; echo took 1 ms")
    _, plan, frames = timed(
        *FROM, "--launches", 20, "--warmup", 2, "--cpu", USABLE[0], "--", program, ":::", program
    )
    names = [str(program), f"{program} (2)"]  # a program beside itself
    by_round = [[one.phase for one in frames if one.round == number] for number in range(22)]
    assert all(sorted(some) == names for some in by_round)
    assert len({tuple(some) for some in by_round}) == 2  # both orders
    assert [one.warmup for one in frames] == [True] * 4 + [False] * 40 and plan.warmup == 2
    assert len({one.env_bytes for one in frames}) > 30
    seen = [line for line in (tmp_path / "seen").read_text().splitlines() if "Cpus" in line]
    assert [int(line.split()[0]) for line in seen] == [one.env_bytes for one in frames]
    assert {line.split()[-1] for line in seen} == {str(USABLE[0])}


def test_user_time_and_peak_memory_are_the_program_s_own(timed):
    """200 MB that are written to are in it; this process, which is larger than `true`, is not."""
    words = [sys.executable, "-c", "b'x' * 200_000_000"]
    (big, small), _, frames = timed("--launches", 2, "--warmup", 0, "--", *words, ":::", "true")
    assert 190 < big["mib"] < 300 and small["mib"] < 10
    assert all(one.user_ns + one.system_ns > 0 for one in frames if one.phase != "true")
    assert big["verdict"] == "" and small["verdict"].startswith("unknown")


def test_cpu_time_is_compared_by_cpu_and_nobody_interrupts_it(timed, stepwise, monkeypatch):
    monkeypatch.setattr(noise, "PREEMPTIONS", 0)
    words = [sys.executable, "-c", "sum(range(10**5))"]
    rows, _, frames = timed("--by", "cpu", "--launches", 10, "--", *words, ":::", "sleep 0.01")
    assert all(one.ns == one.user_ns + one.system_ns for one in frames)
    assert rows[1]["ratio"]["value"] > 1 and rows[1]["ms"]["value"] < 10
    assert not any(row["left_out"] + row["disturbed"] for row in rows)
    assert stepwise("time", "--by", "cpu", *FROM, "--", "true").returncode == cli.BAD_INPUT


def test_a_gate_fails_for_what_is_surely_slower_by_more_than_least(stepwise, tmp_path):
    words = ["time", "--results", tmp_path, "--fail-on-slower", *FROM]
    programs = ["--", "echo took 10 ms", ":::", "echo took 10.3 ms"]
    assert stepwise(*words, "--launches", 9, *programs).returncode == 1
    assert stepwise(*words, "--launches", 9, "--least", "2%", *programs).returncode == 1
    assert stepwise(*words, "--launches", 9, "--least", "4%", *programs).returncode == cli.OK
    assert stepwise(*words, "--launches", 2, "--least", "4%", *programs).returncode == 1  # too few to tell
    assert (
        stepwise(*words, "--launches", 9, "--", "echo took 3 ms", ":::", "echo took 2 ms").returncode
        == cli.OK
    )


def test_warm_up_is_found_and_left_out(timed, tmp_path):
    """30, 20 and 15 ms, then 10 ms: the first launch that is no faster ends the warm-up."""
    program = counting(tmp_path, "warming", "n == 1 ? 30 : n == 2 ? 20 : n == 3 ? 15 : 10")
    (row,), plan, frames = timed(*FROM, "--budget", 60, "--", program)
    assert plan.warmup == 5 and [one.ns / 1e6 for one in frames][:6] == [30, 20, 15, 10, 10, 10]
    assert row["ms"]["value"] == 10 and row["launches"] == 9


def test_two_modes_have_no_verdict(stepwise, timed, tmp_path):
    """Every other launch takes 12 ms instead of 10: the median ratio is between 1.1 and .917."""
    steady, both = (
        script(tmp_path, "steady", "echo took 11 ms"),
        counting(tmp_path, "both", "(n % 2 ? 10 : 12) + n % 7 / 50"),
    )
    words = ["--budget", 60, "--launches", 30, "--", steady, ":::", both]
    (one, two), _, _ = timed(*FROM, *words)
    assert one["modes"] is None and one["verdict"] == "" and one["drift"] is None
    assert [two["modes"]["low"], two["modes"]["high"]] == pytest.approx([10.06, 12.06])
    assert two["verdict"].startswith("no verdict") and two["ratio"]["low"] < 1 < two["ratio"]["high"]
    done = stepwise("time", "--results", tmp_path, *FROM, *words)
    assert "10.06 ms (15" in done.stderr and "12.06 ms (15" in done.stderr


def test_drift_is_said_and_common_drift_hides_no_difference(stepwise, tmp_path):
    old, new = (counting(tmp_path, name, f"{ms} * (1 + n / 50)") for name, ms in (("old", 10), ("new", 9)))
    done = stepwise("time", "--results", tmp_path, *FROM, "--launches", 20, "--", old, ":::", new)
    assert done.stderr.count("drifted") == 2 and "faster" in done.stdout


@pytest.mark.slow
def test_every_value_of_vary_is_a_case(timed, tmp_path):
    """Ratios of one command are to the first value; of two to the first command."""
    program = "echo took {n} ms"
    rows, _, _ = timed(*FROM, "--vary", "n", "2,4", "--", program)
    assert [(row["case"], row["ms"]["value"]) for row in rows] == [("n=2", 2), ("n=4", 4)]
    assert {row["program"] for row in rows} == {program}
    assert rows[1]["ratio"]["value"] == 0.5 and rows[1]["base"] == f"{program} n=2"
    both = ["--vary", "n", "2,4", "--vary", "u", "ms,us", "--command-name", "A", "--command-name", "B"]
    rows, _, _ = timed(*FROM, *both, "--", "echo took {n} {u}", ":::", "echo", "took", "1{n} {u}")
    assert [row["case"] for row in rows] == [
        f"n={n} u={u}" for n in (2, 4) for u in ("ms", "us") for _ in "AB"
    ]
    assert [row["base"] for row in rows[1::2]] == [f"A {row['case']}" for row in rows[::2]]
    assert rows[2]["ms"]["value"] == 0.002 and rows[5]["ratio"]["value"] == pytest.approx(4 / 14)


def test_cases_are_exported_in_their_order_with_whole_values(timed, tmp_path):
    """Whatever the random order in which they were launched."""
    out = tmp_path / "cases.json"
    words = ["--vary", "n", "a 1,b 2", "--vary", "u", "x,y", "--export-json", out]
    timed("--launches", 1, "--warmup", 0, *words, "--", "echo {n} {u}", ":::", "echo", "-n", "{n}{u}")
    given = [one["parameters"] for one in json.loads(out.read_text())["results"]]
    cases = [{"n": n, "u": u} for n in ("a 1", "b 2") for u in "xy" for _ in range(2)]
    assert given == cases


def test_commands_around_the_launches(timed, tmp_path):
    """--prepare before each launch, of each command its own; --cleanup once for each command, at the end."""
    log = tmp_path / "log"
    around = [
        f"--prepare=echo before a >>{log}",
        f"--prepare=echo before b >>{log}",
        f"--cleanup=echo end >>{log}",
    ]
    words = [f"sh -c 'echo a >>{log}'", ":::", f"sh -c 'echo b >>{log}'"]
    timed("--launches", 3, "--warmup", 1, *around, "--", *words)
    lines = log.read_text().splitlines()
    assert len(lines) == 18 and lines[16:] == ["end", "end"]
    assert all(f"before {after}" == before for before, after in zip(lines[:16:2], lines[1:16:2], strict=True))


def test_ctrl_c_leaves_a_run_that_is_read(stepwise, tmp_path, monkeypatch):
    """In the seventh round after one of warm-up."""
    monkeypatch.setattr(time.Timing, "known", Mock(side_effect=[False] * 6 + [KeyboardInterrupt]))
    programs = ["--", "echo took 10 ms", ":::", "echo took 12 ms"]
    done = stepwise("time", "--results", tmp_path, "--warmup", 1, *FROM, *programs)
    (folder,) = tmp_path.glob("*/*")
    assert done.returncode == cli.INTERRUPTED and str(folder) in done.stderr and " 14 " in done.stderr
    (row, _) = emitted.result(stepwise("compare", folder, folder, "--json").stdout)["rows"]
    assert row["ms"]["launches"] == 7


def test_failures_input_and_shells(timed, stepwise, tmp_path):
    given = tmp_path / "given"
    given.write_text("took 3 ms\n")
    few = ["--results", tmp_path, "--launches", 1, "--warmup", 0]
    (row,), _, frames = timed(*FROM, "--launches", 1, "--input", given, "--", "cat")
    assert row["ms"]["value"] == 3
    timed("--launches", 1, "--input", "null", "--", "sh", "-c", "! read line")
    bad = ["--", "sh", "-c", "echo no >&2; exit 3"]
    refused = stepwise("time", *few, *bad)
    assert refused.returncode == cli.BAD_INPUT and "status 3: no" in refused.stderr
    assert stepwise("time", *few, "--ignore-failure", "1,2", *bad).returncode == cli.BAD_INPUT
    assert not list(tmp_path.glob("*/*/plan.json"))  # what cannot start leaves no run
    for ignore in ("--ignore-failure=3", "--ignore-failure"):
        _, _, frames = timed("--launches", 1, ignore, *bad)
        assert {one.exit_status for one in frames} == {3}
    killed = stepwise("time", *few, "--", "sh", "-c", "kill -9 $$")
    assert "signal 9" in killed.stderr
    out = tmp_path / "killed.json"
    timed("--launches", 1, "--ignore-failure", "--export-json", out, "--", "sh", "-c", "kill -9 $$")
    assert json.loads(out.read_text())["results"][0]["exit_codes"] == [128 + 9]  # as hyperfine has it
    (row,), _, _ = timed(*FROM, "--launches", 1, "--shell", "default", "--", "x=4; echo took $x ms")
    assert row["ms"]["value"] == 4
    (row,), _, _ = timed(*FROM, "--launches", 1, "--shell", "none", "--", "echo 'took 5 ms' ; $x")
    assert row["ms"]["value"] == 5  # no shell: ; is a word


def test_several_times_of_one_launch_count_as_their_median(timed):
    (row,), _, frames = timed(*FROM, "--launches", 6, "--", "echo", "took 1 ms, took 2 ms, took 9000 us")
    assert row["launches"] == 6 and row["ms"]["value"] == 2
    assert [one.frame for one in frames[-3:]] == [0, 1, 2] and frames[-1].ns == 9_000_000


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], ":::"),
        (["--", ":::", "true"], ":::"),
        (["--", "no-such-program"], "no-such-program"),
        (["--vary", "n", "1,2", "--", "true"], "{n}"),
        (["--prepare=true", "--prepare=true", "--", "true"], "--prepare"),
        (["--prepare=false", "--", "true"], "false: status 1"),
        (["--command-name=a", "--", "true", ":::", "true"], "--command-name"),
        (["--launches", "3", "--precision", "1%", "--", "true"], "--launches"),
        (["--input", "no-such-file", "--", "true"], "no-such-file"),
        (["--fail-on-slower", "--", "true"], "two programs"),
        (["--fail-on-slower", "--", "true", "::", "false"], ":::"),
        (["--cpu", "4097", "--", "true"], "CPU 4097"),
        (["--time-from", "took ([0-9]+)", "--", "echo", "nothing"], "finds nothing"),
        (["--time-from", "took (.+) ms", "--", "echo", "took long ms"], "'long'"),
        (["--time-from", "took ([0-9]+)", "--", "echo", "took 12 bytes"], "12 bytes"),
        (["--time-from", "took ([0-9]+)", "--", "echo", "took 0 ms"], "above 0"),
        (["--", "'"], "No closing quotation"),
        (["--", "sh", "-c", "kill -9 $PPID"], "launcher"),
    ],
)
def test_what_is_wrong_is_one_line(stepwise, tmp_path, words, said):
    done = stepwise("time", "--results", tmp_path, *words)
    assert done.returncode == cli.BAD_INPUT and said in done.stderr and done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "words",
    [
        ["--precision", "0"],
        ["--precision", "120%"],
        ["--time-from", "took"],
        ["--time-from", "("],
        ["--ignore-failure=x"],
    ],
)
def test_an_option_that_makes_no_sense_is_refused(stepwise, words):
    assert stepwise("time", *words, "--", "true").returncode == cli.BAD_INPUT


def test_interrupted_launches_are_in_no_comparison(stepwise, timed, tmp_path, monkeypatch):
    """The last 20 of 30 launches of 10 ms are made to take 30 ms, of which others had 20."""
    timed(*FROM, "--launches", 30, "--warmup", 0, "--", "echo took 10 ms")
    (before,) = (tmp_path / "results").glob("*/*")
    after = shutil.copytree(before, before.parent / "later")
    lines = [json.loads(line) for line in (after / "frames.jsonl").read_text().splitlines()]
    for place, line in enumerate(lines):
        line["ctx_involuntary"] = 0
        if place >= 10:
            line |= {"ns": 30e6, "user_ns": 10_000_000, "unused_ns": 20_000_000, "ctx_involuntary": 9}
    (after / "frames.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    monkeypatch.setattr(noise, "PREEMPTIONS", 20)
    (row,) = emitted.result(stepwise("compare", before, after, "--json").stdout)["rows"]
    assert row["time"]["value"] == 1 and row["time"]["launches"] == 10
    points = emitted.result(stepwise("compare", "--history", "echo took 10 ms", after, "--json").stdout)
    assert [one["ms"]["value"] for one in points["points"]] == [10]


BOTH = "echo took {n} ms"


@pytest.mark.slow
def test_such_runs_are_compared_exported_and_reported(stepwise, timed, tmp_path):
    """Two runs: the second one's `new` takes 12.5 ms instead of 10."""
    folders = []
    for ms in (10, 12.5):
        program = script(tmp_path, "new", f"echo took {ms} ms")
        words = [*FROM, "--vary", "n", "1,2", "--export-json", tmp_path / "direct.json"]
        timed(*words, "--", BOTH, ":::", f"{program} {{n}}")
        folders.append(max((tmp_path / "results").glob("*/*"), key=lambda path: path.stat().st_mtime_ns))
    with pytest.raises(StudyError, match="no run yet"):  # no experiment measures into it
        Run.latest(tmp_path / "results")
    result = emitted.result(stepwise("compare", *folders, "--json").stdout)
    times = {(row["spec"], row["scene"]): row["time"]["value"] for row in result["rows"]}
    assert times == pytest.approx(
        {(f"{program} {{n}}", case): 0.8 for case in ("n=1", "n=2")}
        | {(BOTH, case): 1 for case in ("n=1", "n=2")}
    )
    assert stepwise("compare", *folders, "--by", "instructions").returncode == cli.BAD_INPUT
    done = stepwise("compare", "--export", "hyperfine", folders[1])
    made = json.loads(done.stdout)
    assert made == json.loads((tmp_path / "direct.json").read_text())
    (found,) = [one for one in made["results"] if one["command"] != BOTH and one["parameters"] == {"n": "2"}]
    assert (
        found["times"] == [0.0125] * 11 and found["median"] == found["min"] == 0.0125 and found["stddev"] == 0
    )
    assert found["exit_codes"] == [0] * 11 and found["memory_usage_byte"][0] > 0 and found["user"] is not None
    shown = stepwise("compare", "--export", "github-action-benchmark", folders[1])
    assert {one["name"] for one in json.loads(shown.stdout)} == {
        f"{row['spec']} {row['scene']}" for row in result["rows"]
    }
    assert stepwise("report", folders[1], "-o", tmp_path / "page" / "index.html").returncode == cli.OK
    page = (tmp_path / "page" / "index.html").read_text()
    assert "n=2" in page and "12.5" in page and (tmp_path / "page" / "figures" / "launches.svg").is_file()
