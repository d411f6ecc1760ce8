"""experiments.moving: an animation's frames outlive an interruption, and each is measured once."""

from __future__ import annotations

import json
import os
import shutil
import signal
import time
from pathlib import Path

import pytest

from study.core import machine, registry, run
from study.core.cli import StudyError
from study.experiments.moving import measure as moving

FRAMES, HEIGHT = 2000, 48  # about a millisecond each: enough to be killed among them


def begun(keep: Path, least: int) -> tuple[Path, bytes]:
    """The file of an animation whose process was killed when it had at least so many lines; what is in it."""
    file = moving.file_of(keep, "fixed", scene := registry.animated()[moving.MOVING], scene.size(HEIGHT), 1)
    child = os.fork()
    if child == 0:
        try:  # whatever comes of it, no second pytest
            moving.animation("fixed", FRAMES, HEIGHT, 1, keep)
        finally:
            os._exit(0)
    for _ in range(30_000):
        if file.exists() and file.read_bytes().count(b"\n") >= least:
            break
        time.sleep(0.001)
    os.kill(child, signal.SIGKILL)
    assert os.waitpid(child, 0)[1] == signal.SIGKILL, "it had ended before it was killed"
    with moving._appended(file):  # waits until the driver is gone
        return file, file.read_bytes()


@pytest.mark.slow
def test_a_killed_animation_goes_on_where_it_ended(tmp_path, capsys):
    file, before = begun(tmp_path, 12)
    kept = [json.loads(line) for line in before.splitlines()]
    done = len(kept) - 2
    assert [line["frame"] for line in kept] == list(range(-2, done)) and 10 <= done < FRAMES
    file.write_bytes(before + b'{"frame": 99, "wa')  # as a kill in mid-write leaves it
    row = moving.animation("fixed", FRAMES, HEIGHT, 1, tmp_path)
    assert f"{done} of {FRAMES} frames are there; goes on behind them\n" in capsys.readouterr().err
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    assert file.read_bytes().startswith(before), "what was measured stays as it was"
    timed = [line for line in lines if not line["warmup"]]
    assert [line["frame"] for line in timed] == list(range(FRAMES))
    assert [line["scene_time"] for line in timed] == pytest.approx([i / 60 for i in range(FRAMES)])
    assert row["all_ms"] == [line["ns"] / 1e6 for line in timed] and row["frames"] == FRAMES
    assert row["reused"] == done and f", {done} of an earlier start" in moving.frames_said(row)
    assert row["resumed_at"] == [done] and f"resumed at {done}" in moving.frames_said(row)
    assert row["ms"]["mean"] == pytest.approx(sum(row["all_ms"]) / FRAMES)
    pixels = row["width"] * HEIGHT
    assert row["core_ns_per_pixel"] == pytest.approx(row["ms"]["mean"] * 1e6 / pixels)


@pytest.mark.parametrize("threads", [1, 2])
def test_frames_are_of_as_many_cpus_as_threads(threads, tmp_path, monkeypatch):
    child, seen = run._child, []
    monkeypatch.setattr(run, "_child", lambda a, cpus, *rest: seen.append(cpus) or child(a, cpus, *rest))
    moving.animation("fixed", 2, 16, threads, tmp_path)
    assert seen == [run.cpu_set(run.FASTEST, threads)] and len(seen[0]) == min(threads, len(run.USABLE))


def test_what_is_whole_is_not_measured_again_until_it_is_forgotten(tmp_path, monkeypatch):
    first = moving.animation("fixed", 4, 16, 1, tmp_path)
    assert first["resumed_at"] == [] and first["reused"] == 0 and "earlier" not in moving.frames_said(first)
    with monkeypatch.context() as patch:
        patch.setattr(run, "frames_into", lambda *_, **__: pytest.fail("measured again"))
        assert moving.animation("fixed", 4, 16, 1, tmp_path) == first | {"reused": 4}
        fewer = moving.animation("fixed", 2, 16, 1, tmp_path)
        assert fewer["all_ms"] == first["all_ms"][:2] and fewer["reused"] == 2
    more = moving.animation("fixed", 6, 16, 1, tmp_path)
    assert more["all_ms"][:4] == first["all_ms"] and more["resumed_at"] == [4]
    moving.forget(tmp_path, ["fixed_simd"])
    assert len(list((tmp_path / moving.FOLDER).iterdir())) == 1, "another phase's"
    moving.forget(tmp_path, ["fixed"])
    assert not (tmp_path / moving.FOLDER).exists()
    moving.forget(tmp_path, ["fixed"])


