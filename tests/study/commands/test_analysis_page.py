"""docs/analysis.md: its Python runs, and says what the published run's own tables say."""

import contextlib
import io
import json
import re

import pytest

from study.core.registry import ROOT

PAGE = ROOT / "docs" / "analysis.md"
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def session() -> tuple[dict, list[str]]:
    """The names after all blocks, and what each block printed, in the project's folder."""
    names: dict = {}
    printed = []
    with contextlib.chdir(ROOT):
        for block in BLOCK.findall(PAGE.read_text(encoding="utf-8")):
            with contextlib.redirect_stdout(io.StringIO()) as out:
                exec(block, names)
            printed.append(out.getvalue())
    return names, printed


def test_the_table_has_what_the_frames_say(session):
    """The median over launches of each launch's median frame, in its interval; the error beside it."""
    names, printed = session
    (line,) = [line for line in printed[1].splitlines() if "opt10_scene" in line]
    ms, low, high, faster, truth = map(float, line.split()[1:])
    frames = names["frames"]
    timed = frames[(frames["scene"] == "scene0") & ~frames["warmup"]]
    by_launch = timed.groupby(["phase", "launch"])["ns"].median().groupby("phase").median() / 1e6
    assert low < ms < high and ms == pytest.approx(by_launch["opt10_scene"], abs=0.005)
    assert faster == pytest.approx(by_launch["baseline"] / by_launch["opt10_scene"], rel=0.02)
    assert truth == pytest.approx(96.0, abs=0.05)


NOTEBOOK = ROOT / "docs" / "notebook.ipynb"


@pytest.fixture(scope="module")
def notebook() -> dict:
    """The names after all code cells, run in the notebook's folder as Jupyter does."""
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    names: dict = {}
    with contextlib.chdir(NOTEBOOK.parent):
        for cell in cells:
            assert not cell.get("outputs")
            if cell["cell_type"] == "code":
                exec("".join(cell["source"]), names)
    return names


def test_the_notebook_plots_what_its_table_says(notebook):
    (axes,) = notebook["figure"].axes
    marks = axes.collections[0].get_offsets()
    table = notebook["table"].dropna(subset=["truth_psnr_db"]).drop(index="opt5_threads")
    assert {"baseline", "opt10_scene"} <= set(table.index)
    assert marks.tolist() == table[["speedup", "truth_psnr_db"]].values.tolist()
    assert [text.get_text() for text in axes.texts] == list(table.index)
    medians = notebook["launches"].groupby("phase").median()
    assert medians["opt10_scene"] == pytest.approx(table.loc["opt10_scene", "ms"], rel=0.02)
