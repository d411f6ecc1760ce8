"""The page of what did not pay: which steps are on it, with which words, and what of the notes."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import matplotlib
import pytest

from study import negative, registry
from study.cli import StudyError
from study.draw import STYLE


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


TEXT = """# opt9: notes

**Outcome** 2×.

## What did not pay (n = 90, *one* thread)

| tried | scene0 |
|---|---|
| <b>roots</b> | 1.15× |

Words behind it.

## After

Not this.
"""


def test_of_the_notes_that_part_is_quoted_and_no_other() -> None:
    found = negative.quoted(TEXT)
    assert found is not None and found.startswith("## What did not pay (n = 90")
    assert "1.15×" in found and "Words behind it." in found
    assert "Outcome" not in found and "Not this" not in found
    assert negative.quoted(
        f"{TEXT}\nDid not pay: *roots* 3 %\nmore of it.\n\nPaid.\n\n*Did not pay* there.\n"
    ) == (found + "\n*In “After”:*\n\nDid not pay: *roots* 3 %\nmore of it.\n\n*Did not pay* there.\n")
    assert negative.quoted("# opt9\n## One\nDid not pay: two.\n") == (
        "## What did not pay\n\n*In “One”:*\n\nDid not pay: two.\n"
    )
    assert negative.quoted("# opt9\n\nWhat did not pay is not said.\n") is None
    assert negative.quoted("## What did not pay\n\nlast") == "## What did not pay\n\nlast\n"
    page = negative.as_html({"opt9": found})
    assert "<h3>opt9: what did not pay (n = 90, *one* thread)</h3>" in page
    assert "<td>1.15×</td>" in page and "<b>" not in page and "&lt;b&gt;roots" in page


def test_the_notes_of_the_phases_are_found(tmp_path: Path) -> None:
    said = negative.notes(registry.ladder())
    assert "rsqrt14" in said["opt6_wide"]
    phase = dataclasses.replace(registry.find_phase("opt1"), path=tmp_path)
    assert negative.notes({"opt1": phase}) == {}
    (tmp_path / "NOTES.md").write_text(TEXT)
    assert negative.notes({"opt1": phase}) == {"opt1": negative.quoted(TEXT)}
    (tmp_path / "HISTORY.md").write_text("# h\n\n## Later\n\nDid not pay: *more*.\n")
    assert negative.notes({"opt1": phase})["opt1"].endswith("*In “Later”:*\n\nDid not pay: *more*.\n")
    (tmp_path / "NOTES.md").unlink()
    assert negative.notes({"opt1": phase})["opt1"].startswith("## What did not pay\n\n*In “Later”:*")


def test_the_chapter_is_made_from_the_runs_file(tmp_path: Path) -> None:
    empty = negative.section(tmp_path, {})
    assert (empty.parts, empty.html, empty.drawn) == ([], "", {})
    rows = [row("opt6_wide+over_relaxation", 0.9, 1.1), row("opt4+rsqrt", 1.1, 1.2, verdict="approximate")]
    rows[0] |= {"psnr_db": None, "against_psnr_db": None}
    result = {"n": 90, "launches": 6, "rows": rows, "skipped": [], "failures": []}
    (tmp_path / "ablations.json").write_text(json.dumps(result))
    chapter = negative.section(tmp_path, {})
    text = chapter.parts[0].markdown
    assert "1.00× [0.90,\u00a01.10] | identical | identical" in text and "pays, at that error" in text
    with matplotlib.rc_context(STYLE):
        (axes,) = chapter.drawn["negative"].make().axes
    shown = [text.get_text() for text in axes.texts]
    assert shown == ["as before: identical", "94.2 → 41.5 dB"]
    (tmp_path / "ablations.json").write_text('{"rows": [{"ablation": 1}], "skipped": [], "failures": []}')
    with pytest.raises(StudyError, match=r"ablations\.json: not what scripts/ablations\.py writes"):
        negative.section(tmp_path, {})


def test_of_a_step_that_is_left_out_the_gain_is_the_steps() -> None:
    row = {"ablation": "opt6_wide+awake", "what": "every shape at every step", "step": "removed"}
    assert negative._what(row) == "left out: every shape at every step; the gain is of what was left out"
    assert negative._what(row | {"step": "added"}) == "every shape at every step"
