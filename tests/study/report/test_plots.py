"""Plots of tests/fixtures/run: every figure is there, is the same each time, and shows what it should."""

import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import emitted
import numpy as np
import pandas as pd
import pytest
import started
from matplotlib.figure import Figure
from PIL import Image

from study.core import registry
from study.numbers import analysis, ladder
from study.numbers.analysis import Data
from study.pictures import dots
from study.pictures import draw as drawing
from study.pictures import ladder as ladder_figures

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return Path(shutil.copytree(ROOT / "tests" / "fixtures" / "run", tmp_path / "machine" / "run"))


@pytest.fixture(scope="module")
def data() -> Data:
    return analysis.load(ROOT / "tests" / "fixtures" / "run")


@pytest.fixture(scope="module")
def rows(data: Data) -> pd.DataFrame:
    return ladder.rows(data)


def redraw(*arguments: object) -> subprocess.CompletedProcess:
    return started.run([sys.executable, str(ROOT / "scripts" / "stepwise"), "redraw", *map(str, arguments)])


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.findobj(lambda artist: hasattr(artist, "get_text"))]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """By the script, of a copy of the run: its figures' files by their names."""
    folder = tmp_path_factory.mktemp("plots")
    run = shutil.copytree(ROOT / "tests" / "fixtures" / "run", folder / "machine" / "run")
    chapters = ("ladder", "size", "verification", "pareto")
    done = redraw(run, "-o", folder / "out", "--json", "--only", *chapters)
    assert done.returncode == 0 and "pareto: left out" in done.stderr, done.stderr
    return {Path(file).name: Path(file) for file in emitted.result(done.stdout)["files"]}


def test_every_figure_exists_and_is_a_picture(made: dict) -> None:
    assert set(made) == {f"{name}.{kind}" for name in ladder_figures.PLOTS for kind in ("svg", "png")}
    for name in ladder_figures.PLOTS:
        root = ElementTree.parse(made[f"{name}.svg"]).getroot()
        assert root.tag.endswith("svg") and len(list(root.iter())) > 200
        pixels = np.asarray(Image.open(made[f"{name}.png"]).convert("RGB"))
        assert min(pixels.shape[:2]) > 300
        assert 0.5 < (pixels == 255).all(axis=-1).mean() < 0.99  # drawn upon, and not full


def test_the_same_run_gives_the_same_bytes(
    made: dict, data: Data, rows: pd.DataFrame, tmp_path: Path
) -> None:
    """In another process, of the run's original."""
    for name, one in ladder_figures.drawings(data, rows).items():
        for again in one.write(tmp_path / name):
            assert again.read_bytes() == made[again.name].read_bytes()


def test_lines_are_the_medians_and_whiskers_the_intervals(rows: pd.DataFrame) -> None:
    axes = ladder_figures.runtime(rows).axes[0]
    containers = {container.get_label(): container for container in axes.containers}
    line, _, (whiskers,) = containers["opt4"]
    assert list(line.get_xdata()) == [90, 180]
    assert line.get_ydata() == pytest.approx([0.00864, 0.0288])  # seconds
    low, high = whiskers.get_segments()[1][:, 1]
    opt4 = rows[(rows["scene"] == "scene0") & (rows["phase"] == "opt4") & rows["headline"]].iloc[0]
    assert (low, high) == pytest.approx((opt4["ms_low"] / 1e3, opt4["ms_high"] / 1e3))


def test_the_ladder_has_the_speedup_its_error_and_the_papers_marks(rows: pd.DataFrame) -> None:
    figure = ladder_figures.speedups(rows)
    scene0 = figure.axes[0]
    assert scene0.get_xscale() == "log" and 0 < scene0.get_xlim()[0] < 1  # baseline's point shows
    assert not scene0.patches  # a bar's length means nothing there
    ends = [points[0].get_xdata()[0] for points in scene0.containers]
    assert ends == pytest.approx([1, 3.2, 4, 5, 16, 32])
    assert [label.get_text() for label in scene0.get_yticklabels()][-1] == "opt4"
    shown = texts(figure)
    assert "32.0×" in shown and "56.9 dB" in shown and "27.5 dB, OUTSIDE" in shown
    marks = np.concatenate(
        [points.get_offsets() for points in scene0.collections if len(points.get_offsets())]
    )
    for value in (28.11, 32.1, 19.6):
        assert np.isclose(marks[:, 0], value, atol=0.01).any()


def test_identical_pictures_stand_on_the_rail_and_failing_ones_are_named(rows: pd.DataFrame) -> None:
    figure = ladder_figures.error(rows)
    assert "outside its tolerance" in texts(figure)
    scene0 = figure.axes[0]
    at = {c.get_label(): c[0].get_xdata()[0] for c in scene0.containers}
    assert at["baseline"] == at["opt1"] > max(at["opt2"], at["opt3"], at["opt4"])
    assert at["opt4"] == 56.9
    assert "opt2@opt3" not in at  # nothing verified it


def test_without_verify_there_is_no_error_plot(run: Path) -> None:
    (run / "verify.json").unlink()
    data = analysis.load(run)
    assert "speed-against-error" not in ladder_figures.drawings(data, ladder.rows(data))


def test_an_unwritable_folder_and_no_run_are_status_2(run: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for arguments in ((run, "-o", tmp_path / "file" / "out"), (tmp_path / "none",)):
        done = redraw(*arguments)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)


def test_the_last_panel_of_each_column_has_the_axis_numbers() -> None:
    made = dots.draw([dots.Dot(panel, "a", 2.0) for panel in "abc"], "title", "ms")
    told = [axes.get_xlabel() for axes in made.axes[:3]]
    shown = [axes.xaxis.get_tick_params()["labelbottom"] for axes in made.axes[:3]]
    assert told == ["", "ms", "ms"] and shown == [False, True, True]


def test_a_phase_looks_alike_in_every_figure_and_like_no_other() -> None:
    """By its number, whoever else is there and in which order; one that has none takes a free place."""
    names = list(registry.ladder())
    all_of_them = drawing.look(pd.DataFrame({"phase": names, "threads": 1}))
    for key in ("color", "marker"):
        assert len({style[key] for style in all_of_them.values()}) == len(names)
    few = drawing.look(
        pd.DataFrame({"phase": ["opt9_convex", "truth", "opt4", "opt4_other", "baseline"], "threads": 1})
    )
    for name in ("opt9_convex", "opt4", "baseline"):
        assert few[name, 1] == all_of_them[name, 1]
    assert len({style["color"] for style in few.values()}) == 5
