"""Sweeps: the plan and its rounds by rule, the measuring with the real driver at tiny sizes."""

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import emitted
import pytest
import started
from hypothesis import given, settings
from hypothesis import strategies as st

from study.core import machine, registry, run, store
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.core.run import DriverError
from study.experiments.sweep import command as module
from study.experiments.sweep import plan as planning
from study.experiments.sweep.plan import Config
from study.numbers import summary

SMALL = ["--phase", "baseline", "opt1", "--scene", "cubes", "-n", "6", "9x9", "--seed", "3"]
SMALL += ["--launches", "3", "--reps", "2", "--warmup", "1"]


def command(*arguments: object) -> list[str]:
    return [sys.executable, str(ROOT / "scripts" / "stepwise"), "sweep", *map(str, arguments)]


def sweep(*arguments: object, **environment: str) -> subprocess.CompletedProcess:
    return started.run(command(*arguments), env=os.environ | environment, timeout=300)


def only_run(results: Path) -> store.Run:
    (plan,) = results.glob("*/*/plan.json")
    return store.Run.open(plan.parent)


def keys(frames) -> list[tuple]:
    return list(frames[["config", "launch", "frame"]].itertuples(index=False, name=None))


def everything(plan: dict) -> set[tuple]:
    """(config, launch, frame) of all that a plan asks for."""
    frames = range(-plan["warmup"], plan["reps"])
    configs = [entry["config"] for entry in plan["configurations"]]
    return {(c, launch, frame) for c in configs for launch in range(plan["launches"]) for frame in frames}


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A finished run, and what the command printed."""
    results = tmp_path_factory.mktemp("results")
    done = sweep(*SMALL, "--results", results, "--json")
    assert done.returncode == 0, done.stderr
    return only_run(results), done


# The plan


@pytest.mark.parametrize(
    ("text", "size"),
    [("720", (None, 720)), ("1", (None, 1)), ("800x600", (800, 600)), ("9x32768", (9, 32768))],
)
def test_sizes(text, size):
    assert module.size(text) == size


BAD_SIZES = [
    "0",
    "100000",
    "-1",
    "1.5",
    "x",
    "8x",
    "x8",
    "0x8",
    "32768x32768",
    "16384",
    "20000",
    "٣",
    "99999999999",
]


@pytest.mark.parametrize("text", [*BAD_SIZES, ""])
def test_bad_sizes_are_refused(text):
    with pytest.raises(argparse.ArgumentTypeError, match="a height like 720"):
        module.size(text)


@pytest.mark.parametrize(
    ("names", "second_base", "specs"),
    [
        ("opt1 opt1 opt2", True, "opt1 opt2"),
        ("opt3 opt4", True, "opt3 opt4 opt2@opt3"),
        ("opt4 opt3", True, "opt4 opt3 opt2@opt4"),
        ("opt3 opt4", False, "opt3 opt4"),
        ("opt2@opt4 opt3 opt4", True, "opt2@opt4 opt3 opt4"),
        ("opt2@opt1 opt2", True, "opt2"),
        ("opt2@opt3 opt2@opt4", True, "opt2@opt3"),
        ("opt3@opt4 opt3", True, "opt3 opt2@opt3"),
        ("opt4 opt5_threads opt6_wide", True, "opt4 opt5_threads opt6_wide opt2@opt4"),
        ("opt6_wide opt4", True, "opt6_wide opt4 opt2@opt6_wide"),
    ],
)
def test_specs_are_different_programs_with_the_second_base(names, second_base, specs):
    found = planning.wanted_specs(names.split(), second_base)
    assert [str(spec) for spec in found] == specs.split()


# Rounds and budget


def config(number: int, scene: str, seconds: float) -> Config:
    return Config(f"c{number}", "opt1", "opt1", "opt1", scene, "h", 16, 9, 1, seconds)


def planned(costs: dict[str, list[float]], budget=None, launches=4, seed=1) -> module.Sweep:
    numbers = iter(range(1000))
    configs = [config(next(numbers), scene, s) for scene, several in costs.items() for s in several]
    entries = [vars(each) for each in configs]
    plan = {"seed": seed, "launches": launches, "reps": 2, "warmup": 1, "configurations": entries}
    return module.Sweep(None, plan, budget)


COSTS = st.dictionaries(
    st.sampled_from("abcdef"), st.lists(st.floats(0.01, 100), min_size=1, max_size=5), min_size=1
)


@settings(deadline=None)
@given(COSTS, st.floats(0, 1000))
def test_a_round_takes_whole_comparisons_within_the_budget(costs, budget):
    made = planned(costs, budget)
    chosen = made.round(0)
    taken = {scene for scene in costs if any(c.scene == scene for c in chosen)}
    for scene in costs:
        assert sum(c.scene == scene for c in chosen) in (0, len(costs[scene]))
    assert sum(c.estimate_s for c in chosen) <= budget
    left_out = [sum(costs[scene]) for scene in costs if scene not in taken]
    if left_out:  # nothing is left out that is cheaper than what is in, or that would still fit
        assert min(left_out) >= max((sum(costs[scene]) for scene in taken), default=0)
        assert sum(c.estimate_s for c in chosen) + min(left_out) > budget * (1 - 1e-9) - 0.1


def test_a_round_is_a_shuffle_that_the_seed_fixes():
    costs = {"a": [1.0] * 8, "b": [1.0] * 8}
    orders = [[c.config for c in planned(costs, seed=seed).round(n)] for seed in (1, 2) for n in (0, 1)]
    assert orders[0] == [c.config for c in planned(costs, seed=1).round(0)]
    assert len(set(map(tuple, orders))) == 4
    assert all(sorted(order) == sorted(orders[0]) for order in orders)


def play(made: module.Sweep, budget=float("inf"), crash=(), actual=None) -> list[tuple[str, int]]:
    """Let the sweep measure with a clock and a driver that are made up; returns (config, launch).

    `crash`: configs, or (config, round); `actual`: config -> seconds where they are not as estimated.
    """
    clock, launched = [0.0], []
    made.deadline = budget

    def launch(config: Config) -> None:
        number = made.done(config)
        launched.append((config.config, number))
        clock[0] += (actual or {}).get(config.config, config.estimate_s)
        if {config.config, (config.config, made.now)} & set(crash):
            raise DriverError(-11, "killed by SIGSEGV")
        made.frames[(config.config, number)] = set(range(-1, made.plan["reps"]))

    made.launch = launch
    real, module.time.monotonic = module.time.monotonic, lambda: clock[0]
    try:
        made.measure()
    finally:
        module.time.monotonic = real
    return launched


def test_without_budget_every_configuration_is_launched_once_a_round():
    made = planned({"a": [1, 2], "b": [3]}, launches=3)
    launched = play(made)
    for number in range(3):
        assert sorted(launched[3 * number : 3 * number + 3]) == [(f"c{c}", number) for c in range(3)]
    assert len(launched) == 9


def test_the_budget_goes_to_what_still_fits():
    launched = play(planned({"dear": [20, 2], "cheap": [1, 1]}, launches=10), budget=60)
    counts = {c: sum(name == c for name, _ in launched) for c in ("c0", "c1", "c2", "c3")}
    assert counts == {"c0": 2, "c1": 2, "c2": 8, "c3": 8}  # 2 · 22 + 8 · 2 = 60
    dear = [name for name, _ in launched if name in ("c0", "c1")]
    assert sorted(dear[:2]) == ["c0", "c1"]  # in turns


def test_a_comparison_left_out_for_a_round_comes_back_when_it_fits():
    costs = {"dear": [10], "cheap": [4]}
    both = [("c0", 0), ("c1", 0), ("c1", 1)]
    assert sorted(play(planned(costs, launches=2), budget=27)) == both
    assert sorted(play(planned(costs, launches=2), budget=28)) == [*both[:1], ("c0", 1), *both[1:]]
    # Beside the cheap one it does not fit, but then that one takes less than expected.
    assert play(planned(costs, launches=1), budget=13) == [("c1", 0)]
    assert play(planned(costs, launches=1), budget=13, actual={"c1": 2}) == [("c1", 0), ("c0", 0)]


def test_measured_durations_replace_the_estimate():
    made = planned({"a": [1]}, budget=20, launches=10)
    made.seconds["c0"] = [9, 5, 6]
    assert made.expected(made.configs[0]) == 6
    assert made.round(0)
    made.seconds["c0"] = [21]
    assert made.round(0) == []


def test_a_crash_is_recorded_and_the_rest_goes_on(tmp_path, capsys):
    made = planned({"a": [1, 1, 1]}, launches=4)
    made.run = store.Run(tmp_path / "run")
    made.plan["failures"] = []
    launched = play(made, crash={"c1"})
    assert [name for name, _ in launched].count("c1") == module.MOST_CRASHES
    assert [name for name, _ in launched].count("c0") == 4
    failures = made.run.plan["failures"]
    assert [(f["config"], f["launch"], f["status"]) for f in failures] == [("c1", 0, -11)] * 2
    assert "failed: opt1 a: killed by SIGSEGV" in capsys.readouterr().err


def test_a_lost_launch_is_made_up_for_in_a_round_of_its_own(tmp_path):
    """Of four rounds the second is lost: its launch is of the third, the last of a fifth."""
    made = planned({"a": [1, 1]}, launches=4)
    made.run, made.plan["failures"], made.rounds = store.Run(tmp_path / "run"), [], 7
    rounds = []
    made.frames = Noted(lambda key: rounds.append((*key, made.now)))
    play(made, crash={("c1", 8)})
    assert sorted(rounds) == [
        *(("c0", launch, 7 + launch) for launch in range(4)),
        *(("c1", launch, 7 + launch + (launch > 0)) for launch in range(4)),
    ]


class Noted(dict):
    """Tells of every key that is set."""

    def __init__(self, tell) -> None:
        super().__init__()
        self.tell = tell

    def __setitem__(self, key, value) -> None:
        self.tell(key)
        super().__setitem__(key, value)


# The real driver


@pytest.mark.slow
def test_every_frame_once_with_its_context(measured):
    target, _ = measured
    frames, plan = target.frames(), target.plan
    assert set(keys(frames)) == everything(plan)
    assert len(frames) == len(everything(plan)) == 2 * 2 * 3 * 3
    assert (frames["warmup"] == (frames["frame"] < 0)).all()
    assert frames["env_bytes"].between(0, 4096).all()
    assert (frames.groupby(["config", "launch"])["env_bytes"].nunique() == 1).all()
    assert frames["env_bytes"].nunique() > 6
    assert (frames["cpu"] == plan["cpu"]).all()
    assert frames["time"].is_monotonic_increasing
    assert set(zip(frames["width"], frames["height"], strict=True)) == {(11, 6), (9, 9)}
    for entry in plan["configurations"]:
        group = frames[frames["config"] == entry["config"]]
        for key in ("spec", "scene", "scene_hash", "width", "height", "threads"):
            assert (group[key] == entry[key]).all()
    assert plan["finished"]
    assert plan["seed"] == 3
    assert set(plan["phases"]) == {"baseline", "opt1"}
    assert target.context["cpu"]["model"]
    assert target.context["end"]["steal_ticks"] >= target.context["steal_ticks"]


@pytest.mark.slow
def test_rounds_are_interleaved(measured):
    frames = measured[0].frames()
    launches = frames[["config", "launch"]].drop_duplicates()
    for number in range(3):
        block = launches.iloc[4 * number : 4 * number + 4]
        assert (block["launch"] == number).all()
        assert block["config"].nunique() == 4
    assert (frames["round"] == frames["launch"]).all()


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
        assert (row["ms"]["low"], row["ms"]["sufficient"]) == (None, False)  # three launches
    base, other = said["rows"][:2]
    assert other["speedup"]["value"] == pytest.approx(base["ms"]["value"] / other["ms"]["value"])
    assert any("under 6 launches" in warning for warning in said["warnings"])
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
        assert target.plan["finished"] is None
        arguments = ["--resume", "--run", target.path]
    target.frames_path.write_bytes(before + b'{"schema": 1, "config": "')
    done = sweep("--resume", "--run", target.path)
    assert done.returncode == 0, done.stderr
    assert target.frames_path.read_bytes().startswith(before)
    frames = target.frames()
    assert len(frames) == len(everything(target.plan))
    assert set(keys(frames)) == everything(target.plan)
    assert target.plan["finished"]


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
    copy = store.Run(tmp_path / "run")
    store.write_json(copy.path / "context.json", target.context)
    store.write_json(copy.path / "plan.json", target.plan | {"binaries": {"opt1": "0" * 64}})
    done = sweep("--resume", "--run", copy.path)
    assert done.returncode == 2
    assert "opt1 is another program now" in done.stderr
    store.write_json(copy.path / "plan.json", target.plan)
    store.write_json(copy.path / "context.json", target.context | {"machine": "other-6-1"})
    done = sweep("--resume", "--run", copy.path)
    assert done.returncode == 2
    assert "measured on another machine" in done.stderr


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"cpu": {"logical_cpus": 999}}, "logical cpus 999, here "),
        ({"cpu": {"cores": 777}}, "cores 777, here "),
        ({"cpu": {"microcode": "0xdead"}}, "microcode 0xdead, here "),
        ({"kernel": "4.4.0"}, "kernel 4.4.0, here "),
        ({"memory_kib": 1 << 20}, "memory 1.0 GiB, here "),
        ({"cpu": {"microcode": "0xdead"}, "kernel": "4.4.0"}, "microcode 0xdead, here "),
    ],
)
def test_resuming_on_another_machine_says_what_differs(tmp_path, capsys, change, said):
    """Before anything is built or measured; in one line; what is the same is not in it."""
    here = machine.context()
    then = here | {key: here[key] | value if key == "cpu" else value for key, value in change.items()}
    frames = tmp_path / "run" / "frames.jsonl"
    store.write_json(tmp_path / "run" / "plan.json", {"cpu": run.FASTEST, "binaries": {"opt1": "0" * 64}})
    store.write_json(tmp_path / "run" / "context.json", then)
    frames.write_text("")
    done = sweep("--resume", "--run", tmp_path / "run")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    start = f"stepwise sweep: {tmp_path / 'run'}: measured on another machine ("
    assert done.stderr.startswith(start + said) and done.stderr.endswith("); start a new run here\n")
    assert done.stderr.count(", here ") == sum(len(v) if key == "cpu" else 1 for key, v in change.items())
    assert frames.read_text() == ""


def test_a_changed_scene_is_not_mixed_in(tmp_path):
    plan = planned({"cubes": [1]}).plan | {"cpu": None, "hit_distance": None, "max_steps": None}
    plan["binaries"] = {"opt1": planning.sha256(module.build(registry.Spec("opt1", "opt1")))}
    made = module.Sweep(store.Run(tmp_path), plan, None)
    with pytest.raises(StudyError, match="scene cubes changed since the run began"):
        made.launch(made.configs[0])
    assert not (tmp_path / "frames.jsonl").exists()


def test_scenes_of_one_content_are_told_apart(monkeypatch):
    """A copy of a scene, before its first change: launches of the one must not count as the other's."""
    picture = {"frames": [{"ns": 1e6}], "width": 16, "height": 9, "scene_hash": "h"}
    monkeypatch.setattr(planning.run, "render", lambda *_, **__: picture)
    monkeypatch.setattr(planning, "build", lambda spec: Path(__file__))
    options = {"phase": ["baseline"], "scene": ["cubes", "trio"], "n": [(None, 9)], "threads": [1]}
    options |= {"second_base": False, "hit_distance": None, "max_steps": None, "budget": None, "cpu": 0}
    options |= {"seed": 1, "launches": 1, "reps": 3, "warmup": 1, "long": None}
    configurations = planning.make_plan(argparse.Namespace(**options))["configurations"]
    assert len({one["config"] for one in configurations}) == len(configurations) == 2


