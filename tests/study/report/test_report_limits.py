"""The page of the newest published study: short, small, its questions in order, an answer to each chapter."""

from __future__ import annotations

import html.parser
import re

import pytest

from study.commands import report
from study.core.registry import ROOT
from study.experiments import experiment
from study.numbers import analysis

PUBLISHED = max((ROOT / "results" / "reference").glob("*/pareto.json")).parent
WORDS, BYTES = 15_000, 6_000_000
pytestmark = pytest.mark.slow

SILENT = {"style", "script", "svg"}
WITHOUT_ANSWER = {"summary", "units"}  # its cards say it; a list of words


class Reader(html.parser.HTMLParser):
    """What a reader sees who opens nothing: words, chapters, their answers, tables that are open."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.silent, self.folded, self.heads, self.section = 0, [], 0, ""
        self.tag, self.kind = "", ""
        self.seen: list[str] = []
        self.questions: list[str] = []
        self.chapters: list[str] = []
        self.answers: dict[str, str] = {}
        self.notices: dict[str, str] = {}
        self.tables: dict[str, int] = {}
        self.all: list[tuple[str, str]] = []
        self.feed(text)

    @property
    def hidden(self) -> bool:
        return any(self.folded) and not self.heads

    def handle_starttag(self, tag: str, attributes: list) -> None:
        found = dict(attributes)
        self.silent += tag in SILENT
        if tag == "section":
            self.section = found["id"]
            self.chapters.append(self.section)
        if tag == "details":
            self.folded.append("open" not in found)
        self.heads += tag == "summary"
        if tag == "table" and not self.hidden:
            self.tables[self.section] = self.tables.get(self.section, 0) + 1
        self.tag, self.kind = tag, found.get("class", "")

    def handle_endtag(self, tag: str) -> None:
        self.silent -= tag in SILENT
        if tag == "details":
            self.folded.pop()
        self.heads -= tag == "summary"
        self.tag, self.kind = "", ""

    def handle_data(self, data: str) -> None:
        if self.silent:
            return
        self.all.append((self.section, data))
        if not self.hidden:
            self.seen += data.split()
        if self.tag == "h2":
            self.questions.append(data)
        if self.kind == "answer":
            self.answers[self.section] = data
        if self.kind == "notice":
            self.notices[self.section] = data


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Reader]:
    out = tmp_path_factory.mktemp("report") / "index.html"
    text = report.page(analysis.load(PUBLISHED, strict=False), out)
    return text, Reader(text)


def test_it_is_short_and_small(page: tuple[str, Reader]) -> None:
    text, read = page
    assert len(read.seen) <= WORDS and len(text.encode()) <= BYTES


def test_its_questions_are_answered_in_their_order(page: tuple[str, Reader]) -> None:
    _, read = page
    assert read.questions == list(experiment.QUESTIONS.values())
    order = "summary ladder pareto size frames breakeven drjit peers history roofline flops hotspots "
    order += "rungs claims ablations negative views verification accuracy stability scaling functions "
    order += "toolchains systems flight pictures phases "
    assert read.chapters == [*order.split(), "machine", "units"]


def test_every_chapter_has_an_answer_with_a_number_or_says_what_measures_it(page: tuple[str, Reader]) -> None:
    _, read = page
    lacking = {"toolchains", "peers", "flight", "pictures"}  # of this run
    assert set(read.chapters) - read.answers.keys() == WITHOUT_ANSWER | lacking
    assert read.notices.keys() >= lacking
    for chapter, answer in read.answers.items():
        assert re.search(r"\d", answer) and answer.rstrip().endswith("."), chapter


def test_no_table_but_the_ladder_is_open(page: tuple[str, Reader]) -> None:
    _, read = page
    assert read.tables == {"ladder": 2}  # of two scenes


def test_every_chapter_with_an_answer_opens_with_a_figure(page: tuple[str, Reader]) -> None:
    text, read = page
    chapters = dict(re.findall(r'<section id="(\w+)">(.*?)</section>', text, re.DOTALL))
    for name in read.answers.keys() - {"phases", "machine"}:
        shown = re.sub(r"<details>.*</details>", "", chapters[name], flags=re.DOTALL)
        assert shown.count("<figure") == 1, name
    assert "<svg" in chapters["roofline"] and "<title>" in chapters["roofline"]


def test_figures_are_svg_and_have_titles(page: tuple[str, Reader]) -> None:
    """But those made of pictures; what has lines alone has no marks."""
    text, _ = page
    inline = re.findall(r'<figure class="inline">.*?</figure>', text, re.DOTALL)
    silent = [one for one in inline if "<title>" not in one]
    assert len(inline) > 30 and len(silent) <= 1, [re.findall("<figcaption>.*", one) for one in silent]
    for one in inline:
        own = set(re.findall(r' id="([^"]+)"', one))
        assert set(re.findall(r'(?:url\(#|href="#)([^)"]+)', one)) == own


def test_its_words_are_the_fields(page: tuple[str, Reader]) -> None:
    """Lessons and the texts of hard cases are the phases' own and the cases' own."""
    _, read = page
    mine = " ".join(text for chapter, text in read.all if chapter not in ("phases", "stability", "negative"))
    for word in (
        r"\brungs?\b",
        r"(?<!ground )(?<!Ground )(?<!/)\btruth\b(?!\.py)",
        r"\bgoals?\b",
        r"\bmet\b",
    ):
        found = re.search(f".{{60}}{word}.{{40}}", mine)
        assert not found, found[0]


def test_nothing_is_wider_than_a_narrow_screen() -> None:
    """Tables scroll inside their own box; pictures shrink; long words break."""
    style = (ROOT / "report" / "templates" / "style.css").read_text()
    chapter = (ROOT / "report" / "templates" / "chapter.html.j2").read_text()
    assert ".scroll { overflow-x: auto;" in style and "overflow-wrap: break-word" in style
    assert chapter.count("<table") == chapter.count('<div class="scroll"><table')
    for form in ("figure img", "figure.inline svg", ".notes img"):
        assert re.search(rf"{re.escape(form)} {{ max-width: (min\(100%|100%)", style), form
