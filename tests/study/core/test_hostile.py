"""Runs whose names and texts are markup, shell, escape sequences, paths: shown, and obeyed by nobody."""

from __future__ import annotations

import json
import re
import shlex
import sys
import unicodedata
import xml.etree.ElementTree as ET
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import markdown_it
import pytest
import started

from study.core import cli, show
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.core.show import Column
from study.experiments.accuracy import chapter as accuracy
from study.experiments.section import Section
from study.numbers import analysis
from study.report import facts

RUN = ROOT / "tests" / "fixtures" / "run"
NASTY = (
    "<script>alert(1)</script><img src=x onerror=alert(1)> | `a|b` \"q\" 'p' \x1b[2J\x07\x9b "
    "\u202e\u2066\u200f {{ 7*7 }} {% raw %} %s %(a)s {0} $\\nope{1$ $(id)$ ; \\| \\ &amp; --> </style> "
    "</table>\n| a | b |\n# head\r\n<b>"
)
NAMES = ["scene", "phase", "flags_from", "spec", "compiler", "flags", "libc", "isa", "precision"]
NAMES += [
    "model",
    "microarchitecture",
    "system",
    "hypervisor",
    "kernel",
    "reason",
    "why",
    "commit",
    "machine",
]
Change = Callable[[str, str], str]


def changed(value: object, change: Change, key: str = "") -> object:
    """JSON with other texts under NAMES: the first scene and the phases up to opt3 keep theirs."""
    if isinstance(value, dict):
        return {name: changed(inner, change, name) for name, inner in value.items()}
    if isinstance(value, list):
        return [changed(inner, change, key) for inner in value]
    if not isinstance(value, str) or key not in NAMES:
        return value
    if key in ("scene", "phase", "flags_from", "spec") and value not in ("mandelbulb", "opt4"):
        return value
    return change(key, value)


def run_of(folder: Path, change: Change) -> Path:
    """The fixture's run with other texts, in FOLDER/machine/run."""
    made = folder / "machine" / "run"
    made.mkdir(parents=True)
    for file in RUN.glob("*.json"):
        (made / file.name).write_text(json.dumps(changed(json.loads(file.read_text()), change)))
    lines = (RUN / "frames.jsonl").read_text().splitlines()
    rows = (json.dumps(changed(json.loads(line), change)) for line in lines)
    (made / "frames.jsonl").write_text("".join(f"{row}\n" for row in rows))
    cut = {
        "verify": f"{change('', 'a').replace('`', '')} `code` [a](http://evil.example) ![a](http://evil.example/a.png)"
    }
    (made / "study.json").write_text(json.dumps({"schema": 1, "cut": cut}))
    return made


def nasty(key: str, value: str) -> str:
    return f"{value} {NASTY}"


def harmless(key: str, value: str) -> str:
    return f"{value} and more"


def is_hidden(sign: str) -> bool:
    """What steers a terminal, is not seen, or turns text about, by its Unicode category."""
    return sign not in "\n\t" and unicodedata.category(sign) in ("Cc", "Cf", "Cs", "Zl", "Zp")


def stepwise(*words: str | Path) -> str:
    """What it prints on both outputs, which must be fit for a terminal. It ends well."""
    done = started.run([sys.executable, ROOT / "scripts" / "stepwise", *words])
    assert done.returncode == 0, done.stderr
    said = done.stdout + done.stderr
    assert [sign for sign in said if is_hidden(sign)] == []
    return said


class Elements(HTMLParser):
    """The elements of a page with the names of their attributes; those of figures, whose texts break into
    more lines the longer they are, apart."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, list[str]]] = []
        self.drawn: set[str] = set()
        self.inside = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.inside |= tag == "svg"
        if self.inside:
            self.drawn |= {tag, *(f"{tag}[{name}]" for name, _ in attrs)}
        else:
            self.found.append((tag, [name for name, _ in attrs]))

    def handle_endtag(self, tag: str) -> None:
        self.inside &= tag != "svg"


def cells(line: str) -> int:
    """Of a row of a Markdown table; what stands behind a backslash ends none."""
    return len(re.findall(r"\\.|(\|)", line)) and sum(sign == "|" for sign in re.findall(r"\\.|\|", line)) - 1


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Of a hostile and of a harmless run the folder with the page, the tables and the plots."""
    made = {}
    for name, change in (("nasty", nasty), ("harmless", harmless)):
        folder = tmp_path_factory.mktemp(name)
        run, made[name] = run_of(folder, change), folder / "out"
        stepwise("report", run, "-o", made[name] / "index.html")
    out = made["nasty"]
    stepwise("tables", out.parent / "machine" / "run", "-o", out / "tables-alone")
    stepwise("plots", out.parent / "machine" / "run", "-o", out / "plots")
    return made


@pytest.mark.slow
def test_no_element_or_attribute_of_the_page_is_from_data(pages: dict[str, Path]) -> None:
    nasty, harmless = (Elements((pages[name] / "index.html").read_text()) for name in ("nasty", "harmless"))
    assert len(nasty.found) > 300 and nasty.found == harmless.found
    assert len(nasty.drawn) > 20 and nasty.drawn == harmless.drawn
    text = (pages["nasty"] / "index.html").read_text()
    assert "&lt;script&gt;alert(1)" in text and "{{ 7*7 }}" in text and "evil.example" in text


