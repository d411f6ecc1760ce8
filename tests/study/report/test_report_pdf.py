"""The PDF of a run: what it says is what the run's files say, and typst takes it."""

import dataclasses
import shutil
from pathlib import Path

import msgspec
import pytest

from study.commands import report_pdf
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.numbers import analysis, ladder

PUBLISHED = ROOT / "results" / "reference" / "zen4-2026-11-29"
HOSTILE = '#panic("x") $a$ <script> @ref *b* [c'


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> analysis.Data:
    run = tmp_path_factory.mktemp("machine") / "run"
    shutil.copytree(PUBLISHED, run)
    return analysis.load(run)


@pytest.mark.slow
def test_it_says_what_the_run_says(data, tmp_path):
    told = report_pdf.content(data, report_pdf.shown(data), tmp_path)
    chapters = [one for question in told["questions"] for one in question["chapters"]]
    assert len(told["questions"]) == 5 and len(chapters) == len(report_pdf.CHAPTERS)
    rows = ladder.rows(data)
    fastest = rows[(rows["scene"] == "scene0") & rows["headline"] & (rows["threads"] == 1)]
    best = fastest.loc[fastest["ms"].idxmin()]
    assert str(best["phase"]) in chapters[0]["answer"] and f"{best['ms']:.4f}" in chapters[0]["answer"]
    assert all(one["answer"] for one in chapters)
    tables = [table for one in chapters for table in one["tables"]]
    assert all(len(row) == len(table["heads"]) for table in tables for row in table["rows"])
    (first,) = [table for table in tables if "Table 1" in table["caption"]]
    (scene0,) = [row for row in first["rows"] if row[:2] == ["scene0", "baseline"]]
    assert {"21.68", "20.68"} <= set(scene0)  # counted; the paper's Table 1
    assert len(tables) == len(report_pdf.TABLES) + 2  # the ladder's of two scenes


@pytest.mark.slow
@pytest.mark.usefixtures("rough_figures")
def test_typst_sets_it_whatever_the_machine_is_called(data, tmp_path):
    """Names are data, never markup."""
    cpu = msgspec.structs.replace(data.context.cpu, model=HOSTILE)
    context = msgspec.structs.replace(data.context, cpu=cpu, compiler=HOSTILE)
    out = tmp_path / "out" / "report.pdf"
    out.parent.mkdir()
    try:
        report_pdf.make(dataclasses.replace(data, context=context), out)
    except StudyError as error:
        if "cannot be installed" in str(error):
            pytest.skip(str(error))
        raise
    assert out.read_bytes().startswith(b"%PDF-") and out.stat().st_size > 100_000
    assert [path.name for path in out.parent.iterdir()] == ["report.pdf"]
    broken = tmp_path / "broken"
    broken.mkdir()
    shutil.copy(report_pdf.TEMPLATE, broken)
    with pytest.raises(StudyError, match="typst: "):
        report_pdf.typeset(broken, Path(tmp_path / "none.pdf"))
