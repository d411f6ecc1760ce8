"""The page of the newest published study: its size, its questions in order, an answer to each chapter, and
README's figures."""

import re
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from PIL import Image

from study.commands import report
from study.core.registry import ROOT
from study.experiments import experiment
from study.numbers import analysis
from study.pictures import draw

REFERENCE = ROOT / "results" / "reference"
FIGURES = re.search(
    r"`(\w+)\.png` and `(\w+)\.png` are the figures of `([\w.-]+)`", (REFERENCE / "README.md").read_text()
)
PUBLISHED = REFERENCE / FIGURES[3]
BYTES = 6_000_000
LACKING = {"toolchains", "peers", "flight"}  # of this run
WITH_A_TABLE = {"negative"}  # opens with the table of a document
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("report")


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    """README's figures as they are published; of the others the page's form alone, without a layout."""
    whole = draw.Drawing.write

    def write(drawing: draw.Drawing, stem: Path, across: float | None = None) -> list[Path]:
        if stem.name in FIGURES.groups():
            return whole(drawing, stem)
        stem.parent.mkdir(exist_ok=True)
        with matplotlib.rc_context(draw.STYLE):
            figure = drawing.make()
            figure.set_layout_engine("none")
            figure.savefig(stem.with_suffix(".png"), dpi=110)
        return [stem.with_suffix(".png")]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(draw.Drawing, "write", write)
        return report.page(analysis.load(PUBLISHED), folder / "index.html")


@pytest.mark.parametrize("figure", FIGURES.groups()[:2])
def test_readmes_figures_are_those_of_the_page(figure: str, page: str, folder: Path) -> None:
    pictures = [
        Image.open(where / f"{figure}.png").convert("RGB") for where in (REFERENCE, folder / "figures")
    ]
    published, again = map(np.asarray, pictures)
    assert published.shape == again.shape and (published != again).any(axis=-1).mean() < 0.001


def test_it_is_small_and_whole(page: str) -> None:
    assert len(page.encode()) <= BYTES and "left out of" not in page
    assert re.findall(r'<h2 id="question-\d">(.*?)</h2>', page) == list(experiment.QUESTIONS.values())


def test_the_pictures_open_the_page(page: str) -> None:
    """Before the list of chapters, in which they are none of their own."""
    assert 0 < page.index('<section id="summary">') < page.index("<nav>")
    assert '<figure class="pictures">' in page.partition("<nav>")[0] and 'id="pictures"' not in page


def test_every_chapter_answers_with_a_number_and_opens_with_a_figure(page: str) -> None:
    chapters = dict(re.findall(r'<section id="(\w+)">(.*?)</section>', page, re.DOTALL))
    for name in chapters.keys() - {"summary", "units", "phases", "machine", "pictures"}:
        (answer,) = re.findall(r'<p class="answer">(.*?)</p>', chapters[name])
        assert re.search(r"\d", answer), name
        shown = "<table" if name in WITH_A_TABLE else "<figure"
        assert shown in chapters[name] or 'class="chart"' in chapters[name], name


def test_what_the_run_lacks_is_one_list_at_the_end(page: str) -> None:
    """With the command that measures it; no chapter is empty, and no box says so."""
    assert not LACKING & {*re.findall(r'<section id="(\w+)">', page)} and 'class="notice"' not in page
    end = page.partition('<section id="machine">')[2]
    assert {f"make {name}" for name in LACKING} <= {*re.findall(r"<li>[^<]*<code>([^<]*)</code></li>", end)}