def test_frames_have_the_scenes_own_name(tmp_path, monkeypatch):
    """A driver's records are ASCII and short: szene_ü and szene_ö would be one scene, and no verified one."""
    frame = {"schema": 1, "phase": "opt1", "scene": "szene_??", "scene_hash": "h", "warmup": False}
    frames = [frame | {"frame": number} for number in range(2)]
    monkeypatch.setattr(module.run, "frames", lambda *_, **__: (each for each in frames))
    monkeypatch.setattr(module, "find_scene", lambda name: registry.Scene(name, tmp_path, {}, False))
    monkeypatch.setattr(module, "build", lambda spec: Path(__file__))
    plan = planned({"szene_ü": [1]}).plan | {"cpu": None, "hit_distance": None, "max_steps": None}
    plan["binaries"] = {"opt1": planning.sha256(Path(__file__))}
    target = store.Run(tmp_path)
    made = module.Sweep(target, plan, None)
    made.launch(made.configs[0])
    text = (tmp_path / "frames.jsonl").read_text(encoding="utf-8")
    assert [json.loads(line)["scene"] for line in text.splitlines()] == ["szene_ü"] * 2


def test_a_rebuilt_driver_is_not_mixed_in(tmp_path):
    plan = planned({"cubes": [1]}).plan | {"cpu": None, "hit_distance": None, "max_steps": None}
    made = module.Sweep(store.Run(tmp_path), plan | {"binaries": {"opt1": "0" * 64}}, None)
    with pytest.raises(StudyError, match="build/opt1/render was rebuilt since the run began"):
        made.launch(made.configs[0])


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
    (failure,) = target.plan["failures"]
    assert (failure["spec"], failure["launch"], failure["status"]) == ("baseline", 0, -9)
    assert "killed by SIGKILL" in said
    assert sorted(keys(target.frames())) == sorted(everything(target.plan))


