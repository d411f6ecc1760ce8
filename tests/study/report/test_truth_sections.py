"""The chapters that hold a run against truth have their figures from its files alone."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from study.commands import report
from study.core import cli, store
from study.core.registry import ROOT
from study.experiments.accuracy import chapter as accuracy
from study.experiments.functions import figures as functions
from study.numbers import analysis
from study.numbers.accuracy import FILE, Accuracy
from study.pictures import ladder
from study.report import figures

PUBLISHED = max((ROOT / "results" / "reference").glob("*/pareto.json")).parent


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The fixture run with the files of speed against error, accuracy and functions, and no picture."""
    made = Path(shutil.copytree(ROOT / "tests" / "fixtures" / "run", tmp_path / "machine" / "run"))
    for name in ("pareto.json", "functions.json"):
        shutil.copy(PUBLISHED / name, made)
    result = Accuracy.load(PUBLISHED / FILE)
    result.rows = [r for r in result.rows if r.scene == "trio" and r.phase in ("baseline", "opt4")]
    store.write_json(made / FILE, cli.plain(result))
    return made


@pytest.mark.slow
def test_the_page_has_its_figures_from_the_files_alone(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ladder, "PLOTS", {})
    one, few = functions.drawings, ("functions-float", "functions-float-latency")
    monkeypatch.setattr(functions, "drawings", lambda r: {n: one(r)[n] for n in few})
    stale = folder / "figures" / "pareto.png"
    stale.parent.mkdir()
    stale.write_bytes(b"of an older file")
    html = report.page(analysis.load(folder, strict=False), tmp_path / "out" / "index.html")
    chapters = dict(re.findall(r'<section id="(\w+)">(.*?)</section>', html, re.DOTALL))
    assert all(chapters[name].count("<figure") for name in ("pareto", "accuracy", "functions"))
    drawn = {path.stem for path in (tmp_path / "out" / "figures").iterdir()}
    assert drawn >= {"pareto", "pareto-distance", "accuracy-where", *few}
    assert (tmp_path / "out" / "figures" / "pareto.png").read_bytes() != stale.read_bytes()


def test_what_only_rendering_makes_is_said(folder: Path) -> None:
    section = accuracy.errors(folder)
    assert len(figures.absent(section)) == 2 and section.script.endswith("--scene trio -n 180")
    for path in section.images:
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(b"picture")
    assert figures.absent(section) == []
