"""The page of what did not pay: which steps are on it, with which words, and the table of what was tried."""

from __future__ import annotations

import re
from pathlib import Path

import complete
import matplotlib
import pytest

from study.core import registry
from study.core.cli import StudyError
from study.experiments.ablations import negative
from study.pictures.draw import STYLE


def row(name: str, low: float, high: float, scene: str = "scene0", verdict: str = "within") -> dict:
    gain = {"value": (low + high) / 2, "low": low, "high": high, "launches": 6, "sufficient": True}
    return {
        **{"ablation": name, "scene": scene, "what": f"what {name} is", "gain": gain, "verdict": verdict},
        **{"psnr_db": 41.5, "against_psnr_db": 94.2, "fraction_over_1_255": 0.01},
    }


@pytest.mark.parametrize(
    ("low", "high", "verdict", "outcome"),
    [
        (1.01, 1.2, "within", "pays"),
        (1.01, 1.2, "identical", "pays"),
        (1.01, 1.2, "approximate", "pays, at that error"),
        (1.01, 1.2, "OUTSIDE", "pays, at that error"),
        (0.99, 1.2, "within", "cannot be told here"),
        (0.93, 1.64, "approximate", "cannot be told here"),
        (1, 1.06, "within", "cannot be told here"),
        (0.97, 1.05, "within", "no gain"),
        (0.97, 1, "within", "no gain"),
        (0.8, 0.99, "approximate", "slower"),
    ],
)
def test_the_whole_interval_is_asked_and_the_picture(low, high, verdict, outcome) -> None:
    assert negative.outcome(row("a", low, high, verdict=verdict)) == outcome


def test_too_few_launches_are_said() -> None:
    few = row("a", 1, 2)
    few["gain"] |= {"low": None, "high": None}
    assert negative.outcome(few) == "too few launches"


def test_a_step_is_on_the_page_with_all_its_scenes_unless_it_pays_on_each() -> None:
    rows = [row("pays", 1.1, 1.2), row("pays", 1.1, 1.2, "mandelbulb")]
    rows += [row("half", 1.1, 1.2), row("half", 0.8, 0.9, "mandelbulb")]
    found = [(r["ablation"], r["scene"], r["outcome"]) for r in negative.chosen(rows)]
    assert found == [("half", "scene0", "pays"), ("half", "mandelbulb", "slower")]


TABLE = """# What did not pay

| idea | phase | expected | measured | machine | why |
| --- | --- | --- | --- | --- | --- |
| <b>roots</b> | opt6_wide | *less* | 1.15 | Zen 5 | – |
"""


def test_the_table_is_read_and_shown(tmp_path: Path) -> None:
    document = tmp_path / "table.md"
    document.write_text(TABLE, encoding="utf-8")
    (row,) = negative.tried(document)
    assert list(row) == list(negative.COLUMNS) and (row["phase"], row["measured"]) == ("opt6_wide", "1.15")
    page = negative.as_html([row])
    assert "<td>1.15</td>" in page and "<em>less</em>" in page
    assert "<b>" not in page and "&lt;b&gt;roots" in page
    assert negative.as_html([]) == ""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TABLE + "| a | b | c | d | e |\n", r"table\.md:6: a row has 6 cells: idea, phase"),
        (TABLE + "| a | opt1 | c | | e | f |\n", r"table\.md:6: a row has 6 cells"),
        ("# nothing\n", "no table with the columns idea, phase"),
        (TABLE.replace("| idea |", "| what |"), "no table with the columns"),
    ],
)
def test_a_table_of_another_form_is_refused(tmp_path: Path, text: str, said: str) -> None:
    document = tmp_path / "table.md"
    document.write_text(text, encoding="utf-8")
    with pytest.raises(StudyError, match=said):
        negative.tried(document)
    with pytest.raises(StudyError, match="No such file"):
        negative.tried(tmp_path / "other.md")


def test_the_projects_own_table_names_phases_and_is_short() -> None:
    rows = negative.tried()
    named = {
        name for row in rows for name in re.findall(r"\b(?:opt|fixed|rods|packets|baseline)\w*", row["phase"])
    }
    assert named <= set(registry.phases()) and len(rows) > 80
    assert all(len(cell) <= 90 for row in rows for cell in row.values())
    assert len({row["idea"] + row["phase"] for row in rows}) == len(rows)


def test_the_chapter_is_made_from_the_runs_file(tmp_path: Path) -> None:
    document = tmp_path / "table.md"
    document.write_text(TABLE, encoding="utf-8")
    empty = negative.section(tmp_path, document)
    assert (empty.parts, empty.drawn) == ([], {}) and "<td>1.15</td>" in empty.html
    rows = [row("opt6_wide+over_relaxation", 0.9, 1.1), row("opt4+rsqrt", 1.1, 1.2, verdict="approximate")]
    rows[0] |= {"psnr_db": None, "against_psnr_db": None}
    result = {"n": 90, "launches": 6, "rows": rows, "skipped": [], "failures": []}
    complete.write(tmp_path / "ablations.json", result)
    chapter = negative.section(tmp_path, document)
    text = chapter.parts[0].markdown
    assert "1.00× [0.90,\u00a01.10] | identical | identical" in text and "pays, at that error" in text
    with matplotlib.rc_context(STYLE):
        (axes,) = chapter.drawn["negative"].make().axes
    shown = [text.get_text() for text in axes.texts]
    assert shown == ["as before: identical", "94.2 → 41.5 dB"]
    (tmp_path / "ablations.json").write_text('{"rows": [{"ablation": 1}], "skipped": [], "failures": []}')
    with pytest.raises(StudyError, match=r"ablations\.json: not what scripts/stepwise ablations writes"):
        negative.section(tmp_path, document)


def test_of_a_step_that_is_left_out_the_gain_is_the_steps() -> None:
    row = {"ablation": "opt6_wide+awake", "what": "every shape at every step", "step": "removed"}
    assert negative._what(row) == "left out: every shape at every step; the gain is of what was left out"
    assert negative._what(row | {"step": "added"}) == "every shape at every step"
