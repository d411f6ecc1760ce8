"""What the documents point at is there: published runs and tests by their names, and the targets of links."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from study.commands import tables
from study.experiments.stability import cases
from study.numbers import analysis, ladder

ROOT = Path(__file__).parents[2]
BUILT = {".venv", "build", "out", "runs"}  # not of the repository
DOCUMENTS = [path for path in sorted(ROOT.rglob("*.md")) if not BUILT & {*path.relative_to(ROOT).parts}]
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)\s]*)?\)")
TEST = re.compile(r"`(tests/[\w./]+\.\w+)`")
RUN = re.compile(r"(?:results/reference|…)/([\w.-]*\d{4}-\d\d-\d\d[\w-]*)")


def points(text: str) -> bool:
    """Whether the text names a run or a test, or has a link: of some 500 generated tables none does."""
    return any(pattern.search(text) for pattern in (RUN, TEST, LINK))


def lost(text: str, folder: Path, root: Path = ROOT) -> list[str]:
    """Published runs and tests that the text names, and relative targets of its links, that are not there."""
    runs = [name for name in RUN.findall(text) if not (root / "results" / "reference" / name).is_dir()]
    runs += [name for name in TEST.findall(text) if not (root / name).exists()]
    targets = [target for target in LINK.findall(text) if "://" not in target]
    return runs + [target for target in targets if not (folder / target).exists()]


POINTING = [path for path in DOCUMENTS if points(path.read_text())]


@pytest.mark.parametrize("path", POINTING, ids=lambda path: str(path.relative_to(ROOT)))
def test_what_a_document_points_at_is_there(path: Path) -> None:
    assert not lost(path.read_text(), path.parent)


def test_the_readme_counts_the_hard_cases() -> None:
    said = re.findall(r"(\d+) hard cases", (ROOT / "README.md").read_text())
    assert said == [str(len(cases.cases()))]


@pytest.mark.slow
@pytest.mark.parametrize("option", ["artifact", "limit", "machines"])
def test_a_block_is_what_its_published_runs_say(option: str) -> None:
    page, _ = tables.PAGES[option]
    text = page.read_text()
    run = analysis.load(ROOT / "results" / "reference" / (RUN.findall(text) or ["zen4-2026-11-29"])[0])
    assert tables.rewritten(option, run, ladder.rows(run)) == text, f"stepwise tables RUN --{option}"
