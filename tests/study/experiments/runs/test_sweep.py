"""Sweeps: the plan and its rounds by rule, the measuring with the real driver at tiny sizes."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import emitted
import msgspec
import pytest
import started

from study.core import registry, store
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.core.run_schema import Plan

SMALL = ["--phase", "baseline", "opt1", "--scene", "cubes", "-n", "6", "9x9", "--seed", "3"]
SMALL += ["--launches", "2", "--reps", "2", "--warmup", "1"]


def command(*arguments: object) -> list[str]:
    return [sys.executable, str(ROOT / "scripts" / "stepwise"), "sweep", *map(str, arguments)]


def sweep(*arguments: object, **environment: str) -> subprocess.CompletedProcess:
    return started.run(command(*arguments), env=os.environ | environment, timeout=300)


def only_run(results: Path) -> store.Run:
    (plan,) = results.glob("*/*/plan.json")
    return store.Run.open(plan.parent)


def keys(frames) -> list[tuple]:
    return list(frames[["config", "launch", "frame"]].itertuples(index=False, name=None))


def everything(plan: Plan) -> set[tuple]:
    """(config, launch, frame) of all that a plan asks for."""
    frames, configs = range(-plan.warmup, plan.reps), [one.config for one in plan.configurations]
    return {(c, launch, frame) for c in configs for launch in range(plan.launches) for frame in frames}


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A finished run, and what the command printed."""
    results = tmp_path_factory.mktemp("results")
    done = sweep(*SMALL, "--results", results, "--json")
    assert done.returncode == 0, done.stderr
    return only_run(results), done


@pytest.mark.slow
def test_every_frame_once_with_its_context(measured):
    target, _ = measured
    frames, plan = target.frames(), target.plan
    assert set(keys(frames)) == everything(plan)
    assert len(frames) == len(everything(plan)) == 2 * 2 * 2 * 3
    assert (frames["warmup"] == (frames["frame"] < 0)).all()
    assert frames["env_bytes"].between(0, 4096).all()
    assert (frames.groupby(["config", "launch"])["env_bytes"].nunique() == 1).all()
    assert frames["env_bytes"].nunique() > 6
    assert (frames["cpu"] == plan.cpu).all()
    assert frames["time"].is_monotonic_increasing
    assert set(zip(frames["width"], frames["height"], strict=True)) == {(11, 6), (9, 9)}
    for one in plan.configurations:
        group = frames[frames["config"] == one.config]
        for key in ("spec", "scene", "scene_hash", "width", "height", "threads"):
            assert (group[key] == getattr(one, key)).all()
    assert plan.finished and plan.seed == 3 and set(plan.phases) == {"baseline", "opt1"}
    assert target.context.cpu.model
    assert target.context.end.steal_ticks >= target.context.steal_ticks


def test_result_is_one_json_object(measured):
    target, done = measured
    whole = emitted.whole(done.stdout)
    assert (whole["command"], whole["status"], whole["run"]) == ("sweep", "ok", str(target))
    said = whole["result"]
    assert [row["spec"] for row in said["rows"]] == ["baseline", "opt1"] * 2
    for row in said["rows"]:
        frames = target.frames()
        timed = frames[(frames["config"] == row["config"]) & ~frames["warmup"]]
        medians = timed.groupby("launch")["ns"].median()
        assert row["ms"]["value"] == pytest.approx(medians.median() / 1e6)
        assert row["ns_per_pixel"]["value"] == pytest.approx(medians.median() / row["width"] / row["height"])
        assert (row["ms"]["low"], row["ms"]["sufficient"]) == (None, False)  # two launches
    base, other = said["rows"][:2]
    assert other["speedup"]["value"] == pytest.approx(base["ms"]["value"] / other["ms"]["value"])
    assert any("under 3 launches" in warning for warning in said["warnings"])
    assert "sweep: 100 %, after " in done.stderr


def test_resuming_a_finished_run_measures_nothing(measured):
    target, _ = measured
    before = target.frames_path.read_bytes()
    done = sweep("--resume", "--run", target.path)
    assert done.returncode == 0, done.stderr
    assert target.frames_path.read_bytes() == before
    heading, *rows = done.stdout.splitlines()
    assert "ns/pixel" in heading and "× baseline" in heading
    assert len(rows) == 4