def test_what_makes_another_time_makes_another_file(tmp_path, monkeypatch):
    scene = registry.animated()[moving.MOVING]
    copy = tmp_path / "moved.json"
    copy.write_text(scene.path.read_text().replace('"hard"', '"none"'))
    other = registry.Scene("moved", copy, json.loads(copy.read_text()), False)

    def file(phase="fixed", of=scene, size=(16, 9), threads=1):
        return moving.file_of(tmp_path, phase, of, size, threads)

    found = [file(), file("baseline"), file(of=other), file(size=(32, 18)), file(threads=2)]
    with moving.environment({"STEPWISE_FIXED": "clear=never"}):
        found.append(file())
    program = tmp_path / "render"
    shutil.copyfile(moving.build("fixed"), program)
    program.write_bytes(program.read_bytes() + b"another commit's")
    with monkeypatch.context() as patch:
        patch.setattr(moving, "build", lambda _: program)
        found.append(file())
    with monkeypatch.context() as patch:
        patch.setattr(machine, "cpu", lambda: {"model": "another", "family": 6, "model_number": 1})
        found.append(file())
    assert len(set(found)) == len(found)
    with moving.environment({run.UNTIMED: "1"}):
        assert file() == found[0]


@pytest.mark.parametrize(
    ("lines", "place", "due"),
    [
        (['{"frame": 0, "warmup": false}', '{"fra'], 2, 1),
        (['{"frame": 0, "warmup": false}', '{"frame": 2, "warmup": false}'], 2, 1),
        (['{"frame": 0, "warmup": false}'] * 2, 2, 1),
        (['{"frame": 1, "warmup": false}'], 1, 0),
        (['{"warmup": true}', "[1]"], 2, 0),
    ],
)
def test_a_broken_line_and_a_missing_frame_are_named(tmp_path, lines, place, due):
    file = tmp_path / "fixed-0.jsonl"
    file.write_text("\n".join(lines) + "\n")
    with pytest.raises(StudyError, match=rf"0\.jsonl:{place}: not the line of frame {due}; remove the file"):
        moving.lines_of(file)


def test_two_at_once_are_refused(tmp_path):
    file = tmp_path / "fixed-0.jsonl"
    with (
        moving._appended(file),
        pytest.raises(StudyError, match="another process is measuring"),
        moving._appended(file),
    ):
        pass
    with moving._appended(file):
        pass


def test_what_is_being_measured_into_is_not_forgotten(tmp_path):
    file = tmp_path / moving.FOLDER / "fixed-0123456789ab.jsonl"
    with moving._appended(file):
        moving.forget(tmp_path, ["fixed"])
        assert file.exists()
    moving.forget(tmp_path, ["fixed"])
    assert not file.parent.exists()


def test_a_file_that_is_forgotten_before_it_is_locked_is_made_anew(tmp_path, monkeypatch):
    file, lock, removed = tmp_path / moving.FOLDER / "fixed-0123456789ab.jsonl", moving._lock, []

    def late(end: int, named: Path) -> None:
        if not removed:
            removed.append(named)
            moving.forget(tmp_path, ["fixed"])
            assert not file.parent.exists()
        lock(end, named)

    monkeypatch.setattr(moving, "_lock", late)
    with moving._appended(file) as end:
        os.write(end, b"{}\n")
        assert file.read_bytes() == b"{}\n"


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / moving.FOLDER).write_text("")
    with pytest.raises(StudyError, match=moving.FOLDER):
        moving.animation("fixed", 2, 16, 1, tmp_path)


def test_the_drivers_own_refusal_is_shown(tmp_path):
    with (
        moving.environment({"STEPWISE_FIXED": "bits=99"}),
        pytest.raises(run.DriverError, match="bits=99"),
    ):
        moving.animation("fixed", 2, 16, 1, tmp_path)