@pytest.mark.slow
def test_a_full_disk_is_one_line_and_keeps_the_frames(tmp_path):
    if os.geteuid() != 0:
        pytest.skip("mounting a tmpfs of 64 KiB needs root: run as root to test a full disk")
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(tmp_path)]
    mounted = subprocess.run(mount, capture_output=True, text=True)
    if mounted.returncode != 0:
        pytest.skip(f"mount of a tmpfs is not permitted (CAP_SYS_ADMIN missing): {mounted.stderr.strip()}")
    try:
        done = sweep(*SMALL, "--launches", "20", "--results", tmp_path)
        target = only_run(tmp_path)
        assert done.returncode == 2
        assert (
            done.stderr.splitlines()[-1] == f"stepwise sweep: {target.frames_path}: No space left on device"
        )
        frames = target.frames()
        assert 20 < len(frames) < 200
        assert len(set(keys(frames))) == len(frames)
        assert target.plan["finished"] is None
    finally:
        subprocess.run(["umount", tmp_path], check=True)


def test_dry_run_measures_nothing(tmp_path):
    done = sweep(*SMALL, "--results", tmp_path / "no", "--dry-run")
    assert done.returncode == 0, done.stderr
    assert "12 launches, 2 timed frames and 1 of warm-up each" in done.stdout
    assert "estimated duration: " in done.stdout
    done = sweep(*SMALL, "--results", tmp_path / "no", "--dry-run", "--json")
    said = emitted.result(done.stdout)
    assert said["launches_to_do"] == 12
    assert 0 < said["estimated_s"] < 60
    assert len(said["configurations"]) == 4
    assert not (tmp_path / "no").exists()