@pytest.mark.slow
def test_kill_in_mid_sweep_then_resume(tmp_path):
    """Three kills, the last with a line torn on top: every frame is there once, none was lost."""
    arguments = [*SMALL, "--launches", "6", "--reps", "6", "--results", tmp_path]
    before = b""
    for lines in (10, 25, 40):
        child = subprocess.Popen(command(*arguments), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            wait_for(lambda lines=lines: line_count(tmp_path) >= lines)
        finally:
            child.kill()
            child.wait()
        target = only_run(tmp_path)
        time.sleep(0.1)
        now = target.frames_path.read_bytes()
        assert now.startswith(before)
        before = now[: now.rfind(b"\n") + 1]
        assert target.plan.finished is None
        arguments = ["--resume", "--run", target.path]
    target.frames_path.write_bytes(before + b'{"schema": 1, "config": "')
    done = sweep("--resume", "--run", target.path)
    assert done.returncode == 0, done.stderr
    assert target.frames_path.read_bytes().startswith(before)
    frames = target.frames()
    assert len(frames) == len(everything(target.plan))
    assert set(keys(frames)) == everything(target.plan)
    assert target.plan.finished


def line_count(results: Path) -> int:
    return sum(path.read_bytes().count(b"\n") for path in results.glob("*/*/frames.jsonl"))


def wait_for(condition, seconds: float = 60) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.005)


@pytest.mark.slow
@pytest.mark.parametrize("kept", [1, 2, 3])
def test_a_cut_off_launch_is_completed(tmp_path, kept):
    """Cut after the warm-up frame, after one and after two of its three timed frames."""
    small = ["--phase", "baseline", "--scene", "cubes", "-n", "5", "--launches", "2", "--reps", "3"]
    assert sweep(*small, "--results", tmp_path).returncode == 0
    target = only_run(tmp_path)
    lines = target.frames_path.read_bytes().splitlines(keepends=True)
    prefix = b"".join(lines[: 4 + kept])
    target.frames_path.write_bytes(prefix)
    assert sweep("--resume", "--run", target.path).returncode == 0
    assert target.frames_path.read_bytes().startswith(prefix)
    frames = target.frames()
    assert sorted(keys(frames)) == sorted(everything(target.plan))
    assert frames["round"].tolist() == [0] * 4 + [1] * kept + [3] * (4 - kept)  # the second of its rounds


def test_a_run_of_other_programs_or_machine_is_not_continued(measured, tmp_path):
    target, _ = measured
    plan, context = target.plan, store.Run(target.path).context
    store.write_json(tmp_path / "context.json", context)
    store.write_json(tmp_path / "plan.json", msgspec.structs.replace(plan, binaries={"opt1": "0" * 64}))
    with pytest.raises(StudyError, match="another program"):
        emitted.told("sweep", "--resume", "--run", tmp_path)
    store.write_json(tmp_path / "context.json", msgspec.structs.replace(context, machine="other-6-1"))
    with pytest.raises(StudyError, match="another machine"):
        emitted.told("sweep", "--resume", "--run", tmp_path)


