"""What the documents point at is there: published runs by their names, and the targets of links."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from study.core import store
from study.numbers import analysis, ladder

ROOT = Path(__file__).parents[2]
BUILT = {".venv", "build", "out", "runs"}  # not of the repository
DOCUMENTS = [path for path in sorted(ROOT.rglob("*.md")) if not BUILT & {*path.relative_to(ROOT).parts}]
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)\s]*)?\)")
RUN = re.compile(r"(?:results/reference|…)/([\w.-]*\d{4}-\d\d-\d\d[\w-]*)")


def points(text: str) -> bool:
    """Whether the text names a published run or has a link: of some 500 generated tables none does."""
    return bool(RUN.search(text) or LINK.search(text))


def lost(text: str, folder: Path, root: Path = ROOT) -> list[str]:
    """Published runs that the text names, and relative targets of its links, that are not there."""
    runs = [name for name in RUN.findall(text) if not (root / "results" / "reference" / name).is_dir()]
    targets = [target for target in LINK.findall(text) if "://" not in target]
    return runs + [target for target in targets if not (folder / target).exists()]


POINTING = [path for path in DOCUMENTS if points(path.read_text())]


@pytest.mark.parametrize("path", POINTING, ids=lambda path: str(path.relative_to(ROOT)))
def test_what_a_document_points_at_is_there(path: Path) -> None:
    assert not lost(path.read_text(), path.parent)


def test_what_is_not_there_is_found(tmp_path: Path) -> None:
    (tmp_path / "results/reference/pc-2026-01-02").mkdir(parents=True)
    text = "`results/reference/pc-2026-01-02`, …/pc-2026-01-02-more, [x](here.md), [y](https://a.b/c)"
    assert lost(text, tmp_path, tmp_path) == ["pc-2026-01-02-more", "here.md"]


def test_documents_that_point_at_something_are_looked_at(tmp_path: Path) -> None:
    assert not points("| a | b |\n\nRuns: results/reference/README.md, [1, 2] (n = 3)")
    assert points("[x](here.md#part)") and points("`results/reference/pc-2026-01-02`")
    assert ROOT / "README.md" in POINTING and {*POINTING} < {*DOCUMENTS}


def test_the_list_of_a_runs_files_is_whole() -> None:
    """results/README.md has every file that a published run has; runs are named as it says."""
    text = (ROOT / "results" / "README.md").read_text()
    runs = [path for path in (ROOT / "results" / "reference").iterdir() if path.is_dir()]
    files = {path.name.removesuffix(".gz") for run in runs for path in run.iterdir() if path.is_file()}
    assert files and not [name for name in sorted(files) if f"| `{name}` |" not in text]
    assert "results/reference/MACHINE-DATE/" in text
    assert all(re.fullmatch(r"[\w-]+-\d{4}-\d\d-\d\d[\w-]*", run.name) for run in runs)


def rows_of(text: str) -> dict[str, list[float]]:
    """Phase → the numbers of its row in a table of a page."""
    found = re.findall(r"^\| (\w+) \| (\d[^|]+) \|", text, re.MULTILINE)
    return {name: [float(x.replace(",", "")) for x in re.findall(r"[\d.,]*\d", cell)] for name, cell in found}


def test_the_page_of_limits_has_the_numbers_of_its_run() -> None:
    """To the digits that the page has: cycles a pixel, and what the general code of two kernels does."""
    text = (ROOT / "docs" / "limit.md").read_text()
    (name,) = set(RUN.findall(text))
    run = analysis.load(ROOT / "results" / "reference" / name)
    timed = ladder.rows(run)
    timed = timed[(timed["scene"] == "scene0") & (timed["height"] == 720)].set_index("phase")
    stated = rows_of(text.partition("## Beside the phases")[2])
    assert len(stated) == 6
    for phase, numbers in stated.items():
        for number, end in zip(numbers, ("", "_low", "_high"), strict=True):
            value = timed.loc[phase, f"core_cycles_per_pixel{end}"]
            assert number == pytest.approx(value, rel=5e-3), phase
    for row in store.read_json(store.stored(run.path / "counts.json"))["measured"]:
        if row["scene"] == "scene0" and row["variant"] == "shipped":
            total, pixels = row["total"], row["width"] * row["height"]
            flops, loaded, stored = (
                round(total[key] / pixels) for key in ("machine", "load_bytes", "store_bytes")
            )
            if row["phase"] == "opt11_ideal":
                assert f"moves {loaded + stored} bytes a pixel: {loaded} loaded" in text
                assert f"executes {flops} FLOPs a pixel" in text
            if row["phase"] == "opt10_scene":
                assert f"executes {flops} FLOPs a pixel and moves {loaded + stored} bytes" in text


def test_the_lesson_of_opt9_has_the_times_of_its_run() -> None:
    text = (ROOT / "phases" / "opt9_convex" / "NOTES.md").read_text()
    said = " ".join(text.partition("## Result")[2].partition("<!--")[0].split())
    (name,) = set(RUN.findall(said))
    timed = ladder.rows(analysis.load(ROOT / "results" / "reference" / name)).set_index(["scene", "phase"])
    for scene in ("scene0", "mandelbulb"):
        pair = [timed.loc[(scene, phase), "ms"] for phase in ("opt8_streams", "opt9_convex")]
        before, after = re.search(rf"{scene} ([\d.]+)(?: ms)? \[[^]]*\] → ([\d.]+)", said).groups()
        assert [float(before), float(after)] == pytest.approx(pair, rel=5e-4)