@pytest.mark.slow
def test_what_the_budget_does_not_reach_is_said(tmp_path):
    done = sweep(*SMALL, "--results", tmp_path, "--budget", "0")
    assert done.returncode == 0, done.stderr
    assert "warning: budget: opt1 cubes 11x6 has 0 of 3 launches" in done.stderr
    assert done.stdout == "nothing was measured\n"
    target = only_run(tmp_path)
    assert len(target.plan["not_reached"]) == 4
    assert sweep("--resume", "--run", target.path, "--budget", "100").returncode == 0
    assert set(keys(target.frames())) == everything(target.plan)
    assert target.plan["not_reached"] == []


def test_overrides_are_recorded(tmp_path):
    arguments = [
        *SMALL,
        "--launches",
        "1",
        "--hit-distance",
        "0.25",
        "--max-steps",
        "7",
        "--results",
        tmp_path,
    ]
    assert sweep(*arguments).returncode == 0
    frames = only_run(tmp_path).frames()
    assert frames["overridden"].all()
    assert set(zip(frames["hit_distance"], frames["max_steps"], strict=True)) == {(0.25, 7)}


@pytest.mark.slow
def test_a_frame_longer_than_long_is_timed_once_without_warm_up(tmp_path):
    """--long 0: every frame is long. --long 1000: none is, and --reps and --warmup hold."""
    for long, per_launch in (("0", [0]), ("1000", [-1, 0, 1])):
        done = sweep(*SMALL, "--long", long, "--results", tmp_path / long)
        assert done.returncode == 0, done.stderr
        frames = only_run(tmp_path / long).frames()
        assert len(frames) == 3 * 4 * len(per_launch)  # launches, configurations
        assert all(sorted(g["frame"]) == per_launch for _, g in frames.groupby(["config", "launch"]))