@pytest.mark.slow
def test_a_killed_driver_is_recorded_and_its_launch_completed(tmp_path):
    small = ["--phase", "baseline", "--scene", "cubes", "-n", "30", "--launches", "1", "--reps", "40"]
    child = subprocess.Popen(
        command(*small, "--results", tmp_path), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    wait_for(lambda: line_count(tmp_path) >= 3)
    driver = int(Path(f"/proc/{child.pid}/task/{child.pid}/children").read_text().split()[0])
    os.kill(driver, signal.SIGKILL)
    _, said = child.communicate(timeout=300)
    assert child.returncode == 1
    target = only_run(tmp_path)
    (failure,) = target.plan.failures
    assert (failure.spec, failure.launch, failure.status) == ("baseline", 0, -9)
    assert "SIGKILL" in said
    assert sorted(keys(target.frames())) == sorted(everything(target.plan))


def test_dry_run_measures_nothing(tmp_path, capsys):
    assert emitted.told("sweep", *SMALL, "--results", tmp_path / "no", "--dry-run", "--json") == 0
    said = emitted.result(capsys.readouterr().out)
    assert said["launches_to_do"] == 8 and 0 < said["estimated_s"] < 60
    assert len(said["configurations"]) == 4 and not (tmp_path / "no").exists()


@pytest.mark.slow
def test_what_the_budget_does_not_reach_is_said(tmp_path):
    done = sweep(*SMALL, "--results", tmp_path, "--budget", "0")
    assert done.returncode == 0, done.stderr
    target = only_run(tmp_path)
    assert len(target.plan.not_reached) == 4
    assert sweep("--resume", "--run", target.path, "--budget", "100").returncode == 0
    assert set(keys(target.frames())) == everything(target.plan)
    assert target.plan.not_reached == []


def test_overrides_are_recorded(tmp_path):
    limits = ["--launches", "1", "--hit-distance", "0.25", "--max-steps", "7"]
    assert emitted.told("sweep", *SMALL, *limits, "--results", tmp_path) == 0
    frames = only_run(tmp_path).frames()
    assert frames["overridden"].all()
    assert set(zip(frames["hit_distance"], frames["max_steps"], strict=True)) == {(0.25, 7)}


def test_what_cannot_run_here_is_skipped_with_the_reason(tmp_path):
    small = ["--scene", "cubes", "-n", "5", "--launches", "1", "--reps", "1"]
    both = ["--phase", "baseline", "opt3", "--second-base", *small, "--results", tmp_path]
    done = sweep(*both, "--threads", "1", "2", STEPWISE_ISA_LIMIT="none")
    assert done.returncode == 0, done.stderr
    plan = only_run(tmp_path).plan
    assert [one.spec for one in plan.skipped] == ["opt3", "opt2@opt3", "baseline"]
    assert "avx2, fma" in plan.skipped[0].reason and "one thread" in plan.skipped[2].reason
    assert {one.spec for one in plan.configurations} == {"baseline"}
    assert sweep("--phase", "opt3", *small, STEPWISE_ISA_LIMIT="none").returncode == 3


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--phase", "opt1", "--scene", "scene9"], "scene0"),
        (["--resume", "--run", "somewhere", "--seed", "1"], "--seed"),
        (["--resume", "--run", "somewhere"], "somewhere"),
        (["--run", "somewhere"], "--resume"),
        (["--resume"], "--run DIR"),
        (["--phase", "opt1", "--cpu", "4096"], "4096"),
    ],
)
def test_bad_arguments_are_refused(arguments, words):
    with pytest.raises(StudyError, match=words):
        emitted.told("sweep", *arguments)


@pytest.mark.slow
def test_phases_with_other_flags_bring_their_second_base_where_asked_to(tmp_path):
    if missing := registry.missing_isa(registry.find_phase("opt3")):
        pytest.skip(f"this CPU lacks {', '.join(missing)}")
    small = ["--phase", "opt3", "--scene", "cubes", "-n", "8", "--launches", "6", "--reps", "1"]
    small += ["--second-base"]
    done = sweep(*small, "--results", tmp_path, "--json")
    assert done.returncode == 0, done.stderr
    rows = {row["spec"]: row for row in emitted.result(done.stdout)["rows"]}
    assert set(rows) == {"opt3", "opt2@opt3"}
    assert rows["opt3"]["second_base"] == "opt2@opt3"
    ratio = rows["opt2@opt3"]["ms"]["value"] / rows["opt3"]["ms"]["value"]
    assert rows["opt3"]["second_speedup"]["value"] == pytest.approx(ratio)
    assert rows["opt3"]["second_speedup"]["sufficient"]
    assert (rows["opt3"]["speedup"], rows["opt2@opt3"]["second_speedup"]) == (None, None)
    assert (
        rows["opt3"]["parent"] is rows["opt3"]["parent_speedup"] is None
    )  # opt2 with flags of its own was not timed
    frames = only_run(tmp_path).frames()
    assert frames.groupby("spec")["flags"].unique().map(len).eq(1).all()
    assert frames["flags"].nunique() == 1  # the same flags, that is the point


def test_a_phase_is_compared_with_its_parent(tmp_path):
    small = ["--phase", "opt1", "opt2", "--scene", "cubes", "-n", "8", "--launches", "6", "--reps", "1"]
    done = sweep(*small, "--results", tmp_path, "--json")
    assert done.returncode == 0, done.stderr
    rows = {row["spec"]: row for row in emitted.result(done.stdout)["rows"]}
    ratio = rows["opt1"]["ms"]["value"] / rows["opt2"]["ms"]["value"]
    assert rows["opt2"]["parent_speedup"]["value"] == pytest.approx(ratio)
    assert rows["opt1"]["parent_speedup"] is None
