"""Energy by RAPL: made-up powercap trees, whose joules are known by arithmetic."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pandas as pd
import pytest

from study.core import commands, machine, run
from study.core.host import energy
from study.numbers import columns, summary

MAX = 262143328850  # of a Xeon

Tree = Callable[..., Path]


@pytest.fixture
def tree(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Tree:
    """Writes a zone: folder, name, µJ and the counter's range."""
    root = tmp_path / "powercap"
    monkeypatch.setattr(energy, "ZONES", root)

    def zone(place: str, name: str, used: object, most: object = MAX) -> Path:
        folder = root / place
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "name").write_text(f"{name}\n")
        (folder / "energy_uj").write_text(f"{used}\n")
        (folder / "max_energy_range_uj").write_text(f"{most}\n")
        return folder

    return zone


def test_packages_are_added_and_their_parts_are_not(tree: Tree) -> None:
    """Two sockets with cores and memory, as Linux shows them: parts beside the packages and inside; psys;
    the same package by another door (mmio); the 11th package comes last."""
    two = {
        0: tree("intel-rapl:0", "package-0", 1_000_000),
        10: tree("intel-rapl:10", "package-10", 5_000_000),
    }
    for part in ("intel-rapl:0:0", "intel-rapl:0/intel-rapl:0:0"):
        tree(part, "core", 700_000)
    tree("intel-rapl:0:1", "dram", 100_000)
    tree("intel-rapl:1", "psys", 9_000_000)
    assert energy.missing() is None and energy.packages() == [two[0], two[10]]
    before = energy.reading()
    (two[0] / "energy_uj").write_text("3500000\n")
    (two[10] / "energy_uj").write_text("5250000\n")
    assert energy.joules(before, energy.reading()) == 2.5 + 0.25


def test_a_counter_that_begins_again(tree: Tree) -> None:
    """From 400 µJ below its end to 1,599,599 behind it: 1.6 J, of which 1 µJ is the step from end to 0."""
    folder = tree("intel-rapl:0", "package-0", MAX - 400)
    before = energy.reading()
    (folder / "energy_uj").write_text("1599599\n")
    assert energy.joules(before, energy.reading()) == 1.6
    (folder / "max_energy_range_uj").unlink()
    assert energy.joules(before, energy.reading()) is None


def test_what_is_not_there_is_said(tree: Tree, tmp_path: Path) -> None:
    assert str(tmp_path) in (energy.missing() or "") and energy.reading() is None
    tree("intel-rapl:0", "psys", 3)
    assert energy.reading() is None
    folder = tree("intel-rapl:1", "package-0", "n/a")  # as for who may not read it
    assert str(folder / "energy_uj") in (energy.missing() or "") and energy.reading() is None
    assert energy.joules(None, {folder: 3}) is None and energy.joules({folder: 3}, None) is None
    assert machine.context().no_energy == energy.missing()


# --- a sweep


@pytest.fixture
def swept(tree: Tree, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Callable[[list], list]]:
    """A real sweep whose package uses 3 J in a warm-up and 0.5, 1, … J in timed frames, by launch."""

    def go(more: list[str]) -> list[dict]:
        folder, real, launches = tree("intel-rapl:0", "package-0", MAX - 4_000_000), run.frames, []

        def frames(*words: object, **how: object) -> Iterator[dict]:
            launches.append(1)
            for frame in real(*words, **how):
                now = int((folder / "energy_uj").read_text())
                used = 3_000_000 if frame["warmup"] else 500_000 * len(launches)
                (folder / "energy_uj").write_text(str((now + used) % (MAX + 1)))
                yield frame

        monkeypatch.setattr(run, "frames", frames)
        words = ["--phase", "opt2", "--scene", "trio", "-n", "2", "--launches", "6", *more]
        outcome, _ = commands.called("sweep", [*words, "--results", tmp_path / "results"])
        assert outcome.ended == 0
        (path,) = (tmp_path / "results").rglob("frames.jsonl")
        return [json.loads(line) for line in path.read_text().splitlines()]

    yield go


@pytest.mark.slow
def test_a_sweep_has_joules_a_frame_with_their_interval(swept) -> None:
    """Launch k uses k/2 J a frame, k = 1 … 6: median 1.75, between its 1st and 6th launch (order statistics);
    the counter begins again on the way."""
    frames = swept(["--reps", "3", "--warmup", "1"])
    told = [frame for frame in frames if "joules" in frame]
    assert [frame["joules"] for frame in told] == [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]
    assert [frame["frame"] for frame in told] == [2] * 6
    (row,) = summary.rows(pd.DataFrame(frames).assign(spec="opt2"))
    assert row.joules.ends == (1.75, 0.5, 3.0)


def test_the_report_has_a_column_or_a_line(tree: Tree) -> None:
    (column,) = (column for column in columns.RUNTIME if column.name.startswith("J/frame"))
    assert column.text({"joules": 1.75, "joules_low": 0.5, "joules_high": 3.0}) == "1.75 [0.50,\u00a03.00]"
    assert column.text({}) == column.text({"joules": float("nan")}) == "–"