@pytest.mark.parametrize(
    ("long", "asked", "once"),
    [(0.25, [180], [False, False]), (0.09, [180], [False, True]), (0.019, [90], [True, True])],
)
def test_whether_a_frame_is_long_is_seen_at_its_own_size(monkeypatch, long, asked, once):
    """Made up: 20 ms at n = 45, at 90 as long again, at 180 100 ms; by its pixels 80 and 320. A tiny frame
    says that both heights are near to --long, only one is, or the larger is long by far."""
    sizes = []

    def render(spec, path, height, width, **how):
        if height != planning.CALIBRATION_HEIGHT:
            sizes.append(height)
            assert (how["reps"], how["warmup"]) == (1, 0)
        ns = {45: 20e6, 90: 20e6, 180: 100e6}[height]
        return {"frames": [{"ns": ns}], "width": width, "height": height, "scene_hash": "h"}

    monkeypatch.setattr(planning.run, "render", render)
    monkeypatch.setattr(planning, "build", lambda spec: Path(__file__))
    options = {"phase": ["baseline"], "scene": ["cubes"], "n": [(None, 90), (None, 180)], "threads": [1]}
    options |= {"second_base": False, "hit_distance": None, "max_steps": None, "budget": None, "cpu": 0}
    options |= {"seed": 1, "launches": 1, "reps": 3, "warmup": 1, "long": long}
    plan = planning.make_plan(argparse.Namespace(**options))
    assert [one["once"] for one in plan["configurations"]] == once and sizes == asked


