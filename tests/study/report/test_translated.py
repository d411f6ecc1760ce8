"""Code that SIMDe translated says so under every table that has it, and nowhere else."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from study.core import cli, commands, registry, show
from study.core.registry import ROOT
from study.experiments import experiment
from study.numbers import analysis, columns, ladder
from study.report import published_tables

pytestmark = pytest.mark.usefixtures("few_resamples")
BY = {"opt3": "avx2 by SIMDe", "opt4": "avx2 by SIMDe"}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run whose frames say of opt3 and opt4 what arm64's build writes (common/build/phase_info.py)."""
    made = Path(shutil.copytree(ROOT / "tests" / "fixtures" / "run", tmp_path / "machine" / "run"))
    path = made / "frames.jsonl"
    frames = [json.loads(line) for line in path.read_text().splitlines()]
    frames = [one | {"isa": BY.get(one["phase"], "aarch64")} for one in frames]
    path.write_text("".join(json.dumps(one) + "\n" for one in frames))
    return made


def test_every_table_of_the_page_with_such_a_phase_names_it(run: Path) -> None:
    data = analysis.load(run)
    assert data.by_simde == ["opt3", "opt4"]
    sections = experiment.sections(data)
    said = 0
    for part in (part for section in sections for part in section.parts):
        names = {show.cell(row, key) for row in part.rows for key in ("phase", "spec")}
        lines = [line for line in part.foot.splitlines() if "SIMDe" in line]
        if mine := [name for name in BY if name in names]:
            assert len(lines) == 1 and lines[0].startswith(f"{', '.join(mine)}: "), part.name
            assert lines[0] in part.markdown
            said += 1
        else:
            assert not lines, part.name
    assert said > 3


def test_the_ladders_own_tables_mark_the_row(run: Path) -> None:
    rows = ladder.rows(analysis.load(run))
    text = show.markdown(show.table(list(rows.to_dict("records")), columns.LADDER))
    assert "opt4 (SIMDe)" in text and "opt1 (SIMDe)" not in text
    block = published_tables.ladder_block(analysis.load(run), rows)
    assert block.count("opt3, opt4: ") == 1


def test_a_machines_table_of_published_runs_says_so(run: Path) -> None:
    """Its pictures have 720 rows, the fixture's 180."""
    path = run / "frames.jsonl"
    path.write_text(path.read_text().replace('"height": 180', '"height": 720'))
    other = Path(shutil.copytree(ROOT / "tests" / "fixtures" / "run", run.parent / "x86"))
    (other / "frames.jsonl").write_text(
        (other / "frames.jsonl").read_text().replace('"height": 180', '"height": 720')
    )
    context = json.loads((other / "context.json").read_text())
    context["cpu"]["microarchitecture"] = "Another"
    (other / "context.json").write_text(json.dumps(context))
    block = published_tables.machines_block([analysis.load(run), analysis.load(other)])
    assert block.count("| opt4 |") == 2 and block.count("opt3, opt4: ") == 1


def test_a_run_of_x86_says_nothing() -> None:
    data = analysis.load(ROOT / "tests" / "fixtures" / "run")
    assert data.by_simde == []
    assert not any("SIMDe" in part.markdown for one in experiment.sections(data) for part in one.parts)


def test_what_a_command_prints_there_has_the_remark(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "by_simde", lambda: ["opt3", "opt4"])
    outcome = commands.noted(cli.Outcome(lines=iter(["| opt4 |", "| opt30 |"]), remarks=["first"]))
    assert outcome.lines == ["| opt4 |", "| opt30 |"] and outcome.remarks[0] == "first"
    assert [one.partition(":")[0] for one in outcome.remarks[1:]] == ["opt4"]
    assert commands.noted(cli.Outcome(lines=["| opt1 |"])).remarks == []
