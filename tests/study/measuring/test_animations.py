"""An animation's frames outlive an interruption, and each is measured once."""

from __future__ import annotations

import json
import os
import shutil
import signal
import time
from pathlib import Path

import msgspec
import pytest

from study.core import machine, registry, run
from study.core.cli import StudyError
from study.measuring import animation_tables, animations
from study.measuring.schema import Animation, Article, FrameErrors, Spread

FRAMES, HEIGHT = 2000, 48  # about a millisecond each: enough to be killed among them


def begun(keep: Path, least: int) -> tuple[Path, bytes]:
    """The file of an animation whose process was killed when it had at least so many lines; what is in it."""
    scene = registry.animated()[animations.MOVING]
    file = animations.file_of(keep, "fixed", scene, scene.size(HEIGHT), 1)
    child = os.fork()
    if child == 0:
        try:  # whatever comes of it, no second pytest
            animations.animation("fixed", FRAMES, HEIGHT, 1, keep)
        finally:
            os._exit(0)
    for _ in range(30_000):
        if file.exists() and file.read_bytes().count(b"\n") >= least:
            break
        time.sleep(0.001)
    os.kill(child, signal.SIGKILL)
    assert os.waitpid(child, 0)[1] == signal.SIGKILL, "it had ended before it was killed"
    size = -1
    while size != (size := file.stat().st_size):  # until the driver is gone
        time.sleep(0.1)
    return file, file.read_bytes()


@pytest.mark.slow
def test_a_killed_animation_goes_on_where_it_ended(tmp_path: Path) -> None:
    file, before = begun(tmp_path, 12)
    kept = [json.loads(line) for line in before.splitlines()]
    done = len(kept) - 2
    assert [line["frame"] for line in kept] == list(range(-2, done)) and 10 <= done < FRAMES
    file.write_bytes(before + b'{"frame": 99, "wa')  # as a kill in mid-write leaves it
    row = animations.animation("fixed", FRAMES, HEIGHT, 1, tmp_path)
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    assert file.read_bytes().startswith(before), "what was measured stays as it was"
    timed = [line for line in lines if not line["warmup"]]
    assert [line["frame"] for line in timed] == list(range(FRAMES))
    assert [line["scene_time"] for line in timed] == pytest.approx([i / 60 for i in range(FRAMES)])
    assert row.all_ms == [line["ns"] / 1e6 for line in timed] and row.frames == FRAMES
    assert (row.reused, row.resumed_at) == (done, [done])
    assert row.ms.mean == pytest.approx(sum(row.all_ms) / FRAMES)
    assert row.core_ns_per_pixel == pytest.approx(row.ms.mean * 1e6 / (row.width * HEIGHT))


@pytest.mark.parametrize("threads", [1, 2])
def test_frames_are_of_as_many_cpus_as_threads(threads: int, tmp_path: Path, monkeypatch) -> None:
    child, seen = run._child, []
    monkeypatch.setattr(run, "_child", lambda a, cpus, *rest: seen.append(cpus) or child(a, cpus, *rest))
    animations.animation("fixed", 2, 16, threads, tmp_path)
    assert seen == [run.cpu_set(run.FASTEST, threads)] and len(seen[0]) == min(threads, len(run.USABLE))


def test_what_is_whole_is_not_measured_again_until_it_is_forgotten(tmp_path: Path, monkeypatch) -> None:
    first = animations.animation("fixed", 4, 16, 1, tmp_path)
    assert first.resumed_at == [] and first.reused == 0
    with monkeypatch.context() as patch:
        patch.setattr(run, "frames_into", lambda *_, **__: pytest.fail("measured again"))
        assert animations.animation("fixed", 4, 16, 1, tmp_path) == msgspec.structs.replace(first, reused=4)
        fewer = animations.animation("fixed", 2, 16, 1, tmp_path)
        assert fewer.all_ms == first.all_ms[:2] and fewer.reused == 2
    more = animations.animation("fixed", 6, 16, 1, tmp_path)
    assert more.all_ms[:4] == first.all_ms and more.resumed_at == [4]
    animations.forget(tmp_path, ["fixed_simd"])
    assert len(list((tmp_path / animations.FOLDER).iterdir())) == 1, "another phase's"
    animations.forget(tmp_path, ["fixed"])
    assert not (tmp_path / animations.FOLDER).exists()