def test_what_cannot_run_here_is_skipped_with_the_reason(tmp_path):
    small = ["--scene", "cubes", "-n", "5", "--launches", "1", "--reps", "1"]
    both = ["--phase", "baseline", "opt3", "--second-base", *small, "--results", tmp_path]
    done = sweep(*both, "--threads", "1", "2", STEPWISE_ISA_LIMIT="none")
    assert done.returncode == 0, done.stderr
    plan = only_run(tmp_path).plan
    assert [skipped["spec"] for skipped in plan["skipped"]] == ["opt3", "opt2@opt3", "baseline"]
    assert plan["skipped"][0]["reason"] == "this CPU lacks avx2, fma"
    assert "one thread" in plan["skipped"][2]["reason"]
    assert {entry["spec"] for entry in plan["configurations"]} == {"baseline"}

    done = sweep("--phase", "opt3", *small, STEPWISE_ISA_LIMIT="none")
    assert done.returncode == 3
    assert (
        done.stderr.splitlines()[-1]
        == "stepwise sweep: nothing to measure: every phase and scene was skipped"
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--phase", "opt9"], "no phase 'opt9'; did you mean "),
        (["--phase", "opt1", "--scene", "scene9"], "no scene 'scene9'; did you mean scene0"),
        (["-n", "0"], "argument -n: '0': a height like 720"),
        (["-n", "100000"], "sides of 1 to 32768 pixels"),
        (["--reps", "0"], "argument --reps: '0': must be a whole number of at least 1"),
        (["--budget", "nan"], "argument --budget: 'nan': must be a number of at least 0"),
        (["--hit-distance", "0"], "argument --hit-distance: '0'"),
        (
            ["--resume", "--run", "somewhere", "--seed", "1"],
            "by the run's own plan, which --seed cannot change",
        ),
        (["--resume", "--run", "somewhere"], "somewhere: not a run"),
        (["--run", "somewhere"], "--run DIR --resume goes on with a run"),
        (["--resume"], "--run DIR --resume goes on with a run"),
        (["--phase", "opt1", "--cpu", "4096"], "CPU 4096 is not available"),
    ],
)
def test_bad_arguments_are_refused(arguments, words):
    done = sweep(*arguments)
    assert done.returncode == 2
    assert words in done.stderr.splitlines()[-1]
    assert done.stdout == ""


