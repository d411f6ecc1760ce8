"""The pages of the hard cases come from stability.json alone, and say what is in it."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path

import emitted
import pytest
import started

from study.core import registry, store
from study.core.cli import StudyError
from study.experiments.stability import cases as hard
from study.experiments.stability import tables as hard_page
from study.experiments.stability.cases import measure

HALO = dataclasses.replace(
    hard.find_cases(["halo"])[0], why="narrow & <b>wide</b>, *so*", strengths=(1.0, 0.1, 1e-6)
)


def data(**changes: object) -> dict:
    """Two phases on one case: one hangs at last, one is right, with markup in a note."""
    hangs = [measure.Point(1.0, measure.RIGHT, 0.0), measure.Point(0.1, measure.WRONG, 2.5, note="a <i> b")]
    right = [measure.Point(s, measure.RIGHT, 1e-4) for s in HALO.strengths]
    rows = [
        measure.row("opt3", HALO, [*hangs, measure.Point(1e-6, measure.HUNG, note="not done after 6 s")]),
        measure.row("opt4", HALO, right),
    ]
    phases = [{"name": name, "precision": "float"} for name in ("opt3", "opt4")]
    return {
        "schema": 1,
        "phases": phases,
        "cases": [measure.about(HALO)],
        "results": rows,
        "skipped": [],
    } | changes


@pytest.fixture
def written(tmp_path: Path) -> dict:
    store.write_json(tmp_path / "stability.json", data())
    return hard_page.read(tmp_path / "stability.json")


def test_page(written: dict) -> None:
    text = hard_page.page(written, written["cases"][0])
    assert "<dd>narrow &amp; &lt;b&gt;wide&lt;/b&gt;, <em>so</em></dd>" in text
    assert (
        "<strong>opt3:</strong> fails from 0.1: an error of 2.5 scene units" in text
        and "a &lt;i&gt; b" in text
    )
    assert "<strong>opt4:</strong> right throughout; the largest error is 10⁻⁴ scene units" in text
    assert "<td class=bad>hung</td>" in text and "data:image/" in text


def test_table(written: dict) -> None:
    text = hard_page.table(written)
    assert text.count("<tr>") == 2 and 'href="#hard-03-halo"' in text
    assert ">0.1</td>" in text and '<td class="good">·</td>' in text
    hung = data()["results"][0] | {"first_failure": 1e-6}
    assert "<strong>hung</strong>" in hard_page.cell(hung)
    assert "refuses" in hard_page.cell(hung | {"refused": True}) and "not run" in hard_page.cell(None)


def test_write(written: dict, tmp_path: Path) -> None:
    index = hard_page.write(written, tmp_path / "pages")
    assert 'href="hard-03-halo.html"' in index.read_text()
    assert "What each phase does" in (tmp_path / "pages" / "hard-03-halo.html").read_text()
    assert hard_page.page(written, written["cases"][0]) in hard_page.section(written)


@pytest.mark.parametrize(
    "broken",
    [
        {"schema": 2},
        {"results": [{}]},
        {"cases": [{"number": 1}]},
        {"phases": [{"name": "other"}]},
        {"phases": []},
    ],
)
def test_not_a_stability_json(tmp_path: Path, broken: dict) -> None:
    store.write_json(tmp_path / "stability.json", data(**broken))
    with pytest.raises(StudyError, match=r"stability.json: not what scripts/stepwise stability writes"):
        hard_page.read(tmp_path / "stability.json")


def stability(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, registry.ROOT / "scripts" / "stepwise", "stability", *map(str, arguments)]
    return started.run(command)


def test_script(tmp_path: Path) -> None:
    """A wrong answer (the step cap's) is a result: status 0, files beside it."""
    done = stability(
        "--phase", "opt2", "--case", "step_cap", "--strengths", "few", "--json", "--run", tmp_path
    )
    assert done.returncode == 0, done.stderr
    (found,) = emitted.result(done.stdout)["results"]
    assert (
        found["case"] == "step_cap"
        and found["phase"] == "opt2"
        and found["first_failure"] in found["strengths"]
    )
    assert found["non_finite"] == 0 and found["hung"] is False and len(found["errors"]) == 3
    assert found == store.read_json(tmp_path / "stability.json")["results"][0]
    names = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    figure = "figures/hard-04-step-cap"
    assert names == {
        "stability.json",
        "pages/index.html",
        "pages/hard-04-step-cap.html",
        f"{figure}.svg",
        f"{figure}.png",
    }


def test_script_refuses(tmp_path: Path) -> None:
    for arguments, said in [
        (["--case", "hello"], "no hard case 'hello'"),
        (["--phase", "opt9"], "no phase 'opt9'"),
        (["--time-limit", "nan"], "must be a number of seconds above 0"),
    ]:
        done = stability(*arguments, "--run", tmp_path)
        assert done.returncode == 2 and said in done.stderr and not list(tmp_path.iterdir())


def test_script_fails_for_a_hang(tmp_path: Path) -> None:
    """No picture is done in a microsecond: every point hangs, and the status says so."""
    done = stability(
        "--phase", "opt2", "--case", "halo", "--strengths", "few", "--time-limit", "1e-6", "--run", tmp_path
    )
    assert (
        done.returncode == 1 and "FAIL opt2, case 3 halo at 0.1: hung (not done after 1e-06 s)" in done.stderr
    )
    assert store.read_json(tmp_path / "stability.json")["results"][0]["hung"] is True


def test_list() -> None:
    listed = emitted.result(stability("--list", "--json").stdout)["cases"]
    assert [case["number"] for case in listed] == [case.number for case in hard.cases()]
