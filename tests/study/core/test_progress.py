"""Progress: lines ever less often without a terminal, a bar with the time left on one."""

import re
import subprocess

import pytest

from study.core import progress


@pytest.fixture
def clock(monkeypatch):
    """Its time, in a list; every item that is dealt with takes three seconds."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def numbers(said: str) -> list[list[int]]:
    """Numbers of each line."""
    return [list(map(int, re.findall(r"\d+", line))) for line in said.splitlines()]


def test_lines_come_with_what_is_left(clock, capsys):
    seen = []
    for item in progress.each("abcdefgh", "render"):
        seen.append(item)
        clock[0] += 3
    assert "".join(seen) == "abcdefgh"
    out, err = capsys.readouterr()
    assert out == "" and numbers(err) == [[4, 8, 12, 12], [8, 8, 24]]


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
        bar.to(50, "trio")
        clock[0] += 61
        bar.to(200)
    said = capsys.readouterr().err
    assert numbers(said) == [[25, 20, 1, 0], [100, 1, 21]] and "left; trio" in said


def test_a_child_is_waited_for_and_looked_at(monkeypatch, capsys):
    monkeypatch.setattr(progress, "PAUSE", 0)
    monkeypatch.setattr(progress, "LOOK", 0.02)
    with subprocess.Popen(["sleep", "0.2"]) as child:
        progress.until(child, "build", lambda: 1, 3)
    assert child.returncode == 0
    assert numbers(capsys.readouterr().err)[0][:2] == [1, 3]


@pytest.mark.parametrize(
    ("total", "share", "shown"), [(None, False, []), (4, False, [2, 4]), (4, True, [50])]
)
def test_a_terminal_s_bar_has_numbers_that_mean_something(monkeypatch, capsys, total, share, shown):
    """How many of how many, or a share; of a total that is not known the time alone, and no rate."""
    monkeypatch.setattr(progress.sys.stderr, "isatty", lambda: True)
    with progress.Progress("build", total, share=share) as bar:
        bar.to(2)
        text = str(bar.bar)
    far = text.partition("|")[0]
    assert [int(word) for word in re.findall(r"\d+", re.sub(r"\d\d:\d\d", "", far))] == shown
    assert re.search(r"\d\d:\d\d", text) and "it/s" not in text