@pytest.mark.slow
def test_nothing_that_was_written_steers_its_reader(pages: dict[str, Path]) -> None:
    files = [
        path for path in pages["nasty"].rglob("*") if path.suffix in (".html", ".md", ".csv", ".svg", ".json")
    ]
    assert {path.suffix for path in files} == {".html", ".md", ".csv", ".svg", ".json"}
    for path in files:
        assert [sign for sign in path.read_text(encoding="utf-8") if is_hidden(sign)] == [], path
        if path.suffix == ".svg":
            tags = {one.tag.rpartition("}")[2] for one in ET.parse(path).iter()}
            assert not tags & {"script", "img", "foreignObject", "a"}, path


@pytest.mark.slow
def test_tables_keep_their_columns_and_have_no_html(pages: dict[str, Path]) -> None:
    reader, rows = markdown_it.MarkdownIt("commonmark", {"html": True}).enable("table"), 0
    for path in pages["nasty"].rglob("*.md"):
        text = path.read_text()
        tokens = [inner for token in reader.parse(text) for inner in [token, *(token.children or [])]]
        assert not [token.content for token in tokens if token.type.startswith("html")], path
        wanted = 0
        for line in text.splitlines():
            wanted = (wanted or cells(line)) if line.startswith("|") else 0
            rows += bool(wanted)
            assert not wanted or cells(line) == wanted, (path, line)
    assert rows > 50


@pytest.mark.slow
def test_compare_says_it_in_lines_of_its_own(tmp_path: Path) -> None:
    a, b = (run_of(tmp_path / name, change) for name, change in (("a", nasty), ("b", harmless)))
    for pair in ((a, a), (a, b), (b, a)):
        said = stepwise("compare", *pair)
        assert not re.search("^(#|<b>|. a )", said, re.MULTILINE), said


def test_what_makes_a_run_again_is_safe_to_paste() -> None:
    one = {"spec": "opt4", "scene": NASTY, "phase": "opt4"}
    words = shlex.split(facts.command({"configurations": [one], "seed": "$(id)"}))
    assert NASTY in words and "$(id)" in words and not {";", "$(id)"} - {"$(id)"} & set(words)


@pytest.mark.parametrize("text", ["a|b", "a\\|b", "a\\\\|b", "\\", "a\nb", "`a|b`", "a\x85|\u2028b"])
def test_a_cell_stays_one_cell(text: str) -> None:
    made = show.markdown(
        show.table([{"a": text, "b": "end"}], [Column("", n, lambda row, n=n: row[n]) for n in "ab"])
    )
    html = markdown_it.MarkdownIt("commonmark").enable("table").render(made)
    found = re.findall("<td>(.*?)</td>", html)
    assert len(made.splitlines()) == 3 and len(found) == 2 and found[1] == "end"
    assert re.sub("</?code>", "`", found[0]) == " ".join(text.splitlines())


@pytest.mark.parametrize("name", ["../../secret.png", "/etc/passwd", "images/../../a.png", "a\0b"])
def test_a_picture_outside_of_the_run_is_not_looked_at(tmp_path: Path, name: str) -> None:
    (folder,) = [path.parent for path in ROOT.glob("results/reference/zen4-2026-11-28/accuracy.json")]
    made = json.loads((folder / "accuracy.json").read_text())
    next(row for row in made["rows"] if row["phase"] == "baseline")["picture"] = name
    (tmp_path / "accuracy.json").write_text(json.dumps(made))
    with pytest.raises(StudyError, match="is no file of this run"):
        accuracy.errors(tmp_path)


def test_no_figure_is_drawn_outside_of_its_folder() -> None:
    for name in ("../a", "a/b", "a\0b"):
        with pytest.raises(StudyError, match="cannot be a file's name"):
            Section("one", "One", "", [], drawn={name: None})  # type: ignore[dict-item]


@pytest.mark.slow
def test_names_that_are_paths_write_nothing_elsewhere(tmp_path: Path) -> None:
    """Scene and phase are in captions and tables only: no file is made but those of the page."""
    names = {"mandelbulb": "../../../up", "opt4": "/nowhere/at/all"}
    run = run_of(tmp_path, lambda key, value: names.get(value, value))
    out = tmp_path / "x" / "y" / "z"
    before = set(tmp_path.rglob("*"))
    stepwise("report", run, "-o", out / "index.html")
    new = set(tmp_path.rglob("*")) - before
    assert out / "index.html" in new and not Path("/nowhere").exists()
    assert all(
        one.is_relative_to(tmp_path / "x") and (one == out or out in one.parents or one in out.parents)
        for one in new
    )


def test_the_terminal_is_not_steered(tmp_path: Path) -> None:
    """Of a file whose name is hostile, in an error: one line."""
    folder = tmp_path / "a\x1b[2J\u202e\nrender: ok"
    done = started.run([sys.executable, ROOT / "scripts" / "stepwise", "report", folder])
    assert (
        done.returncode == 2 and done.stderr.count("\n") == 1 and "\\x1b[2J\\u202e render: ok" in done.stderr
    )
    assert [sign for sign in done.stderr if is_hidden(sign)] == []


def test_visible_leaves_words_alone() -> None:
    text = "käfig × 5 µs ≤ 3 Å 日本 \t\n é"
    assert cli.visible(text) == text and cli.visible("\x1b\u202e\ud800\r") == "\\x1b\\u202e\\ud800\\r"
    assert cli.one_line("a\nb\r\nc\u2028d") == "a b c d"


def test_the_run_of_these_tests_is_read(tmp_path: Path) -> None:
    assert analysis.load(run_of(tmp_path, nasty)).context["cpu"]["model"].endswith("<b>")
