"""Progress: lines ever less often without a terminal, a bar with the time left on one."""

import subprocess

import pytest

from study.core import progress


@pytest.fixture
def clock(monkeypatch):
    """Its time, in a list; every item that is dealt with takes three seconds."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_lines_come_with_what_is_left(clock, capsys):
    seen = []
    for item in progress.each("abcdefgh", "render"):
        seen.append(item)
        clock[0] += 3
    assert "".join(seen) == "abcdefgh"
    out, err = capsys.readouterr()
    assert (out, err.splitlines()) == (
        "",
        ["render: 4 of 8, after 12 s, 12 s left", "render: 8 of 8, after 24 s"],
    )


def test_ten_minutes_are_six_lines(clock, capsys):
    for _ in progress.each(range(200), "render"):
        clock[0] += 3
    assert len(capsys.readouterr().err.splitlines()) == 6


def test_work_of_seconds_says_nothing(clock, capsys):
    for _ in progress.each(range(3), "render"):
        clock[0] += 3
    assert capsys.readouterr().err == ""


def test_a_share_says_what_comes_and_its_end(clock, capsys):
    with progress.Progress("sweep", 200, share=True) as bar:
        clock[0] += 20
        bar.to(50, "round 1: opt4 trio 16x9")
        clock[0] += 61
        bar.to(200)
    assert capsys.readouterr().err.splitlines() == [
        "sweep: 25 %, after 20 s, 1 min 0 s left; round 1: opt4 trio 16x9",
        "sweep: 100 %, after 1 min 21 s",
    ]


def test_a_child_is_waited_for_and_looked_at(monkeypatch, capsys):
    monkeypatch.setattr(progress, "PAUSE", 0)
    monkeypatch.setattr(progress, "LOOK", 0.02)
    with subprocess.Popen(["sleep", "0.2"]) as child:
        progress.until(child, "build", lambda: 1, 3)
    assert child.returncode == 0
    assert "build: 1 of 3, after 0 s" in capsys.readouterr().err
