"""The driver as a child process: pinned, parsed, its end looked after."""

import os
import time
from pathlib import Path

import processes
import pytest

from study.core import run
from study.core.registry import ROOT
from study.core.run import DriverError

SCENE = ROOT / "common" / "scenes" / "cubes.json"


def test_render_gives_the_drivers_object():
    got = run.render("baseline", SCENE, 3, 7, reps=2, warmup=1, cpu=run.FASTEST, max_steps=50)
    assert (got["phase"], got["flags_from"], got["scene"]) == ("baseline", "baseline", "cubes")
    assert (got["width"], got["height"], got["threads"]) == (7, 3, 1)
    assert (got["cpu"], got["max_steps"], got["overridden"]) == (run.FASTEST, 50, True)
    warmups = [frame["warmup"] for frame in got["frames"]]
    assert warmups == [True, False, False]


def test_frames_come_one_by_one_with_all_facts():
    got = list(run.frames("baseline", SCENE, 3, reps=2, warmup=1, env_bytes=7))
    assert [frame["frame"] for frame in got] == [-1, 0, 1]
    assert all(frame["width"] == 5 and frame["ns"] > 0 for frame in got)


def test_clocks_are_measured_unless_the_picture_alone_is_wanted(monkeypatch):
    monkeypatch.setenv(run.UNTIMED, "1")  # what the environment says is not asked: a timing has its clocks
    assert run.render("baseline", SCENE, 3)["tsc_hz"] > 1e8
    assert next(run.frames("baseline", SCENE, 3))["core_hz_before"] > 1e8
    monkeypatch.delenv(run.UNTIMED)
    assert run.render("baseline", SCENE, 3, timed=False)["tsc_hz"] == 0


@pytest.mark.parametrize("aov", [False, True])
def test_picture_is_written(tmp_path, aov):
    got = run.render("baseline", SCENE, 3, aov=aov, out=tmp_path / "a.exr")
    assert got["image"] == str(tmp_path / "a.exr")
    channels = (tmp_path / "a.exr").read_bytes()[:1000]  # the header lists them
    assert (b"evals" in channels) == aov


@pytest.mark.parametrize(
    ("spec", "options", "status", "words"),
    [
        ("baseline", {"scene_path": ROOT / "no.json"}, 2, "no.json"),
        ("baseline", {"height": 0}, 2, "-n"),
        ("baseline", {"threads": 2}, run.UNSUPPORTED, "one thread"),
        ("baseline", {"out": "/no/such/folder/a.exr"}, 2, "/no/such/folder"),
    ],
)
def test_refusals_keep_status_and_reason(spec, options, status, words):
    with pytest.raises(DriverError, match=words) as error:
        run.render(spec, **({"scene_path": SCENE, "height": 3} | options))
    assert error.value.status == status
    assert "\n" not in str(error.value)


def test_a_cpu_that_is_not_there_is_refused():
    with pytest.raises(run.StudyError, match="CPU 4096"):
        run.render("baseline", SCENE, 3, cpu=4096)


def test_closing_early_kills_the_child():
    before = processes.children(os.getpid())
    frames = run.frames("baseline", SCENE, 9, reps=100_000)
    next(frames)
    (child,) = processes.children(os.getpid()) - before
    assert processes.is_alive(child)
    frames.close()
    assert not processes.is_alive(child)


def test_a_signal_and_garbage_are_driver_errors(tmp_path):
    with pytest.raises(DriverError, match="killed by SIGKILL") as error:
        list(run._lines(["sh", "-c", "kill -9 $$"], None, 0))
    assert error.value.status == -9
    with pytest.raises(DriverError, match="no such program") as error:
        list(run._lines(["sh", "-c", "echo a >&2; echo no such program >&2; exit 7"], None, 0))
    assert error.value.status == 7
    with pytest.raises(DriverError, match="No such file"):
        list(run._lines([str(tmp_path / "render")], None, 0))
    with pytest.raises(DriverError, match="no JSON object"):
        run._parse("[1]", "render")


def test_a_cut_line_is_not_given_out():
    lines = run._lines(["sh", "-c", "echo whole; printf cut; kill -9 $$"], None, 0)
    assert next(lines) == "whole\n"
    with pytest.raises(DriverError):
        next(lines)


def test_the_child_dies_with_a_reader_that_is_killed():
    reader = os.fork()
    if reader == 0:
        frames = run.frames("baseline", SCENE, 9, reps=100_000)
        next(frames)
        time.sleep(60)
        os._exit(1)
    drivers: list[int] = []
    for _ in range(500):
        drivers = [
            pid for pid in processes.children(reader) if Path(f"/proc/{pid}/comm").read_text() == "render\n"
        ]
        if drivers:
            break
        time.sleep(0.01)
    os.kill(reader, 9)
    os.waitpid(reader, 0)
    assert drivers
    assert processes.ends(drivers[0])


@pytest.mark.skipif(len(run.USABLE) < 2, reason="one CPU: nothing to keep off")
def test_a_child_that_is_not_pinned_has_every_cpu() -> None:
    """Also while this process is kept off the measured one: its threads would share the others."""

    def once(_: str, padding: int) -> float:
        (line,) = run._lines(["nproc"], None, padding)
        return float(line)

    assert run.interleaved(["a"], 1, 1, run.FASTEST, once) == {"a": [len(run.USABLE)]}
