"""The page of what did not pay: which steps are on it, with which words, and the table of what was tried."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from study.core import cli, registry, store
from study.core.cli import StudyError
from study.experiments.ablations import chapter
from study.experiments.ablations.schema import Ablations, Row
from study.numbers import verdicts
from study.numbers.schema import Interval


def row(
    name: str, low: float | None, high: float | None, scene: str = "scene0", verdict: str = "within"
) -> Row:
    gain = Interval(value=((low or 1) + (high or 1)) / 2, low=low, high=high, launches=6, sufficient=True)
    about = {"ablation": name, "scene": scene, "what": f"what {name} is", "against": "opt1", "step": "added"}
    errors = {"psnr_db": 41.5, "against_psnr_db": 94.2, "fraction_over_1_255": 0.01, "failed": []}
    return Row(**about, **errors, gain=gain, ms=gain, against_ms=gain, paper="", verdict=verdict)


def result(*rows: Row) -> Ablations:
    return Ablations(schema=1, rows=list(rows), skipped=[], failures=[], n=90, launches=6)


@pytest.mark.parametrize(
    ("low", "high", "verdict", "outcome"),
    [
        (1.01, 1.2, "within", chapter.PAYS),
        (1.01, 1.2, "identical", chapter.PAYS),
        (1.01, 1.2, "approximate", chapter.COSTS),
        (1.01, 1.2, "OUTSIDE", chapter.COSTS),
        (0.99, 1.2, "within", verdicts.UNSURE),
        (0.93, 1.64, "approximate", verdicts.UNSURE),
        (1, 1.06, "within", verdicts.UNSURE),
        (0.97, 1.05, "within", chapter.NOTHING_GAINED),
        (0.97, 1, "within", chapter.NOTHING_GAINED),
        (0.8, 0.99, "approximate", chapter.SLOWER),
    ],
)
def test_the_whole_interval_is_asked_and_the_picture(low, high, verdict, outcome) -> None:
    assert chapter.outcome(row("a", low, high, verdict=verdict)) == outcome


def test_too_few_launches_are_said() -> None:
    assert chapter.outcome(row("a", None, None)) == verdicts.TOO_FEW


TABLE = """# What did not pay

| idea | phase | expected | measured | machine | why |
| --- | --- | --- | --- | --- | --- |
| <b>roots</b> | opt6_wide | *less* | 1.15 | Zen 5 | – |
"""


def test_the_table_is_read_and_shown(tmp_path: Path) -> None:
    document = tmp_path / "table.md"
    document.write_text(TABLE, encoding="utf-8")
    (cells,) = chapter.tried(document)
    assert len(cells) == len(chapter.TRIED) and (cells[1], cells[3]) == ("opt6_wide", "1.15")
    page = chapter.as_html([cells])
    assert "<td>1.15</td>" in page and "<em>less</em>" in page
    assert "<b>" not in page and "&lt;b&gt;roots" in page
    document.write_text(TABLE + "| a | b | c | d | e |\n", encoding="utf-8")
    with pytest.raises(StudyError, match=r"table\.md:6"):
        chapter.tried(document)


def test_the_projects_own_table_names_phases_and_is_short() -> None:
    rows = chapter.tried()
    named = {name for row in rows for name in re.findall(r"\b(?:opt|fixed|rods|packets|baseline)\w*", row[1])}
    assert named <= set(registry.phases()) and len(rows) > 80
    assert all(len(cell) <= 90 for row in rows for cell in row)
    assert len({row[0] + row[1] for row in rows}) == len(rows)


def test_the_chapter_is_made_from_the_runs_file(tmp_path: Path) -> None:
    document = tmp_path / "table.md"
    document.write_text(TABLE, encoding="utf-8")
    empty = chapter.negative(tmp_path, document)
    assert empty.answer == "" and "<td>1.15</td>" in empty.html
    rows = [row("slow", 0.8, 0.9), row("opt4+rsqrt", 1.1, 1.2, verdict="approximate"), row("good", 1.1, 1.2)]
    store.write_json(tmp_path / "ablations.json", cli.plain(result(*rows)))
    said = chapter.negative(tmp_path, document).answer
    assert said.startswith("2 steps") and "slow on scene0: 0.85" in said
    (part,) = chapter.steps(tmp_path).parts
    assert chapter.COSTS in part.markdown
