"""The chapters that hold a run against truth have their figures from its files alone."""

from pathlib import Path

import pytest

from study.core import cli, store
from study.core.registry import ROOT
from study.experiments.accuracy import experiment as accuracy
from study.numbers.accuracy import FILE, Accuracy
from study.report import figures

PUBLISHED = max((ROOT / "results" / "reference").glob("*/pareto.json")).parent


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A run with the file of accuracy, and no picture."""
    result = Accuracy.load(PUBLISHED / FILE)
    result.rows = [r for r in result.rows if r.scene == "trio" and r.phase in ("baseline", "opt4")]
    store.write_json(tmp_path / FILE, cli.plain(result))
    return tmp_path


def test_what_only_rendering_makes_is_said(folder: Path) -> None:
    section = accuracy.errors(folder)
    assert len(figures.absent(section)) == 2 and section.script.endswith("--scene trio -n 180")
    for path in section.images:
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(b"picture")
    assert figures.absent(section) == []
