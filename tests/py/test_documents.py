"""What the documents point at is there: published runs by their names, and the targets of links."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BUILT = {".venv", "build", "out", "runs"}  # not of the repository
DOCUMENTS = [path for path in sorted(ROOT.rglob("*.md")) if not BUILT & {*path.relative_to(ROOT).parts}]
RUN = re.compile(r"(?:results/reference|…)/([\w.-]*\d{4}-\d\d-\d\d[\w-]*)")


def lost(text: str, folder: Path, root: Path = ROOT) -> list[str]:
    """Published runs that the text names, and relative targets of its links, that are not there."""
    runs = [name for name in RUN.findall(text) if not (root / "results" / "reference" / name).is_dir()]
    targets = [target for target in re.findall(r"\]\(([^)#\s]+)\)", text) if "://" not in target]
    return runs + [target for target in targets if not (folder / target).exists()]


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_what_a_document_points_at_is_there(path: Path) -> None:
    assert not lost(path.read_text(), path.parent)


def test_what_is_not_there_is_found(tmp_path: Path) -> None:
    (tmp_path / "results/reference/pc-2026-01-02").mkdir(parents=True)
    text = "`results/reference/pc-2026-01-02`, …/pc-2026-01-02-more, [x](here.md), [y](https://a.b/c)"
    assert lost(text, tmp_path, tmp_path) == ["pc-2026-01-02-more", "here.md"]