def test_an_unfinished_run_of_the_same_plan_is_pointed_out(measured, tmp_path):
    target, _ = measured
    plan = target.plan | {"finished": None}
    other = tmp_path / module.machine.slug() / "20250101-000000-x"
    store.write_json(other / "plan.json", plan)
    assert module.unfinished(plan, tmp_path) == str(other)
    assert module.unfinished(plan | {"reps": 9}, tmp_path) is None
    store.write_json(other / "plan.json", plan | {"finished": "2025"})
    assert module.unfinished(plan, tmp_path) is None


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


@pytest.mark.parametrize(
    ("words", "added"),
    [
        ([], True),
        (["--no-second-base"], False),
        (["--phase", "opt3", "opt4"], False),
        (["--phase", "opt3", "opt4", "--second-base"], True),
        (["--phase", "mine", *registry.ladder()], True),
    ],
)
def test_only_a_sweep_of_the_whole_ladder_adds_a_second_base(words, added):
    assert module.arguments(words).second_base is added


def test_every_ratio_names_its_base(measured):
    """Of a run of baseline and its child: the columns of ratios say over what, per row where it varies."""
    rows = summary.rows(measured[0].frames())
    head, *lines = summary.table(rows, summary.SPEED).splitlines()
    ratios = [name for _, name in summary.SPEED if name.startswith("×")]
    assert ratios == ["× baseline [95 %]", "× parent [95 %]", "× second base [95 %]"]
    assert {row["parent"] for row in rows if row["parent_speedup"]} == {"baseline"}
    assert "parent" in head.replace("× parent", "") and any(" baseline " in line for line in lines)


def test_this_process_leaves_the_measured_cpu(measured):
    assert measured[0].plan["cpu"] == run.FASTEST


def test_a_phase_is_compared_with_its_parent(tmp_path):
    small = ["--phase", "opt1", "opt2", "--scene", "cubes", "-n", "8", "--launches", "6", "--reps", "1"]
    done = sweep(*small, "--results", tmp_path, "--json")
    assert done.returncode == 0, done.stderr
    rows = {row["spec"]: row for row in emitted.result(done.stdout)["rows"]}
    ratio = rows["opt1"]["ms"]["value"] / rows["opt2"]["ms"]["value"]
    assert rows["opt2"]["parent_speedup"]["value"] == pytest.approx(ratio)
    assert rows["opt1"]["parent_speedup"] is None
