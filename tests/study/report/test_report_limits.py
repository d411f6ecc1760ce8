"""The page of the newest published study: its size, its questions in order, an answer to each chapter."""

import re

import pytest

from study.commands import report
from study.core.registry import ROOT
from study.experiments import experiment
from study.numbers import analysis

PUBLISHED = max((ROOT / "results" / "reference").glob("*/pareto.json")).parent
BYTES = 6_000_000
LACKING = {"toolchains", "peers", "flight", "pictures"}  # of this run
WITH_A_TABLE = {"negative"}  # opens with the table of a document
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    out = tmp_path_factory.mktemp("report") / "index.html"
    return report.page(analysis.load(PUBLISHED), out)


def test_it_is_small_and_whole(page: str) -> None:
    assert len(page.encode()) <= BYTES and "left out of this page" not in page
    assert re.findall(r'<h2 id="question-\d">(.*?)</h2>', page) == list(experiment.QUESTIONS.values())


def test_every_chapter_answers_with_a_number_and_opens_with_a_figure(page: str) -> None:
    chapters = dict(re.findall(r'<section id="(\w+)">(.*?)</section>', page, re.DOTALL))
    for name in chapters.keys() - {"summary", "units", "phases", "machine"} - LACKING:
        (answer,) = re.findall(r'<p class="answer">(.*?)</p>', chapters[name])
        assert re.search(r"\d", answer), name
        shown = "<table" if name in WITH_A_TABLE else "<figure"
        assert shown in chapters[name] or 'class="chart"' in chapters[name], name
    for name in LACKING & chapters.keys():
        assert 'class="notice"' in chapters[name], name
