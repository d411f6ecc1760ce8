"""scripts/stepwise functions: the front, what is missing, the script, its tables and figures, bad input."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import emitted
import pytest
import started

from study.core import show
from study.core.cli import StudyError
from study.experiments.functions import edge_tables as functions_edges_page
from study.experiments.functions import figures as functions_figures
from study.experiments.functions import measure as functions
from study.experiments.functions import tables as functions_page

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
SCRIPT = (ROOT / "scripts" / "stepwise", "functions")


def made(name: str, ns: float, ulp: float | None, **more: object) -> dict:
    row = {"function": "exp", "precision": "float", "family": "own", "name": name, "isa": "AVX2"}
    time = {"value": ns, "low": ns, "high": ns}
    return row | {"max_ulp": ulp, "stream_ns": time, "missing": None} | more


def test_front() -> None:
    rows = [made("fast", 1, 9.0), made("exact", 5, 0.5), made("worse", 5, 9.0), made("between", 3, 2.0)]
    rows += [made("equal", 3, 2.0), made("NaN", 0.1, None)]
    rows += [made("other", 9, 9.0, function="log"), made("as exact", 4, 2.0), made("as fast", 3, 3.0)]
    functions.mark_front(rows)
    assert [r.get("front") for r in rows] == [True, True, False, True, True, None, True, False, False]


def test_what_is_missing_is_said_once() -> None:
    why = "libsleef.so.3 is not installed"
    rows = [made("a", 1, 1, family="SLEEF", missing=why), made("b", 1, 1, family="SLEEF", missing=why)]
    assert functions.without(rows, False) == [
        f"SLEEF: {why}; 2 entries are left out",
        functions.WITHOUT_MPFR,
    ]
    assert functions.wrong([made("a", 1, None, non_finite=3)]) and not functions.wrong([made("a", 1, 1)])


def test_the_legend_has_what_is_drawn() -> None:
    rows = [made("a", 1, 1), made("b", 1, 1, isa="SSE"), made("c", 1, None, isa="AVX-512", family="SLEEF")]
    (legend,) = functions_figures.figure({"entries": rows}, "float").legends
    named = {text.get_text() for text in legend.get_texts()}
    assert named == {"own", "SSE", "AVX2", "front (filled marks)"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A quick run by the script."""
    path = tmp_path_factory.mktemp("functions")
    command = [sys.executable, *SCRIPT, "--quick", "--rounds", "6", "--vectors", "1024", "--seed", "1"]
    done = started.run([*command, "--json", "--run", path])
    assert done.returncode == 0, done.stderr
    assert emitted.result(done.stdout) == json.loads((path / functions.FILE).read_text())
    return path


def test_script_and_page(folder: Path) -> None:
    result = functions.read(folder)
    assert {r["function"] for r in result["entries"]} == set(functions.FUNCTIONS)
    names = [f"functions-{p}{time}" for p in ("float", "double") for time in ("", "-latency")] + ["normalise"]
    assert {f.name for f in (folder / "figures").iterdir()} == {
        f"{n}.{s}" for n in names for s in ("svg", "png")
    }
    for row in result["entries"]:
        if not row["missing"]:
            assert row["stream_ns"]["value"] > 0 and row["edges"]
    front = functions_page.fronts(result)
    text = show.markdown(show.table(front, functions_page.ON_FRONTS))
    for function in functions.FUNCTIONS:
        assert functions_page.TITLES[function] in text
    ranges = show.markdown(show.table(result["targets"], functions_page.TARGETS))
    assert "every float of [1.175e-38, 3.403e+38]" in ranges and "±[1e-18" not in ranges
    assert "18.35×" in functions_figures.normalise_note(result)
    assert "entries agree with it at every input tried" in functions_edges_page.remark(result)
    tables = functions_page.tables(result)
    assert show.markdown(show.table(tables, functions_page.TABLES)).count(tables[0]["cpu"]) == 5
    assert show.markdown(show.table(result["normalise"], functions_page.NORMALISE)).count("SSE") == 3


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--rounds", "0"], "whole number from 1 to 1000"),
        (["--vectors", "x"], "whole number from 1024"),
        (["--cpu", "9999"], "CPU 9999 is not available"),
    ],
)
def test_bad_arguments(arguments: list[str], said: str) -> None:
    done = started.run([sys.executable, *SCRIPT, *arguments])
    assert done.returncode == 2 and said in done.stderr and not done.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "usage"),
        (["errors", "--threads", "0"], "1 to 1024 is required"),
        (["times", "--rounds"], 'not ""'),
        (["evaluate", "--id", "99999"], "is required"),
        (["evaluate", "--id", "1"], "multiple of 64 bytes"),
        (["sing"], "usage"),
    ],
)
def test_bad_arguments_of_the_bench(arguments: list[str], said: str) -> None:
    done = subprocess.run([functions.program(), *arguments], capture_output=True, text=True, input="abc")
    assert done.returncode == 2 and said in done.stderr and not done.stdout


def test_a_foreign_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / functions.FILE).write_text('{"schema": 2}')
    with pytest.raises(StudyError, match=r"functions\.json: .*\$\.schema: Invalid enum value 2"):
        functions.read(tmp_path)