def test_what_makes_another_time_makes_another_file(tmp_path: Path, monkeypatch) -> None:
    scene = registry.animated()[animations.MOVING]
    copy = tmp_path / "moved.json"
    copy.write_text(scene.path.read_text().replace('"hard"', '"none"'))
    other = registry.Scene("moved", copy, json.loads(copy.read_text()), False)

    def file(phase="fixed", of=scene, size=(16, 9), threads=1, told=None):
        return animations.file_of(tmp_path, phase, of, size, threads, told)

    found = [file(), file("baseline"), file(of=other), file(size=(32, 18)), file(threads=2)]
    found.append(file(told={"STEPWISE_FIXED": "clear=never"}))
    program = tmp_path / "render"
    shutil.copyfile(animations.build("fixed"), program)
    program.write_bytes(program.read_bytes() + b"another commit's")
    with monkeypatch.context() as patch:
        patch.setattr(animations, "build", lambda _: program)
        found.append(file())
    with monkeypatch.context() as patch:
        patch.setattr(machine, "cpu", lambda: {"model": "another", "family": 6, "model_number": 1})
        found.append(file())
    assert len(set(found)) == len(found)


def line(frame: int) -> str:
    about = {"warmup": False, "first": False, "ns": 1, "update_ns": 1, "settings": ""}
    return json.dumps({"frame": frame, **about})


@pytest.mark.parametrize(
    ("lines", "place", "due"),
    [([line(0), '{"fra'], 2, 1), ([line(0), line(2)], 2, 1), ([line(0)] * 2, 2, 1), ([line(1)], 1, 0)],
)
def test_a_broken_line_and_a_missing_frame_are_named(
    tmp_path: Path, lines: list[str], place: int, due: int
) -> None:
    file = tmp_path / "fixed-0.jsonl"
    file.write_text("\n".join(lines) + "\n")
    with pytest.raises(StudyError, match=rf"0\.jsonl:{place}: .* frame {due}"):
        animations.lines_of(file)


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / animations.FOLDER).write_text("")
    with pytest.raises(StudyError, match=animations.FOLDER):
        animations.animation("fixed", 2, 16, 1, tmp_path)


def test_the_drivers_own_refusal_is_shown(tmp_path: Path) -> None:
    with pytest.raises(run.DriverError, match="bits=99"):
        animations.animation("fixed", 2, 16, 1, tmp_path, told={"STEPWISE_FIXED": "bits=99"})


def row(**more) -> Animation:
    about = {"phase": "p", "threads": 2, "frames": 900, "width": 1920, "n": 1080, "ms": Spread(mean=95.0)}
    return Animation(**(about | {"core_ns_per_pixel": 190e6 / (1920 * 1080)} | more))


def test_rows_are_compared_by_the_frames_that_all_have() -> None:
    """Later frames are slower: over all of them 50 is no mean of the same thing as 1.5."""
    found = animations.with_common([row(all_ms=[1.0, 2.0]), row(all_ms=[3.0, 4.0, 50.0]), row()])
    assert [(one.common_frames, one.common_ms) for one in found] == [(2, 1.5), (2, 3.5), (None, None)]


def test_a_ratio_to_the_article_is_of_its_frames_and_size() -> None:
    """14.29 ms on 35 cores are 500.15 core·ms a frame; 95 on two are 190."""
    said = {"ms": 14.29, "cores": 35, "width": 1920, "height": 1080, "frames": 900, "spheres": 40, "bits": 20}
    article = Article(**said, cpu="")
    assert animation_tables.per_article(row(), article) == pytest.approx(500.15 / 190)
    assert animation_tables.per_article(row(frames=225), article) is None
    assert animation_tables.per_article(row(n=540, width=960), article) is None


def test_the_columns_say_what_was_resumed_and_how_far_the_beginning_is_off() -> None:
    error = FrameErrors(psnr_db=61.24, wrong_ppm=1234.4, width=640, n=360)
    shown = row(resumed_at=[7], reused=8, error=error)
    assert animation_tables.frames_said(shown).split(", ")[1:] == ["8 of an earlier start", "resumed at 7"]
    said = animation_tables.error_said(error)
    assert "61.2 dB" in said and "1,234 ppm" in said and "640×360" in said
