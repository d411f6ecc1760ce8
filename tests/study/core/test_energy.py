"""Energy by RAPL: made-up powercap trees, whose joules are known by arithmetic."""

from __future__ import annotations

import json
import os
import time
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
    monkeypatch.setattr(energy, "PMU", tmp_path / "power")

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
    tree("intel-rapl-mmio:0", "package-0", 1_000_000)
    tree("dtpm", "package", 3)
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


def test_what_is_not_there_is_said_by_name(tree: Tree, tmp_path: Path) -> None:
    absent = f"no energy counter: {tmp_path}/powercap has no package of RAPL (intel-rapl:N)"
    assert (energy.missing() or "").startswith(absent) and energy.reading() is None
    tree("intel-rapl:0", "psys", 3)
    assert (energy.missing() or "").startswith(absent) and energy.reading() is None
    folder = tree("intel-rapl:1", "package-0", "n/a")
    assert "energy_uj cannot be read" in (energy.missing() or "") and energy.reading() is None
    assert energy.joules(None, {folder: 3}) is None and energy.joules({folder: 3}, None) is None


def test_a_counter_for_root_alone(
    tree: Tree, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As Linux has it since 5.10. Root reads whatever the mode is: then reading it is refused by hand."""
    counter = tree("intel-rapl:0", "package-0", 3) / "energy_uj"
    tree("intel-rapl:1", "package-1", 3)
    counter.chmod(0)
    if os.geteuid() == 0:
        plain = Path.read_text

        def refuse(path: Path, *words: object, **more: object) -> str:
            if path == counter:
                raise PermissionError(13, "Permission denied")
            return plain(path, *words, **more)

        monkeypatch.setattr(Path, "read_text", refuse)
    said = energy.missing() or ""
    assert said.startswith(f"needs read permission of {counter} ") and "\n" not in said
    assert energy.reading() is None  # half of the energy is none
    assert machine.context().no_energy == said


# --- perf's event where there is no powercap


def event(folder: Path, **texts: str) -> Path:
    """A PMU as Linux shows RAPL's, but of type 1 (software), whose event 0 counts a CPU's nanoseconds: the
    real system call answers, and its joules are known."""
    given = {"type": "1", "cpumask": "0", "energy_pkg": "event=0x00", "energy_pkg_scale": "1e-9"} | texts
    for name, text in given.items():
        path = folder / name.replace("energy_pkg_scale", "events/energy-pkg.scale").replace(
            "energy_pkg", "events/energy-pkg"
        )
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n")
    return folder


def test_perfs_event_counts_where_there_is_no_powercap(tree: Tree, tmp_path: Path) -> None:
    """One joule per second of one CPU's clock: as many joules as seconds. Linux slews clocks by at most
    500 ppm (adjtimex(2))."""
    event(energy.PMU)
    if said := energy.missing():
        pytest.skip(said)
    begin = time.perf_counter()
    before = energy.reading()
    time.sleep(0.25)
    used, seconds = energy.joules(before, energy.reading()), time.perf_counter() - begin
    assert list(before or ()) == [tmp_path / "power" / "cpu0"]
    assert used is not None and 0.25 * 0.999 <= used <= seconds * 1.001
    tree("intel-rapl:0", "package-0", 7)  # powercap is asked first
    assert list((energy.reading() or {}).values()) == [7]


@pytest.mark.parametrize(
    "texts, said",
    [
        ({"energy_pkg": "event=two"}, "power has no energy-pkg"),
        ({"energy_pkg_scale": ""}, "power has no energy-pkg"),
        ({"cpumask": ""}, "power has no energy-pkg"),
        ({"type": "n/a"}, "power has no energy-pkg"),
        ({"type": "4000000000"}, "perf refuses power/energy-pkg/: "),
        ({"cpumask": "0,999999"}, "perf refuses power/energy-pkg/: "),
    ],
)
def test_an_event_that_is_not_there_is_said(tree: Tree, texts: dict[str, str], said: str) -> None:
    event(energy.PMU, **texts)
    assert energy.reading() is None
    assert said in (line := energy.missing() or "") and "\n" not in line and "would add J per frame" in line


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
    assert (row["joules"].value, row["joules"].low, row["joules"].high) == (1.75, 0.5, 3.0)


@pytest.mark.slow
def test_without_warm_up_a_launch_is_whole(swept) -> None:
    frames = swept(["--reps", "2", "--warmup", "0"])
    assert [f["joules"] for f in frames if f["frame"] == 1] == [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]


def test_the_report_has_a_column_or_a_line(tree: Tree) -> None:
    (column,) = (column for column in columns.RUNTIME if column.name.startswith("J/frame"))
    assert column.text({"joules": 1.75, "joules_low": 0.5, "joules_high": 3.0}) == "1.75 [0.50,\u00a03.00]"
    assert column.text({}) == column.text({"joules": float("nan")}) == "–"
